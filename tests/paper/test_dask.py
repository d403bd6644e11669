"""Cells side by side on a local Dask cluster: the same table as one after the other. Needs prefect-dask."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tests.paper import side_by_side


@pytest.mark.slow
def test_two_workers_give_the_same_table(tmp_path: Path) -> None:
    pytest.importorskip("prefect_dask")
    tables = []
    for workers in (0, 2):
        home = tmp_path / f"workers-{workers}"
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PREFECT_HOME": str(home / "prefect")}
        command = [sys.executable, "-m", side_by_side.__name__, str(home), str(workers)]
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=500)
        assert ended.returncode == 0, ended.stderr
        tables.append(pd.read_csv(home / "report" / "curves.csv").drop(columns="wall_seconds"))
    assert tables[0].equals(tables[1])
