"""Prefect's pages, looked at in a real browser: what a user sees of a synthesis."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from uuid import UUID

import pytest

from tests.pipelines.browser import needs_browser, seen, serving

SCRIPT = """
import sys
from pathlib import Path
from tests.pipelines.runs import run, scripted
run(scripted(), Path(sys.argv[1]), "prefect")
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return Prefect's home after one synthesis."""
    home = tmp_path_factory.mktemp("prefect")
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PREFECT_HOME": str(home)}
    words = [sys.executable, "-c", SCRIPT, str(tmp_path_factory.mktemp("flow"))]
    subprocess.run(words, env=variables, check=True, timeout=480)
    return home


@pytest.fixture(scope="module")
def address(home: Path) -> Iterator[str]:
    """Serve Prefect's own interface on that home."""
    words = [sys.executable, "-m", "prefect", "server", "start", "--port"]
    with serving(
        lambda port: [*words, str(port)],
        "/api/health",
        home / "server.log",
        lambda port: {"PREFECT_HOME": str(home), "PREFECT_UI_API_URL": f"http://127.0.0.1:{port}/api"},
    ) as address:
        yield address


@needs_browser
def test_a_synthesis_is_a_run_that_tells_its_story(home: Path, address: str, tmp_path: Path) -> None:
    with sqlite3.connect(home / "prefect.db") as database:
        ((key,),) = database.execute("select id from flow_run").fetchall()
        ((tasks,),) = database.execute("select count(*) from task_run").fetchall()
    text = " ".join(seen(f"{address}/runs/flow-run/{UUID(key)}", tmp_path).split())
    assert "Runs point-pick-place-1 seed 0 Completed" in text
    assert f"{tasks} Task runs" in text
    assert "refinement 1: hold ≡" in text
    assert "its program explains 12 of 12 demonstrations" in text
    assert "def PointPickPlace1(μ : EE):" in text


@needs_browser
def test_its_program_and_its_refinements_are_artifacts(home: Path, address: str, tmp_path: Path) -> None:
    with sqlite3.connect(home / "prefect.db") as database:
        keys = dict(database.execute("select key, id from artifact").fetchall())
    for name, words in {"program": "success 100.0 %", "refinements": "predicate"}.items():
        text = " ".join(seen(f"{address}/artifacts/artifact/{UUID(keys[name])}", tmp_path / name).split())
        assert words in text
