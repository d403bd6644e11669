"""How long episodes have to be for what demonstrations show: the task's own length, more where all are slow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

USUALLY = 0.95
"""Share of the demonstrations that have to fit into an episode where most do not fit into one of the task's own."""
LEEWAY = 1.25
"""Times the steps of those that an episode may take: a controller may hesitate where a person did not."""


def episode_length(task: Task, demonstrations: Sequence[Trajectory]) -> tuple[int, str]:
    """Return how many control steps an episode may take, and a line that says so where it is not the task's own count.

    Controllers learn from demonstrations how fast to be, so what takes most of these longer than an episode cannot be
    done in one.

    Args:
        task: whose episodes these are.
        demonstrations: successful ones.
    """
    steps = [int(task.solved(shown.states).argmax()) for shown in demonstrations]
    if np.median(steps) <= task.horizon:
        return task.horizon, ""
    usual = int(np.quantile(steps, USUALLY))
    wanted = int(LEEWAY * usual)
    return wanted, f"demonstrations take up to {usual} steps: an episode may take {wanted} instead of {task.horizon}"
