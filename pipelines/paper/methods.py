"""The methods that are compared, and how long each of them learns."""

from __future__ import annotations

from typing import get_args

from roboscribe.baselines.config import METHODS
from roboscribe.errors import TaskError
from roboscribe.pipelines.paper.experiment import QUICK_STEPS, Options
from roboscribe.rl.config import Profile
from roboscribe.stages.paper.rows import OURS
from roboscribe.stages.paper.values import REPORTED

CLONES = ("bc", "chunked-bc")
"""Baselines whose budget is gradient steps."""
QUICK_UPDATES = 5_000
"""Gradient steps of a clone in a quick run."""
MOST_QUICK = (OURS, "bc")
"""Methods of a quick run; learners with rollouts take minutes each, `--method` adds them."""


def every_method() -> tuple[str, ...]:
    """List programs and all baselines."""
    return (OURS, *METHODS)


def check_method(name: str) -> str:
    """Return a method's name.

    Raises:
        TaskError: there is no such method.
    """
    if name not in every_method():
        msg = f"unknown method {name!r}: expected one of {', '.join(every_method())}"
        raise TaskError(msg)
    return name


def budget_of(method: str, task: str, options: Options) -> int | None:
    """Return how long a method learns on a task; None is what is usual.

    A number of steps means control steps: of each skill of a program, of the whole training of a baseline. Clones,
    which take none, learn for their usual gradient steps. `paper` is where the axis of Fig. 19 ends.
    """
    if options.quick and options.budget == "default":
        return QUICK_UPDATES if method in CLONES else QUICK_STEPS
    if method in CLONES or options.budget == "default":
        return None
    if options.budget == "paper":
        return REPORTED[task].axis if method != OURS and task in REPORTED else None
    return int(options.budget)


PROFILES: tuple[Profile, ...] = get_args(Profile)


def check_profile(name: str) -> str:
    """Return a profile's name.

    Raises:
        TaskError: there is no such profile.
    """
    if name not in PROFILES:
        msg = f"unknown profile {name!r}: expected one of {', '.join(PROFILES)}"
        raise TaskError(msg)
    return name
