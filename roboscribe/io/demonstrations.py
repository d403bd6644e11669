"""Demonstrations in one Parquet file: a row per frame, a column per attribute.

Columns are `episode_index`, `frame_index`, `timestamp` (s), one per attribute (`mu.position`, `b1.position`,
`g(b1).position`; a number or a list of numbers, its unit in the field's metadata), `action` (null at an episode's last
frame and in episodes without actions) and, where stored, `snapshot`. A goal that was not given is null. Each episode
is a row group of its own, so that damage can be told by episode. Any Parquet reader opens the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike

from roboscribe.errors import DemonstrationError
from roboscribe.io.arrays import States, digest_of, trajectories_of
from roboscribe.io.atomic import sha256_of_bytes, write_file
from roboscribe.io.frames import decode, encode, index_of
from roboscribe.io.schema import check_columns, check_metadata, describe, lengths_of, metadata_of, schema_of
from roboscribe.io.seal import Seal, examine, sealed
from roboscribe.io.validation import check_trajectory
from roboscribe.world import Layout, Task, Trajectory

_UNREADABLE = (pa.ArrowException, OSError, UnicodeDecodeError)
"""What pyarrow raises on bytes that are no Parquet."""
_MOST_ROWS = 50_000_000


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
    def collected(cls, task: Task, episodes: int = 50, seed: int = 0) -> Demonstrations:
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
    """Write demonstrations to one Parquet file, atomically and sealed.

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
        check_trajectory(trajectory, episode=episode, source=str(path))
    lengths = [len(trajectory) for trajectory in trajectories]
    stored = any(trajectory.snapshots is not None for trajectory in trajectories)
    metadata = describe(task_name, layout, frequency, generator=generator, seed=seed, lengths=lengths, snapshots=stored)
    schema = schema_of(layout, metadata, snapshots=stored)
    data = sealed(_parquet(schema, [encode(t, i, frequency, schema) for i, t in enumerate(trajectories) if len(t)]))
    write_file(path, data)
    return sha256_of_bytes(data)


def read_demonstrations(path: Path, task: Task) -> Demonstrations:
    """Read every demonstration of a file, or none.

    Numbers, units and structure are checked here; which demonstrations are worth learning from is `screen`'s question.
    A file that another program rewrote has no seal; it is read, and the report says so.

    Args:
        path: a file of `write_demonstrations`, or one with the same columns and metadata.
        task: what the file must show.

    Raises:
        DemonstrationError: damage, another task or version, a missing or malformed column, a number that cannot be
            right; the message names the file and, where known, episode, frame and column.
    """
    if not path.is_file():
        msg = f"{path}: no such file, expected demonstrations in Parquet"
        raise DemonstrationError(msg)
    try:
        return _read(path.read_bytes(), str(path), task)
    except _UNREADABLE as error:
        msg = f"{path}: damaged, or not Parquet ({_first_line(error)}); nothing of it was used"
        raise DemonstrationError(msg) from error


def task_of(path: Path) -> str:
    """Read which task a file says it shows.

    Raises:
        DemonstrationError: damage, no file, or no task named.
    """
    if not path.is_file():
        msg = f"{path}: no such file, expected demonstrations in Parquet"
        raise DemonstrationError(msg)
    try:
        name = metadata_of(pq.ParquetFile(path).metadata.metadata).get("task")
    except _UNREADABLE as error:
        msg = f"{path}: damaged, or not Parquet ({_first_line(error)}); nothing of it was used"
        raise DemonstrationError(msg) from error
    if not isinstance(name, str):
        msg = f"{path}: names no task in its metadata; expected the entry task"
        raise DemonstrationError(msg)
    return name


def _read(data: bytes, source: str, task: Task) -> Demonstrations:
    """Read the bytes of a file."""
    seal = examine(data)
    if seal in (Seal.DAMAGED, Seal.BODY_DAMAGED):
        raise DemonstrationError(_damage(data, source, seal))
    file = _open(data)
    metadata = metadata_of(file.metadata.metadata)
    check_metadata(metadata, task, source)
    unknown = check_columns(file.schema_arrow, task.layout, metadata, source)
    if file.metadata.num_rows > _MOST_ROWS:
        msg = f"{source}: found {file.metadata.num_rows} rows, expected at most {_MOST_ROWS}"
        raise DemonstrationError(msg)
    table = file.read()
    declared = len(lengths_of(metadata)) if seal is Seal.INTACT else 0
    index = index_of(table, task.frequency, source, declared=declared)
    trajectories = decode(table, task.layout, task.action_size, index)
    for episode, trajectory in enumerate(trajectories):
        check_trajectory(trajectory, episode=episode, source=source, action_size=task.action_size)
    return Demonstrations(trajectories, sha256_of_bytes(data), _remarks(seal, unknown, source))


def _parquet(schema: pa.Schema, tables: Sequence[pa.Table]) -> bytes:
    """Write tables as Parquet with page checksums, one row group each."""
    buffer = BytesIO()
    options = {"compression": "zstd", "use_dictionary": False, "write_statistics": False}
    with pq.ParquetWriter(buffer, schema, write_page_checksum=True, **options) as writer:
        for table in tables:
            writer.write_table(table, row_group_size=len(table))
    return buffer.getvalue()


def _open(data: bytes) -> pq.ParquetFile:
    """Open Parquet bytes; every page that is read is checked."""
    return pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)


def _damage(data: bytes, source: str, seal: Seal) -> str:
    """Say what is known about damage: the episodes, when the footer can be trusted to lead to them."""
    episodes = _damaged_episodes(data) if seal is Seal.BODY_DAMAGED else []
    where = f" in episode {', '.join(map(str, episodes))}" if episodes else ""
    return f"{source}: damaged{where} since it was written; nothing of it was used, restore or collect it again"


def _damaged_episodes(data: bytes) -> list[int]:
    """List the episodes whose pages fail their checksums."""
    file = _open(data)
    filled = [episode for episode, length in enumerate(lengths_of(metadata_of(file.metadata.metadata))) if length]
    return [episode for group, episode in enumerate(filled) if not _readable(file, group)]


def _readable(file: pq.ParquetFile, group: int) -> bool:
    """Whether a row group can be read."""
    try:
        file.read_row_group(group)
    except _UNREADABLE:
        return False
    return True


def _remarks(seal: Seal, unknown: Sequence[str], source: str) -> tuple[str, ...]:
    """Say what is odd about a file that could be read."""
    unsealed = f"{source}: not sealed, another program wrote it; only page checksums guard it"
    ignored = f"{source}: unknown column {', '.join(unknown)} ignored"
    return tuple(line for line, odd in ((unsealed, seal is Seal.ABSENT), (ignored, unknown)) if odd)


def _first_line(error: BaseException) -> str:
    """Return the first line of an exception's text."""
    return (str(error).splitlines() or [type(error).__name__])[0]
