"""Demonstrations in one Parquet file: a row per frame, a column per attribute.

Columns are `episode_index`, `frame_index`, `timestamp` (s), one per attribute (`mu.position`, `b1.position`,
`g(b1).position`; a number or a list of numbers, its unit in the field's metadata), `action` (null at an episode's last
frame and in episodes without actions) and, where stored, `snapshot`. A goal that was not given is null. Each episode
is a row group of its own, so that damage can be told by episode. Any Parquet reader opens the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from roboscribe.defaults import N_DEMONSTRATIONS
from roboscribe.errors import DemonstrationError
from roboscribe.io.arrays import States, digest_of, trajectories_of
from roboscribe.io.atomic import sha256_of
from roboscribe.io.episodes import Header, open_episodes, open_parquet, write_episodes
from roboscribe.io.schema import metadata_of
from roboscribe.world import Layout, Task, Trajectory


@dataclass(frozen=True)
class Demonstrations:
    """Demonstrations of one task, out of a file or of arrays.

    Args:
        trajectories: by episode number; an episode without frames is a trajectory of length 0.
        digest: SHA-256 of the file, or of the arrays, hexadecimal.
        report: remarks that are no errors.
    """

    trajectories: tuple[Trajectory, ...]
    digest: str
    report: tuple[str, ...] = ()

    @classmethod
    def from_parquet(cls, path: str | Path, task: Task) -> Demonstrations:
        """Read a file, see `read_demonstrations`."""
        return read_demonstrations(Path(path), task)

    @classmethod
    def from_arrays(
        cls, task: Task, states: Sequence[States], actions: Sequence[ArrayLike] | None = None
    ) -> Demonstrations:
        """Take demonstrations that are arrays, see `trajectories_of`."""
        trajectories = trajectories_of(task, states, actions)
        return cls(trajectories, digest_of(trajectories))

    @classmethod
    def collected(cls, task: Task, episodes: int = N_DEMONSTRATIONS, seed: int = 0) -> Demonstrations:
        """Let the task's own demonstrator show what to do.

        Raises:
            TaskError: it brings none.
        """
        trajectories = tuple(task.demonstrate(episodes, seed))
        return cls(trajectories, digest_of(trajectories))

    def to_parquet(self, path: str | Path, task: Task, generator: str = "arrays") -> str:
        """Write a file that commands take, see `write_demonstrations`; returns its SHA-256."""
        path, frequency = Path(path), task.frequency
        return write_demonstrations(
            path, task.name, task.layout, frequency, self.trajectories, generator=generator, seed=None
        )

    def __len__(self) -> int:
        """Count the demonstrations."""
        return len(self.trajectories)


def write_demonstrations(
    path: Path,
    task_name: str,
    layout: Layout,
    frequency: float,
    trajectories: Sequence[Trajectory],
    *,
    generator: str,
    seed: int | None,
) -> str:
    """Write demonstrations to one Parquet file, atomically and with a checksum.

    Args:
        path: target; its directory must exist.
        task_name: task that is shown.
        layout: layout that all trajectories have.
        frequency: frames per second.
        trajectories: demonstrations; goals that are NaN throughout an episode are stored as not given.
        generator: what made them.
        seed: the generator's seed; None where it has none.

    Returns:
        SHA-256 of the file, hexadecimal, as `read_demonstrations` gives it.

    Raises:
        DemonstrationError: a trajectory of another layout, or with numbers that cannot be right.
        ArtifactError: the system refused the write.
    """
    for episode, trajectory in enumerate(trajectories):
        if trajectory.layout != layout:
            found, expected = ", ".join(trajectory.layout.names), ", ".join(layout.names)
            msg = f"{path}: episode {episode}: found the layout of {found}, expected that of {expected}"
            raise DemonstrationError(msg)
    lengths = tuple(len(trajectory) for trajectory in trajectories)
    stored = any(trajectory.snapshots is not None for trajectory in trajectories)
    header = Header(task_name, layout, frequency, generator, seed, lengths, stored)
    return write_episodes(path, header, enumerate(trajectories))


def read_demonstrations(path: Path, task: Task) -> Demonstrations:
    """Read every demonstration of a file, or none.

    Numbers, units and structure are checked here; which demonstrations are worth learning from is `screen`'s question.
    A file that another program rewrote has no checksum; it is read, and the report says so.

    Args:
        path: a file of `write_demonstrations`, or one with the same columns and metadata.
        task: what the file must show.

    Raises:
        DemonstrationError: damage, another task or version, a missing or malformed column, a number that cannot be
            right; the message names the file and, where known, episode, frame and column.
    """
    with open_episodes(path, task) as file:
        filled = dict(file.trajectories())
        count = max(len(file.header.lengths), max(filled, default=-1) + 1)
        empty = Trajectory(task.layout, np.empty((0, task.layout.size)))
        trajectories = tuple(filled.get(episode, empty) for episode in range(count))
        return Demonstrations(trajectories, sha256_of(path), file.remarks)


def task_of(path: Path) -> str:
    """Read which task a file says it shows.

    Raises:
        DemonstrationError: damage, no file, or no task named.
    """
    with open_parquet(path) as (_, file, _):
        name = metadata_of(file.metadata.metadata).get("task")
    if name is None:
        msg = f"{path}: names no task in its metadata (roboscribe.task); name it with --task"
        raise DemonstrationError(msg)
    return name
