"""Every task by name. A task's simulator is imported only when the task is made."""

from __future__ import annotations

import re

from roboscribe.errors import TaskError
from roboscribe.world.protocols import Task

CONTACTS = ("stable", "paper")
TIMINGS = ("faithful", "fast")
GYM = "gym:FetchPickAndPlace-v4"
POINT = "point-"
"""How the names of tasks in the plane begin; they take no contact model and no timing."""


STEPS_PER_BLOCK = 50
"""Control steps that a task of several blocks allows for each."""
FAMILIES = re.compile(r"(pick-place|tower|multitower|pyramid)-([1-9][0-9]?)(-crowded)?")


def task_names() -> tuple[str, ...]:
    """List tasks that `make_task` knows; it takes any other number of blocks too, and `-crowded` behind them.

    In a crowded task blocks start as near to each other and to goals as in the paper, and some cannot be picked there.
    """
    from roboscribe.envs.point_world import POINT_TASKS

    return ("pick-place-1", "pick-place-4", "tower-5", "multitower-6", "pyramid-6", GYM, *POINT_TASKS)


def make_task(name: str, *, contact: str = "stable", timing: str = "fast") -> Task:
    """Build a task.

    Args:
        name: one of `task_names()`, or such a name with another number of blocks.
        contact: "stable" (elliptic cones, impratio 10) or "paper" (the scene file's defaults).
        timing: "faithful" (20 x 2 ms) or "fast" (10 x 4 ms); a control step is 40 ms under both.

    Raises:
        TaskError: an unknown name, contact model or timing. The gym environment has one of each and ignores both.
    """
    if contact not in CONTACTS:
        msg = f"unknown contact model {contact!r}: expected one of {', '.join(CONTACTS)}"
        raise TaskError(msg)
    if timing not in TIMINGS:
        msg = f"unknown timing {timing!r}: expected one of {', '.join(TIMINGS)}"
        raise TaskError(msg)
    if name == GYM:
        from roboscribe.envs.gym_adapter import GymFetch

        return GymFetch(name)
    if name.startswith(POINT):
        return _point_task(name)
    family = FAMILIES.fullmatch(name)
    if family is None:
        msg = f"unknown task {name!r}: expected one of {', '.join(task_names())}, or another number of blocks"
        raise TaskError(msg)
    shape, blocks, crowded = family[1], int(family[2]), family[3] is not None
    return _fetch_task(name, shape, blocks, crowded=crowded, contact=contact, timing=timing)


def _point_task(name: str) -> Task:
    """Look up a task of the plane."""
    from roboscribe.envs.point_world import POINT_TASKS

    if name not in POINT_TASKS:
        msg = f"unknown task {name!r}: expected one of {', '.join(POINT_TASKS)}"
        raise TaskError(msg)
    return POINT_TASKS[name]


def _fetch_task(name: str, shape: str, blocks: int, *, crowded: bool, contact: str, timing: str) -> Task:
    """Build a task of the Fetch family."""
    from roboscribe.envs.pick_place import PickPlace
    from roboscribe.envs.tower import Tower

    horizon = 100 if blocks == 1 else STEPS_PER_BLOCK * blocks
    if shape == "pick-place":
        return PickPlace(name, blocks, contact, timing, horizon, crowded=crowded)
    return Tower(name, blocks, contact, timing, horizon, crowded=crowded, shape=shape)
