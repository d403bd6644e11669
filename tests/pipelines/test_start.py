"""How soon the library and the command line are there, in seconds of the processor."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.reliability.terminal import ROOT

HELP = "import sys; sys.argv = ['roboscribe', '--help']; from roboscribe.pipelines.cli import main; main()"
HEAVY = {"numpy", "torch", "mujoco", "pyarrow", "mlflow", "prefect", "sklearn", "scipy", "pandas", "matplotlib"}


def processor_seconds(code: str) -> float:
    """Run some code in a fresh interpreter; returns the least of three times."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    found = []
    for _ in range(3):
        before = os.times()
        subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, check=True, capture_output=True)
        after = os.times()
        found.append(after.children_user + after.children_system - before.children_user - before.children_system)
    return min(found)


@pytest.mark.parametrize(("code", "most"), [("import roboscribe", 0.3), (HELP, 0.5)])
def test_a_start_is_quick(code: str, most: float) -> None:
    assert processor_seconds(code) <= most


@pytest.mark.parametrize("code", ["import roboscribe", "import roboscribe.pipelines.cli"])
def test_a_start_loads_nothing_heavy(code: str) -> None:
    script = f"import sys; {code}; print(*sys.modules)"
    told = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, cwd=ROOT)
    assert not HEAVY & {name.partition(".")[0] for name in told.stdout.split()}
