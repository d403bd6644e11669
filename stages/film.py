"""Film episodes of a program: the scene beside the program at work, or several episodes at once."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.observer import Arrivals, Observer
from roboscribe.dsl.replay import replay
from roboscribe.envs.panel import RecordedEpisode
from roboscribe.envs.render import SIZE, SLOW, film_episode, film_grid, steps_per_picture, write_video
from roboscribe.evaluation import PURPOSE, episode_seeds
from roboscribe.runnable import Runnable
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.controller_files import read_runnable
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.subtask_tree import ROOT
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import Task

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
    confirm: int = CONFIRM


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
    kept = _Snapshots(len(seeds))
    library, limits, confirm = program.library, program.limits, program.confirm
    drawn = np.asarray(seeds, dtype=np.int64)
    rollouts = execute(
        program.program,
        library,
        task,
        drawn,
        limits=limits,
        batch=1,
        until_end=goal != ROOT,
        confirm=confirm,
        observer=kept,
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
            episodes, rollouts.trajectories, kept.by_episode, rollouts.success, strict=True
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
    every = how.every * (steps_per_picture(task.frequency) if out.suffix.lower() == ".gif" else 1)
    shown = [take.thinned(every) for take in shown]
    one = how.columns == how.rows == 1
    frames = (
        film_episode(task, program.program, shown[0], how.size)
        if one
        else film_grid(task, shown, how.columns, how.size)
    )
    return write_video(frames, out, task.frequency / every * (SLOW if how.slow else 1.0))


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `rollout.mp4`, or `rollout.gif` where no encoder is found.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    program = read_runnable(inputs, task, config.confirm)
    shown = record_episodes(program, task, [0], episode_seeds(config.seed, PURPOSE, 1))
    every = steps_per_picture(task.frequency)  # drawing takes longer than simulating
    film(program, task, shown, out / VIDEO, FilmOptions(every=every))


class _Snapshots(Observer):
    """Keeps the simulator's state at every state of every episode."""

    def __init__(self, episodes: int) -> None:
        self.by_episode: list[list[FloatArray]] = [[] for _ in range(episodes)]

    def see(self, arrivals: Arrivals) -> BoolArray:
        for episode, snapshot in zip(arrivals.episodes, arrivals.world.save(arrivals.rows), strict=True):
            self.by_episode[episode].append(snapshot)
        return super().see(arrivals)


STAGE = Stage("film", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
