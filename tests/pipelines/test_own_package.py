"""A task in a package of its own, outside the repository: registered, demonstrated, synthesised, evaluated, filmed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from tests.envs.own_task import write_package
from tests.reliability.terminal import ROOT


def test_a_package_of_ones_own_needs_no_change_of_ours(tmp_path: Path) -> None:
    package, work = tmp_path / "package", tmp_path / "work"
    package.mkdir()
    work.mkdir()
    write_package(package)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(package), str(ROOT)])}

    def roboscribe(*words: str) -> str:
        command = [sys.executable, "-m", "roboscribe.pipelines.cli", *words]
        done = subprocess.run(command, cwd=work, env=environment, check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    roboscribe("demos", "slide", "--episodes", "20", "--out", "shown.parquet")
    learned = ("synthesize", "slide", "--demos", "shown.parquet", "--engine", "local", "--episodes", "40")
    program = roboscribe(*learned, "--budget", "60000", "--home", ".", "--out", "slide", "--json", "slide.json")
    assert "b := get(λb:button. true)" in program
    assert json.loads((work / "slide.json").read_text(encoding="utf-8"))["success"] >= 0.95
    assert "success 100.0 %" in roboscribe("evaluate", "slide", "--episodes", "20", "--home", ".")
    roboscribe("render", "slide", "--out", "slide.gif", "--home", ".")
    assert (work / "slide.gif").stat().st_size > 1000
