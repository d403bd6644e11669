"""Every task by name. A task's simulator is imported only when the task is made."""

from __future__ import annotations

from roboscribe.errors import TaskError
from roboscribe.world.protocols import Task

CONTACTS = ("stable", "paper")
TIMINGS = ("faithful", "fast")
GYM = "gym:FetchPickAndPlace-v4"


def task_names() -> tuple[str, ...]:
    """List the names that `make_task` knows."""
    return ("pick-place-1", GYM)


def make_task(name: str, *, contact: str = "stable", timing: str = "fast") -> Task:
    """Build a task.

    Args:
        name: one of `task_names()`.
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
    if name == "pick-place-1":
        from roboscribe.envs.pick_place import PickPlace

        return PickPlace(name, 1, contact, timing)
    if name == GYM:
        from roboscribe.envs.gym_adapter import GymFetch

        return GymFetch(name)
    msg = f"unknown task {name!r}: expected one of {', '.join(task_names())}"
    raise TaskError(msg)
