"""Row 16 on the default engine: Ctrl-C ends it at once, and nothing that it started outlives it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from roboscribe.stages.tracking.mlflow_store import synchronise
from tests.pipelines.stores import empty_store, statuses
from tests.reliability.terminal import CTRL_C, ROOT, Terminal, open_terminal
from tests.reliability.test_runs import told_statuses

SECONDS = 2.5
"""Seconds from Ctrl-C to the prompt: the orderly end may take 1.5, and test machines are busy."""
COMMAND = ["synthesize", "point-pick-place-1", "--profile", "scripted", "--episodes", "100000"]


SWEEP = ["--seeds", "0-2", "--jobs", "2", "--engine", "local"]


def ends_in_order(terminal: Terminal) -> None:
    """Press Ctrl-C, and expect the prompt soon, with one line that says how to go on."""
    codes: list[int | None] = []

    def over() -> bool:
        codes.append(terminal.ended())
        return codes[-1] is not None

    pressed = time.monotonic()
    terminal.press(CTRL_C)
    terminal.wait_for(over)
    assert time.monotonic() - pressed < SECONDS
    assert codes[-1] == 130
    terminal.read(0.1)
    assert b"interrupted; the same command goes on from here" in terminal.shown
    assert b"Traceback" not in terminal.shown


@pytest.mark.torture
def test_row_16_ctrl_c_in_a_sweep_of_seeds(tmp_path: Path) -> None:
    """Each seed is a process of its own; none outlives the command, and the logs say nothing of tracebacks."""
    terminal = open_terminal([*COMMAND, *SWEEP, "--home", str(tmp_path)])
    terminal.wait_for(lambda: len(list((tmp_path / "data").glob("stages/ingest/*/manifest.json"))) == 2)
    ends_in_order(terminal)
    assert psutil.wait_procs(terminal.family, timeout=120)[1] == []
    logs = [path.read_text() for path in (tmp_path / "data" / "runs").glob("*/seed-*.log")]
    assert len(logs) == 2, "the third seed never began"
    assert not any("Traceback" in log for log in logs)


@pytest.mark.torture
def test_row_16_ctrl_c_on_the_default_engine(tmp_path: Path) -> None:
    """Formerly it also ended Prefect's server, to which the run then talked for 80 s until it died of a traceback."""
    empty_store(tmp_path / "mlruns")
    terminal = open_terminal([*COMMAND, "--home", str(tmp_path)])
    terminal.wait_for(lambda: any((tmp_path / "data").glob("stages/roll_out/*/manifest.json")))
    ends_in_order(terminal)
    servers = [child for child in terminal.family if child.is_running() and "prefect" in " ".join(child.cmdline())]
    assert psutil.wait_procs(servers, timeout=5)[1] == []
    assert psutil.wait_procs(terminal.family, timeout=120)[1] == [], "the copying process ends when all is copied"
    assert told_statuses(tmp_path) == ["RUNNING", "KILLED"]
    synchronise(tmp_path / "data" / "runs", tmp_path / "mlruns")
    assert statuses(tmp_path / "mlruns")["point-pick-place-1 seed 0"] == "KILLED"


def test_row_16_a_server_ends_with_its_owner_however_that_ends(tmp_path: Path) -> None:
    """Formerly one in three outlived `kill -9`."""
    script = (
        "import sys, time; from pathlib import Path\n"
        "from roboscribe.pipelines.flows.prefect_server import prefect_server\n"
        "with prefect_server(Path(sys.argv[1])) as server:\n"
        "    print(server.process.pid, flush=True); time.sleep(float(sys.argv[2]) if server.process else 0)"
    )
    own = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    for moment in (0.0, 0.3):
        command = [sys.executable, "-c", script, str(tmp_path), "600"]
        owner = subprocess.Popen(command, env={**own, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE)
        assert owner.stdout is not None
        server = psutil.Process(int(owner.stdout.readline()))
        time.sleep(moment)
        owner.send_signal(signal.SIGKILL)
        owner.communicate()
        assert psutil.wait_procs([server], timeout=5)[1] == []
