"""Row 5: with Prefect and without, the outputs are the same; with it, every stage is a named task run."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from pathlib import Path
from uuid import UUID

from tests.pipelines.runs import contents, outputs, run, scripted

SCRIPT = """
import sys
from pathlib import Path
from uuid import UUID
from tests.pipelines.runs import run, scripted
print(run(scripted(), Path(sys.argv[1]), "prefect")["success"])
"""


def test_row_5_both_engines_give_the_same(tmp_path: Path) -> None:
    labels: list[str] = []
    result = run(scripted(), tmp_path / "local", on_stage=labels.append)
    paths = {"PYTHONPATH": os.pathsep.join(sys.path), "PREFECT_HOME": str(tmp_path / "prefect")}
    command = [sys.executable, "-c", SCRIPT, str(tmp_path / "flow")]
    ended = subprocess.run(command, env={**os.environ, **paths}, capture_output=True, text=True, timeout=480)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == "", "nothing of Prefect's own is printed, whatever settings a user has"
    assert isinstance(result, dict)
    assert ended.stdout.split() == [str(result["success"])]
    assert contents(tmp_path / "flow" / "program") == contents(tmp_path / "local" / "program")
    assert outputs(tmp_path / "flow") == outputs(tmp_path / "local")
    with sqlite3.connect(tmp_path / "prefect" / "prefect.db") as database:
        tasks = database.execute("select name, state_type from task_run order by expected_start_time").fetchall()
        flows = database.execute("select name, state_type from flow_run").fetchall()
        waited = waited_for(database)
        lines = [message for (message,) in database.execute("select message from log order by timestamp")]
        artifacts = dict(database.execute("select key, data from artifact"))
    assert tasks == [(label, "COMPLETED") for label in labels]
    assert flows == [("point-pick-place-1 seed 0", "COMPLETED")]
    assert {"train hold", "classify ψ_R", "roll out at", "evaluate program"} <= set(labels)
    assert waited["collect demonstrations"] == set()
    assert waited["ingest demonstrations"] == {"collect demonstrations"}
    assert waited["update tree with hold"] == {"classify ψ_R"}
    assert waited["roll out hold"] == {"generate program for hold", "train hold"}
    assert "train R" in waited["train hold"], "the library grows"
    assert any(line.startswith("refinement 1: hold ≡ ") for line in lines)
    assert set(artifacts) == {"program", "refinements"}
    assert "success 100.0 %" in artifacts["program"]


def waited_for(database: sqlite3.Connection) -> dict[str, set[str]]:
    """Return the edges of Prefect's graph, by the names of task runs; of several of one name those of the last."""
    rows = database.execute("select id, name, task_inputs from task_run order by expected_start_time").fetchall()
    names = {UUID(key): name for key, name, _ in rows}
    return {
        name: {names[UUID(each["id"])] for group in json.loads(inputs).values() for each in group}
        for _, name, inputs in rows
    }
