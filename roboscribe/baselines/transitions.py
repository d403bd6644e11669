"""Transitions and hindsight: goals replaced by what was reached later, by the layout alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.random import Generator

from roboscribe.errors import DemonstrationError
from roboscribe.world import Task, Trajectory
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.rows import Rows


@dataclass(frozen=True)
class Relabeller:
    """Replaces goals in states of one layout."""

    layout: Layout

    @cached_property
    def columns(self) -> tuple[IntArray, IntArray]:
        """Columns of goals, and of the attributes for which they are the goals."""
        goals: list[int] = []
        attributes: list[int] = []
        for (entity, name, goal), place in self.layout.columns.items():
            own = self.layout.columns.get((entity, name, False))
            if goal and own is not None and own.stop - own.start == place.stop - place.start:
                goals += range(place.start, place.stop)
                attributes += range(own.start, own.stop)
        return np.array(goals, np.int64), np.array(attributes, np.int64)

    def __call__(self, states: FloatArray, reached: FloatArray) -> FloatArray:
        """Return states (R, F) with the goals that entities have attained in `reached` (R, F)."""
        goals, attributes = self.columns
        relabelled = states.copy()
        relabelled[:, goals] = reached[:, attributes]
        return relabelled


@dataclass(frozen=True)
class Batch(Rows):
    """R transitions to learn from.

    Args:
        states: (R, F).
        actions: (R, A); NaN where they are unknown.
        following: (R, F) the states after.
        solved: (R,) the task is solved in them.
        lost: (R,) physics broke there.
    """

    states: FloatArray
    actions: FloatArray
    following: FloatArray
    solved: BoolArray
    lost: BoolArray

    @property
    def ended(self) -> BoolArray:
        """Where nothing follows: success ends an episode and cuts bootstrapping."""
        return self.solved | self.lost

    def relabelled(self, rows: BoolArray, reached: FloatArray, task: Task) -> Batch:
        """Replace the goals of `rows` (R,) by what `reached` (rows, F) shows; the task judges anew.

        Where the new goals are attained before the transition already, the old ones stay: episodes end with success,
        so that there is nothing to learn from what comes after it, and until something is moved nothing else is drawn.
        """
        relabel = Relabeller(task.layout)
        states = relabel(self.states[rows], reached)
        going = ~judged(task, states)
        where = np.flatnonzero(rows)[going]
        following = relabel(self.following[where], reached[going])
        found = self.take(np.arange(len(self)))
        found.states[where], found.following[where] = states[going], following
        found.solved[where] = judged(task, following)
        return found


def judged(task: Task, states: FloatArray) -> BoolArray:
    """Judge states (R, F), of which there may be none: tasks need not expect that."""
    return task.solved(states) if len(states) else np.zeros(0, np.bool_)


def later(rng: Generator, now: IntArray, last: IntArray) -> IntArray:
    """Draw for each index `now` one of itself and those after it up to `last`, evenly."""
    drawn: IntArray = now + (rng.random(len(now)) * (last - now + 1)).astype(np.int64)
    return drawn


@dataclass(frozen=True)
class Shown:
    """Demonstrated transitions, demonstration after demonstration, each cut at its first success.

    Args:
        batch: all of them.
        last: (M,) index of the last transition of the same demonstration.
    """

    batch: Batch
    last: IntArray

    def draw(self, rng: Generator, count: int, relabelled: float, task: Task) -> Batch:
        """Draw transitions, the goals of a share of them replaced in hindsight."""
        rows = rng.integers(len(self.last), size=count)
        drawn = self.batch.take(rows)
        chosen = rng.random(count) < relabelled
        future = later(rng, rows[chosen], self.last[rows[chosen]])
        return drawn.relabelled(chosen, self.batch.following[future], task)


def cut(trajectory: Trajectory, task: Task) -> Trajectory:
    """Return a demonstration up to the first state in which the task is solved; all of it where that never is."""
    solved = task.solved(trajectory.states)
    length = int(solved.argmax()) if solved.any() else len(trajectory) - 1
    actions = None if trajectory.actions is None else trajectory.actions[:length]
    return replace(trajectory, states=trajectory.states[: length + 1], actions=actions, snapshots=None)


def shown_transitions(trajectories: Sequence[Trajectory], task: Task) -> Shown:
    """Gather what demonstrations show.

    Raises:
        DemonstrationError: no demonstration has a step before its first success.
    """
    parts = [part for part in (cut(trajectory, task) for trajectory in trajectories) if len(part) > 1]
    if not parts:
        msg = f"demonstrations of {task.name}: found no step before the first success, expected some"
        raise DemonstrationError(msg)
    lengths = np.array([len(part) - 1 for part in parts])
    following = np.concatenate([part.states[1:] for part in parts])
    batch = Batch(
        states=np.concatenate([part.states[:-1] for part in parts]),
        actions=np.concatenate([_actions(part, task.action_size) for part in parts]),
        following=following,
        solved=task.solved(following),
        lost=np.zeros(len(following), np.bool_),
    )
    return Shown(batch, np.repeat(np.cumsum(lengths) - 1, lengths))


def _actions(trajectory: Trajectory, size: int) -> FloatArray:
    """Return the actions (T, A) of a demonstration; NaN where it has none."""
    return np.full((len(trajectory) - 1, size), np.nan) if trajectory.actions is None else trajectory.actions


def check_actions(trajectories: Sequence[Trajectory], method: str) -> None:
    """Refuse demonstrations without actions.

    Raises:
        DemonstrationError: one of them has none.
    """
    for rank, trajectory in enumerate(trajectories):
        if trajectory.actions is None or not np.isfinite(trajectory.actions).all():
            msg = f"{method} learns from actions: demonstration {rank} has none, expected them in all"
            raise DemonstrationError(msg)
