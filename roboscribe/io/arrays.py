"""Demonstrations that are arrays already."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from roboscribe.errors import DemonstrationError
from roboscribe.io.validation import check_trajectory
from roboscribe.world import Layout, Task, Trajectory
from roboscribe.world.layout import FloatArray
from roboscribe.world.states import state_of

SOURCE = "arrays"
"""How messages name demonstrations that are no file."""
States = ArrayLike | Mapping[str, ArrayLike]
"""(T + 1, F), or the columns of a state by name, (T + 1, w)."""


def trajectories_of(
    task: Task, states: Sequence[States], actions: Sequence[ArrayLike] | None = None
) -> tuple[Trajectory, ...]:
    """Check arrays and put them together.

    Args:
        task: what they show.
        states: one entry per demonstration.
        actions: the same, (T, A) in [-1, 1]; None where there are none.

    Raises:
        DemonstrationError: a shape or number that cannot be right; the message names the episode.
    """
    if actions is not None and len(actions) != len(states):
        msg = f"{SOURCE}: found actions of {len(actions)} episodes, expected {len(states)} as of the states"
        raise DemonstrationError(msg)
    given = [None] * len(states) if actions is None else actions
    found = []
    for episode, (shown, done) in enumerate(zip(states, given, strict=True)):
        numbers = None if done is None else np.asarray(done, dtype=np.float64)
        trajectory = Trajectory(task.layout, _states(task.layout, shown, episode), numbers)
        check_trajectory(trajectory, episode=episode, source=SOURCE, action_size=task.action_size)
        found.append(trajectory)
    return tuple(found)


def digest_of(trajectories: Iterable[Trajectory]) -> str:
    """Return the SHA-256 of what demonstrations show, hexadecimal."""
    digest = hashlib.sha256()
    for trajectory in trajectories:
        for part in (trajectory.states, trajectory.actions):
            digest.update(b"none" if part is None else repr(part.shape).encode() + part.tobytes())
    return digest.hexdigest()


def _states(layout: Layout, shown: States, episode: int) -> FloatArray:
    try:
        return state_of(layout, shown) if isinstance(shown, Mapping) else np.asarray(shown, dtype=np.float64)
    except (TypeError, ValueError) as error:
        msg = f"{SOURCE}: episode {episode}: {error}"
        raise DemonstrationError(msg) from error
