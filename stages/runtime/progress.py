"""Progress messages of running stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias


@dataclass(frozen=True)
class Progress:
    """One message of a running stage.

    Args:
        what: what is being worked on, for instance "hold".
        done: how much of it is done.
        total: how much there is; the most there can be where it may end earlier.
        unit: what is counted.
        metrics: figures at this point, by name.
        time: when, milliseconds since 1970; the same each time a figure is told again.
    """

    what: str
    done: int
    total: int
    unit: str
    metrics: Mapping[str, float] = field(default_factory=dict)
    time: int = 0


ProgressCallback: TypeAlias = Callable[[Progress], None]


def ignore_progress(progress: Progress) -> None:
    """Ignore a message."""


def episode_progress(what: str, total: int, report: ProgressCallback) -> Callable[[int, int], None]:
    """Return a callback that turns an evaluation's counts into progress messages."""

    def watch(done: int, successes: int) -> None:
        metrics = {"success": successes / done} if done else {}
        report(Progress(what, done, total, "episodes", metrics))

    return watch
