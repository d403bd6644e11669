"""What is installed: one package, nothing of the checkout, and data goes where the user is."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "data", "mlruns", "build", "*.egg-info", "__pycache__", ".*_cache")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from a copy of the sources."""
    here = tmp_path_factory.mktemp("wheel")
    shutil.copytree(ROOT, here / "sources", symlinks=True, ignore=LEFT_OUT)
    words = [sys.executable, "-m", "pip", "wheel", str(here / "sources"), "--no-deps", "--no-build-isolation"]
    subprocess.run([*words, "--quiet", "--wheel-dir", str(here)], check=True)
    return next(here.glob("*.whl"))


@pytest.mark.slow
def test_the_wheel_holds_one_package_with_all_that_it_needs(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        about = archive.read(metadata).decode()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"roboscribe"}
    for needed in ("pipelines/report/page.html", "trained/tower-5/program.txt", "stages/train.py", "py.typed"):
        assert f"roboscribe/{needed}" in names
    for entry in ("Classifier: ", "Author", "Requires-Python: ", "License-Expression: MIT"):
        assert entry in about


@pytest.mark.slow
def test_it_works_in_another_folder_and_keeps_its_data_there(wheel: Path, tmp_path: Path) -> None:
    site, away = tmp_path / "site", tmp_path / "away"
    away.mkdir()
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site), str(wheel)], check=True
    )
    before = {path for path in site.rglob("*") if "__pycache__" not in path.parts}
    words = ["synthesize", "point-pick-place-1", "--profile", "scripted", "--engine", "local", "--episodes", "20"]
    few = ["--set", "n_demonstrations=12", "--set", "rollout_episodes=20", "--set", "video=false"]
    # -S: no editable install of the checkout; the packages that ours needs are named by hand
    paths = os.pathsep.join((str(site), sysconfig.get_path("purelib")))
    ended = subprocess.run(
        [sys.executable, "-S", "-m", "roboscribe.pipelines.cli", *words, *few],
        cwd=away,
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""
    assert (away / "data" / "programs" / "PointPickPlace1-scripted-seed0" / "program.txt").is_file()
    assert (away / "mlruns" / "mlflow.db").is_file()
    assert {path for path in site.rglob("*") if "__pycache__" not in path.parts} == before
