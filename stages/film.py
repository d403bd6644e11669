"""Film episodes of a program: the scene beside the program at work, or several episodes at once."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.replay import replay
from roboscribe.envs.panel import RecordedEpisode
from roboscribe.envs.render import GIF_RATE, SIZE, SLOW, film_episode, film_grid, write_video
from roboscribe.evaluation import PURPOSE, episode_seeds
from roboscribe.runnable import Runnable
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.controller_files import read_library
from roboscribe.stages.runtime.files import read_json, read_program
from roboscribe.stages.runtime.progress import Report, silent
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.subtask_tree import ROOT
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.task import Painter, Task, World

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


def record_episodes(
    program: Runnable, task: Task, episodes: Sequence[int], seeds: Sequence[int] | IntArray, goal: str = ROOT
) -> list[RecordedEpisode]:
    """Run episodes and keep what a film of them needs.

    Args:
        program: what runs.
        task: where.
        episodes: their numbers, for titles.
        seeds: (E,) one for each.
        goal: what the program is to reach.
    """
    recording = _Recording(task)
    library, limits, confirm = program.library, program.limits, program.confirm
    drawn = np.asarray(seeds, dtype=np.int64)
    rollouts = execute(
        program.program, library, recording, drawn, limits=limits, batch=1, until_end=goal != ROOT, confirm=confirm
    )
    return [
        RecordedEpisode(
            states=trajectory.states,
            snapshots=np.stack(snapshots),
            moments=replay(program.program, task.layout, trajectory.states, limits, confirm, task.solved),
            solved=bool(solved),
            title=f"episode {episode}",
        )
        for episode, trajectory, snapshots, solved in zip(
            episodes, rollouts.trajectories, recording.episodes, rollouts.success, strict=True
        )
    ]


@dataclass(frozen=True)
class FilmOptions:
    """How to film.

    Args:
        columns: episodes beside each other; 1 shows one episode beside its program.
        rows: episodes below each other.
        slow: whether it runs at a quarter of the world's speed.
        every: control steps between two pictures.
        size: width and height, pixels.
    """

    columns: int = 1
    rows: int = 1
    slow: bool = False
    every: int = 1
    size: tuple[int, int] = SIZE


def film(
    program: Runnable, task: Task, shown: Sequence[RecordedEpisode], out: Path, how: FilmOptions | None = None
) -> Path:
    """Write a video of one episode, or of several in a grid.

    Returns:
        The file written, a GIF where no encoder is found.
    """
    how = how or FilmOptions()
    every = how.every * (max(1, round(task.frequency / GIF_RATE)) if out.suffix.lower() == ".gif" else 1)
    shown = [take.thinned(every) for take in shown]
    one = how.columns == how.rows == 1
    frames = (
        film_episode(task, program.program, shown[0], how.size)
        if one
        else film_grid(task, shown, how.columns, how.size)
    )
    return write_video(frames, out, task.frequency / every * (SLOW if how.slow else 1.0))


def run(config: Config, inputs: Inputs, out: Path, report: Report = silent) -> None:
    """Write `rollout.mp4`, or `rollout.gif` where no encoder is found.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    library = read_library(inputs["controllers"], inputs["weights"], task)
    program = Runnable(read_program(inputs["program"]), library, read_json(inputs["limits"]), config.confirm)
    shown = record_episodes(program, task, [0], episode_seeds(config.seed, PURPOSE, 1))
    film(program, task, shown, out / VIDEO)


class _Recording(Task):
    """A task whose only world keeps a snapshot of every state that it shows."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.name: str = task.name
        self.action_size: int = task.action_size
        self.horizon: int = task.horizon
        self.frequency: float = task.frequency
        self.episodes: list[list[FloatArray]] = []
        """Snapshots of every episode, in the order in which they were run."""

    @property
    def layout(self) -> Layout:
        return self.task.layout

    def solved(self, states: FloatArray) -> BoolArray:
        return self.task.solved(states)

    def world(self, batch: int) -> World:
        return _RecordingWorld(self.task.world(batch), self.episodes)

    def painter(self, width: int, height: int) -> Painter | None:
        return self.task.painter(width, height)


@dataclass
class _RecordingWorld:
    """A world of one row that notes a snapshot after every reset and step."""

    inner: World
    episodes: list[list[FloatArray]]

    def __post_init__(self) -> None:
        self.batch: int = self.inner.batch
        self.control_steps: int = 0

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        states = self.inner.reset(rows, seeds)
        self.episodes.append([])
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
        self.episodes[-1].append(self.inner.save(rows)[0])


STAGE = Stage("film", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
