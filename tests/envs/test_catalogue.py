"""Tasks that are not ours: in a file, or in a package of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from roboscribe.envs.catalogue import make_task
from roboscribe.errors import TaskError
from tests.envs.own_task import SOURCE, write_package

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture
def task_file(tmp_path: Path) -> Path:
    path = tmp_path / "slide task.py"
    path.write_text(SOURCE, encoding="utf-8")
    return path


def test_a_task_in_a_file_needs_no_package(task_file: Path) -> None:
    task = make_task(f"{task_file}:Slide")
    assert (task.name, task.layout.names) == ("slide", ("b1",))
    assert task.painter(10, 10) is None


def test_a_changed_file_is_read_again(task_file: Path) -> None:
    assert make_task(f"{task_file}:Slide").horizon == 60
    task_file.write_text(SOURCE.replace("horizon: int = 60", "horizon: int = 90"), encoding="utf-8")
    assert make_task(f"{task_file}:Slide").horizon == 90


def test_a_task_without_a_demonstrator_says_so(task_file: Path) -> None:
    with pytest.raises(TaskError, match=r"task slide brings no demonstrator: give demonstrations in a file"):
        make_task(f"{task_file}:Slide").demonstrate(1, 0)


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (None, "Slide", "does not exist"),
        ("1 +", "Slide", "cannot be run .SyntaxError"),
        (SOURCE, "Push", "found None in .*, expected a roboscribe Task"),
        (SOURCE, "Line", "expected a roboscribe Task"),
    ],
)
def test_a_file_that_is_no_task_is_refused(tmp_path: Path, text: str | None, name: str, message: str) -> None:
    path = tmp_path / "task.py"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(TaskError, match=message):
        make_task(f"{path}:{name}")


def test_a_package_brings_tasks_by_its_entry_points(tmp_path: Path) -> None:
    write_package(tmp_path)
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    code = (
        "from roboscribe.envs.catalogue import make_task, task_names; print(make_task('slide').horizon, task_names())"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, check=True, capture_output=True, text=True)
    assert done.stdout.startswith("60 ")
    assert "'slide'" in done.stdout


def test_a_near_miss_is_pointed_out() -> None:
    with pytest.raises(TaskError, match="unknown task 'pickplace-1': did you mean pick-place-1"):
        make_task("pickplace-1")


def test_a_missing_simulator_is_named_in_one_line() -> None:
    code = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from roboscribe.envs.catalogue import make_task\n"
        "print(make_task('point-tower-3').name)\n"
        "try: make_task('tower-5')\nexcept Exception as error: print(type(error).__name__, error)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    toy, said = done.stdout.splitlines()
    assert toy == "point-tower-3"
    assert said.startswith("TaskError unknown task 'tower-5'")
    assert said.endswith("; mujoco is not installed: pip install 'roboscribe[fetch]' brings more")
