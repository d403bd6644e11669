"""Film one episode of a program, with the line of the program that acts written into every frame."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.printer import text
from roboscribe.dsl.rewrite import controllers
from roboscribe.envs.render import render_rollout
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.task import Painter, Task, World
from stages import alone
from stages.files import read_json, read_program
from stages.grounded import Grounded
from stages.progress import Report, silent
from stages.skills import as_controllers, read_library
from stages.store import Inputs, Stage
from stages.world import TaskConfig, episode_seeds

VIDEO = "rollout.mp4"


@dataclass(frozen=True)
class Config:
    """Which episode.

    Args:
        task: where.
        seed: the first episode of this seed's evaluation is filmed.
        confirm: consecutive steps for which a subgoal must hold to count as reached.
    """

    task: TaskConfig
    seed: int = 0
    confirm: int = 3


def film(program: Grounded, task: Task, seed: int, out: Path) -> tuple[Path, bool]:
    """Write a video of one episode.

    Returns:
        The file written, a GIF where no encoder is found, and whether the task was solved in it.
    """
    recording = _Recording(task)
    seeds = episode_seeds(seed, "evaluate", 1)
    library = as_controllers(program.library)
    rollouts = execute(
        program.program, library, recording, seeds, limits=program.limits, batch=1, confirm=program.confirm
    )
    runs = [text(run) for run in controllers(program.program)]
    lines = [runs[line] if line >= 0 else "" for line in rollouts.lines[0]] or [""]
    states = rollouts.trajectories[0].states
    path = render_rollout(task, states, np.stack(recording.snapshots), lines, out)
    return path, bool(rollouts.success[0])


def run(config: Config, inputs: Inputs, out: Path, report: Report = silent) -> None:
    """Write `rollout.mp4`, or `rollout.gif` where no encoder is found.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    library = read_library(inputs["controllers"], inputs["weights"], task)
    program = Grounded(read_program(inputs["program"]), library, read_json(inputs["limits"]), config.confirm)
    film(program, task, config.seed, out / VIDEO)


class _Recording(Task):
    """A task whose only world keeps a snapshot of every state that it shows."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.name: str = task.name
        self.action_size: int = task.action_size
        self.horizon: int = task.horizon
        self.frequency: float = task.frequency
        self.snapshots: list[FloatArray] = []

    @property
    def layout(self) -> Layout:
        return self.task.layout

    def solved(self, states: FloatArray) -> BoolArray:
        return self.task.solved(states)

    def world(self, batch: int) -> World:
        return _RecordingWorld(self.task.world(batch), self.snapshots)

    def painter(self, width: int, height: int) -> Painter | None:
        return self.task.painter(width, height)


@dataclass
class _RecordingWorld:
    """A world of one row that notes a snapshot after every reset and step."""

    inner: World
    snapshots: list[FloatArray]

    def __post_init__(self) -> None:
        self.batch: int = self.inner.batch
        self.control_steps: int = 0

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        states = self.inner.reset(rows, seeds)
        self._note(rows)
        return states

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        states = self.inner.step(rows, actions)
        self.control_steps = self.inner.control_steps
        self._note(rows)
        return states

    def observe(self, rows: IntArray) -> FloatArray:
        return self.inner.observe(rows)

    def diverged(self, rows: IntArray) -> BoolArray:
        return self.inner.diverged(rows)

    def save(self, rows: IntArray) -> FloatArray:
        return self.inner.save(rows)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        return self.inner.load(rows, snapshots)

    def _note(self, rows: IntArray) -> None:
        self.snapshots.append(self.inner.save(rows)[0])


STAGE = Stage("film", Config, run)

if __name__ == "__main__":
    sys.exit(alone.main(STAGE))
