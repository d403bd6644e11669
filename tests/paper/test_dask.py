"""Cells side by side on a local Dask cluster: the same table as one after the other. Needs prefect-dask."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

SCRIPT = """
import sys
from pathlib import Path
from rich.console import Console
from roboscribe.pipelines.workspace import Workspace
from roboscribe.pipelines.paper.curves import draw_curves
from roboscribe.pipelines.paper.experiment import ExperimentContext, Options
from roboscribe.pipelines.paper.cell_runner import Runner

if __name__ == "__main__":
    options = Options(("point-pick-place-1",), ("roboscribe",), ("scripted",), seeds=2, evaluation_episodes=10)
    home, workers = Path(sys.argv[1]), int(sys.argv[2])
    context = ExperimentContext(Workspace(home), Runner("local", workers), home / "report", track=False)
    draw_curves(options, context, Console())
"""


@pytest.mark.slow
def test_two_workers_give_the_same_table(tmp_path: Path) -> None:
    pytest.importorskip("prefect_dask")
    (tmp_path / "script.py").write_text(SCRIPT)
    tables = []
    for workers in (0, 2):
        home = tmp_path / f"workers-{workers}"
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PREFECT_HOME": str(home / "prefect")}
        command = [sys.executable, str(tmp_path / "script.py"), str(home), str(workers)]
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=500)
        assert ended.returncode == 0, ended.stderr
        tables.append(pd.read_csv(home / "report" / "curves.csv").drop(columns="wall_seconds"))
    assert tables[0].equals(tables[1])
