"""Tasks that are not ours: in a file, or in a package of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from roboscribe.envs.catalogue import make_task
from roboscribe.errors import TaskError

ROOT = Path(__file__).resolve().parent.parent.parent
SWITCH = '''
from dataclasses import dataclass

import numpy as np

from roboscribe.world.layout import Attribute, Layout, ObjectType
from roboscribe.world.task import Task


class Line:
    """A hand on a line that pushes a button along."""

    def __init__(self, batch):
        self.batch, self.control_steps, self.states = batch, 0, np.zeros((batch, 3))

    def reset(self, rows, seeds):
        starts = [np.random.default_rng(int(seed)).uniform((0.0, 0.3, 0.7), (0.2, 0.5, 1.0)) for seed in seeds]
        self.states[rows] = starts
        return self.observe(rows)

    def step(self, rows, actions):
        self.control_steps += len(rows)
        self.states[rows, 0] += 0.05 * np.clip(actions[:, 0], -1, 1)
        self.states[rows, 1] = np.maximum(self.states[rows, 0], self.states[rows, 1])
        return self.observe(rows)

    def observe(self, rows):
        return self.states[rows].copy()

    def diverged(self, rows):
        return np.zeros(len(rows), dtype=bool)

    def save(self, rows):
        return self.observe(rows)

    def load(self, rows, snapshots):
        self.states[rows] = snapshots
        return self.observe(rows)


@dataclass(frozen=True)
class Slide(Task):
    name: str = "slide"
    action_size: int = 1
    horizon: int = 60
    frequency: float = 10.0

    @property
    def layout(self):
        place = (Attribute("position", ("x",), "m"),)
        return Layout(ObjectType("EE", place), (ObjectType("button", place, place),))

    def solved(self, states):
        return np.abs(states[..., 1] - states[..., 2]) < 0.03

    def world(self, batch):
        return Line(batch)
'''


@pytest.fixture
def task_file(tmp_path: Path) -> Path:
    path = tmp_path / "slide task.py"
    path.write_text(SWITCH, encoding="utf-8")
    return path


def test_a_task_in_a_file_needs_no_package(task_file: Path) -> None:
    task = make_task(f"{task_file}:Slide")
    assert (task.name, task.layout.names) == ("slide", ("b1",))
    assert task.painter(10, 10) is None


def test_a_changed_file_is_read_again(task_file: Path) -> None:
    assert make_task(f"{task_file}:Slide").horizon == 60
    task_file.write_text(SWITCH.replace("horizon: int = 60", "horizon: int = 90"), encoding="utf-8")
    assert make_task(f"{task_file}:Slide").horizon == 90


def test_a_task_without_a_demonstrator_says_so(task_file: Path) -> None:
    with pytest.raises(TaskError, match=r"task slide brings no demonstrator: give demonstrations in a file"):
        make_task(f"{task_file}:Slide").demonstrate(1, 0)


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (None, "Slide", "does not exist"),
        ("1 +", "Slide", "cannot be run .SyntaxError"),
        (SWITCH, "Push", "found None in .*, expected a roboscribe Task"),
        (SWITCH, "Line", "expected a roboscribe Task"),
    ],
)
def test_a_file_that_is_no_task_is_refused(tmp_path: Path, text: str | None, name: str, message: str) -> None:
    path = tmp_path / "task.py"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(TaskError, match=message):
        make_task(f"{path}:{name}")


def test_a_package_brings_tasks_by_its_entry_points(tmp_path: Path) -> None:
    (tmp_path / "slides.py").write_text(SWITCH, encoding="utf-8")
    metadata = tmp_path / "slides-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: slides\nVersion: 1.0\n", encoding="utf-8")
    (metadata / "entry_points.txt").write_text("[roboscribe.tasks]\nslide = slides:Slide\n", encoding="utf-8")
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
