"""What all formats of other programs have in common: columns of numbers, one row per frame, episode by episode.

Reading a format means to list its columns (`Contents`) and to give the wanted ones as arrays. What the columns mean for
a task is no question of the format: a mapping says it. Writing a format means to spell trajectories as it wants them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np

from roboscribe.io.columns import Column, columns_of
from roboscribe.io.episodes import Header
from roboscribe.world import Task, Trajectory
from roboscribe.world.layout import FloatArray

ACTION = "action"
SNAPSHOT = "snapshot"
MOST_NUMBERS = 1 << 33
"""Numbers that one array of a file may claim to hold; more is damage."""

Recording: TypeAlias = Mapping[str, FloatArray]
"""One episode: columns by name, each (frames, width); actions may have a row less."""


@dataclass(frozen=True)
class Field:
    """One column of a file of another program.

    Args:
        name: what the file calls it.
        width: numbers per frame.
        components: what the file calls each number; empty where it does not say.
    """

    name: str
    width: int
    components: tuple[str, ...] = ()


@dataclass(frozen=True)
class Contents:
    """What a file holds.

    Args:
        fields: columns of numbers.
        lengths: count of frames by episode.
        frequency: frames per second; None where the file does not say.
    """

    fields: tuple[Field, ...]
    lengths: tuple[int, ...]
    frequency: float | None


class Source(Protocol):
    """An open file of another program."""

    @property
    def contents(self) -> Contents:
        """What the file holds."""

    def recordings(self, columns: Sequence[str]) -> Iterator[Recording]:
        """Read the named columns of every episode, in the order of `Contents.lengths`.

        Raises:
            DemonstrationError: damage, or an episode that is not as `contents` says.
        """


@dataclass(frozen=True)
class Shown:
    """Demonstrations to be written in another format.

    Args:
        task: what they show.
        header: what the file they come from says about itself; its lengths are those of `trajectories`.
        actions: whether any episode has actions.
        snapshot_size: numbers of a simulator state; 0 where no episode has any.
        trajectories: reads them, from the first one each time it is called.
    """

    task: Task
    header: Header
    actions: bool
    snapshot_size: int
    trajectories: Callable[[], Iterator[Trajectory]]

    @property
    def columns(self) -> tuple[Column, ...]:
        """The layout's columns."""
        return columns_of(self.header.layout)


@dataclass(frozen=True)
class Format:
    """A format that demonstrations come in and go out.

    Args:
        name: as the command line knows it.
        spelling: what a file of it is, for messages.
        directory: whether it is a directory of files.
        least_frames: frames that an episode must have to be held.
        open: opens a file; the second argument names the column of episode numbers, where the format leaves it open.
        write: writes demonstrations to a path that does not exist yet.
    """

    name: str
    spelling: str
    directory: bool
    least_frames: int
    open: Callable[[Path, str | None], AbstractContextManager[Source]]
    write: Callable[[Path, Shown], None]


def snapshots_of(trajectory: Trajectory, size: int) -> FloatArray:
    """Return an episode's snapshots (T + 1, S); NaN throughout where it has none."""
    return np.full((len(trajectory), size), np.nan) if trajectory.snapshots is None else trajectory.snapshots


def actions_of(trajectory: Trajectory, size: int) -> FloatArray:
    """Return an episode's actions (T, A); NaN throughout where it has none."""
    length = max(len(trajectory) - 1, 0)
    return np.full((length, size), np.nan) if trajectory.actions is None else trajectory.actions


def named_parts(trajectory: Trajectory) -> Iterator[tuple[Column, FloatArray]]:
    """Give each column of a trajectory with its values (T + 1, w)."""
    for column in columns_of(trajectory.layout):
        yield column, trajectory.states[:, column.place]


def component_names(column: Column) -> list[str]:
    """Name every number of a column: "b1.position.x"."""
    return [column.component(i) for i in range(column.attribute.width)]
