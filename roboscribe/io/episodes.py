"""A demonstration file one episode at a time, so that a large one never has to lie in memory as a whole."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import parse_json, replacing
from roboscribe.io.checksum import Checksum, Content, add_checksum, verify_checksum
from roboscribe.io.frames import IN_ORDER, Index, decode, encode, index_of, whole_numbers
from roboscribe.io.schema import EPISODE, FRAME, check_columns, check_metadata, describe, lengths_of, metadata_of
from roboscribe.io.schema import schema_of as columns_with
from roboscribe.io.validation import check_trajectory
from roboscribe.world import Layout, Task, Trajectory

LONGEST_REASON = 200
"""Characters of a library's reason that are told."""
UNREADABLE = (pa.ArrowException, OSError, UnicodeDecodeError)
"""What pyarrow raises on bytes that are no Parquet."""
_MOST_ROWS = 50_000_000


@dataclass(frozen=True)
class Header:
    """What a demonstration file says about itself before its first frame.

    Args:
        task_name: task that is shown.
        layout: layout that all trajectories have.
        frequency: frames per second.
        generator: what made them.
        seed: the generator's seed; None where it has none.
        lengths: count of frames by episode.
        snapshots: whether simulator states are stored.
    """

    task_name: str
    layout: Layout
    frequency: float
    generator: str
    seed: int | None
    lengths: tuple[int, ...]
    snapshots: bool


@dataclass(frozen=True)
class EpisodeFile:
    """An open demonstration file whose checksum, metadata and columns have been found good.

    Args:
        header: what it says about itself; lengths are empty where a file without a checksum states none.
        remarks: what is odd about it but no error.
    """

    header: Header
    remarks: tuple[str, ...]
    _file: pq.ParquetFile
    _task: Task
    _source: str

    def trajectories(self) -> Iterator[tuple[int, Trajectory]]:
        """Read the episodes that have frames, with their numbers; each is checked before it is given.

        Raises:
            DemonstrationError: damage, a malformed column, a number that cannot be right.
        """
        width: int | None = None
        try:
            for number, table in tables_by_episode(groups_of(self._file), EPISODE.name, self._source):
                index = index_of(table, self._task.frequency, self._source)
                alone = Index(index.source, index.episode, index.frame, index.slices[-1:])
                (trajectory,) = decode(table, self.header.layout, self._task.action_size, alone)
                action_size = self._task.action_size
                check_trajectory(trajectory, episode=number, source=self._source, action_size=action_size)
                width = _same_width(trajectory, width, number, self._source)
                yield number, trajectory
        except UNREADABLE as error:
            raise damaged(self._source, error) from error


def write_episodes(path: Path, header: Header, trajectories: Iterable[tuple[int, Trajectory]]) -> str:
    """Write one demonstration file, atomically and with a checksum, from episodes that come one by one.

    Args:
        path: target; its directory must exist.
        header: what the file says about itself.
        trajectories: episodes with their numbers, ascending; those without frames leave no row.

    Returns:
        SHA-256 of the file, hexadecimal.

    Raises:
        DemonstrationError: numbers that cannot be right, or lengths other than the header's.
        ArtifactError: the system refused the write.
    """
    schema = _schema(header)
    options = {"compression": "zstd", "use_dictionary": False, "write_statistics": False}
    lengths = [0] * len(header.lengths)
    with replacing(path) as hidden:
        with pq.ParquetWriter(hidden, schema, write_page_checksum=True, **options) as writer:
            for number, trajectory in trajectories:
                check_trajectory(trajectory, episode=number, source=str(path))
                lengths[number] = len(trajectory)
                if len(trajectory):
                    table = encode(trajectory, number, header.frequency, schema)
                    writer.write_table(table, row_group_size=len(table))
        if tuple(lengths) != header.lengths:
            msg = f"{path}: found episodes of {lengths} frames, expected {list(header.lengths)}"
            raise DemonstrationError(msg)
        return add_checksum(hidden)


@contextmanager
def open_episodes(path: Path, task: Task) -> Iterator[EpisodeFile]:
    """Open a demonstration file; its frames are read when they are asked for.

    Raises:
        DemonstrationError: there is no such file, or it is damaged, of another task or version, or lacks a column.
    """
    source = str(path)
    with open_parquet(path) as (content, file, checksum):
        if checksum is Checksum.BODY_DAMAGED:
            raise DemonstrationError(damage_of(file, source))
        metadata = metadata_of(file.metadata.metadata)
        check_metadata(metadata, task, source)
        unknown = check_columns(file.schema_arrow, task.layout, metadata, source)
        if file.metadata.num_rows > _MOST_ROWS:
            msg = f"{source}: found {file.metadata.num_rows} rows, expected at most {_MOST_ROWS}"
            raise DemonstrationError(msg)
        stored = metadata.get("snapshots") == "true"
        lengths = tuple(lengths_of(metadata)) if checksum is Checksum.INTACT else ()
        generator, seed = metadata.get("generator", "unknown"), _seed(metadata.get("seed"))
        header = Header(task.name, task.layout, task.frequency, generator, seed, lengths, stored)
        yield EpisodeFile(header, _remarks(checksum, unknown, source), file, task, source)
        del content


@contextmanager
def open_parquet(path: Path) -> Iterator[tuple[Content, pq.ParquetFile, Checksum]]:
    """Map a Parquet file into memory and verify its checksum; every page that is read is checked.

    Raises:
        DemonstrationError: there is no such file, it is no Parquet, or its footer is damaged.
    """
    if not path.is_file():
        msg = f"{path}: no such file, expected demonstrations in Parquet"
        raise DemonstrationError(msg)
    try:
        content = _mapped(path)
        checksum = verify_checksum(content)
        if checksum is Checksum.DAMAGED:
            raise DemonstrationError(_beyond_repair(str(path)))
        file = pq.ParquetFile(pa.BufferReader(pa.py_buffer(content)), page_checksum_verification=True)
    except UNREADABLE as error:
        raise damaged(str(path), error) from error
    yield content, file, checksum


def groups_of(file: pq.ParquetFile, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
    """Read one row group after the other.

    Whole groups, because a reader that goes by counts of rows takes a damaged page for the end of its column.
    """
    for group in range(file.num_row_groups):
        yield file.read_row_group(group, columns=columns)


def tables_by_episode(tables: Iterable[pa.Table], key: str, source: str) -> Iterator[tuple[int, pa.Table]]:
    """Cut a stream of rows into episodes.

    Args:
        tables: rows in the order of the file.
        key: column of episode numbers, which ascend; the rows of an episode lie together.
        source: file, for messages.

    Returns:
        Each episode's number and rows; numbers may be left out.

    Raises:
        DemonstrationError: the numbers are none, or do not ascend.
    """
    held: list[pa.Table] = []
    present, row = -1, 0
    for table in tables:
        numbers = whole_numbers(table, key, source)
        starts = [0, *(i + 1 for i in (numbers[1:] != numbers[:-1]).nonzero()[0].tolist())] if len(numbers) else []
        for start, stop in zip(starts, [*starts[1:], len(numbers)], strict=True):
            number = int(numbers[start])
            if number < present or number < 0:
                _out_of_order(table.slice(start, 1), number, row + start, key, source)
            if held and number != present:
                yield present, pa.concat_tables(held)
                held = []
            held.append(table.slice(start, stop - start))
            present = number
        row += len(table)
    if held:
        yield present, pa.concat_tables(held)


def damaged(source: str, error: BaseException, otherwise: str = "not Parquet") -> DemonstrationError:
    """Say that a file cannot be read: it is damaged, or `otherwise`."""
    reason = (str(error).splitlines() or [type(error).__name__])[0][:LONGEST_REASON]
    return DemonstrationError(f"{source}: damaged, or {otherwise} ({reason}); nothing of it was used")


def _schema(header: Header) -> pa.Schema:
    """Return the columns and metadata that a header asks for."""
    metadata = describe(
        header.task_name, header.layout, header.frequency,
        generator=header.generator, seed=header.seed, lengths=list(header.lengths), snapshots=header.snapshots,
    )  # fmt: skip
    return columns_with(header.layout, metadata, snapshots=header.snapshots)


def _mapped(path: Path) -> Content:
    """Map a file into memory; an empty one cannot be mapped."""
    with path.open("rb") as file:
        return mmap(file.fileno(), 0, access=ACCESS_READ) if path.stat().st_size else b""


def _out_of_order(row: pa.Table, number: int, place: int, key: str, source: str) -> None:
    """Refuse a row whose episode number does not ascend."""
    frame = f", frame {row.column(FRAME.name)[0]}" if FRAME.name in row.column_names else ""
    msg = f"{source}: episode {number}{frame}, column {key}: out of order in row {place}, expected {IN_ORDER}"
    raise DemonstrationError(msg)


def _same_width(trajectory: Trajectory, width: int | None, number: int, source: str) -> int | None:
    """Refuse snapshots of another width than earlier episodes have; returns the width, None where none is known yet."""
    if trajectory.snapshots is None:
        return width
    found = trajectory.snapshots.shape[1]
    if width not in (None, found):
        msg = f"{source}: episode {number}, frame 0, column snapshot: found a list of {found}, expected {width} numbers"
        raise DemonstrationError(msg)
    return found


def _seed(text: str | None) -> int | None:
    """Read the seed that a file states."""
    try:
        value = parse_json(text or "null")
    except ValueError:
        return None
    return value if isinstance(value, int) else None


def _beyond_repair(source: str, where: str = "") -> str:
    """Say that a file with a checksum has changed."""
    return f"{source}: damaged{where} since it was written; nothing of it was used, restore or collect it again"


def damage_of(file: pq.ParquetFile, source: str) -> str:
    """Say in which episodes the pages fail their checksums, where the footer can be trusted to lead to them."""
    filled = [episode for episode, length in enumerate(lengths_of(metadata_of(file.metadata.metadata))) if length]
    episodes = [episode for group, episode in enumerate(filled) if not _readable(file, group)]
    return _beyond_repair(source, f" in episode {', '.join(map(str, episodes))}" if episodes else "")


def _readable(file: pq.ParquetFile, group: int) -> bool:
    """Whether a row group can be read."""
    try:
        file.read_row_group(group)
    except UNREADABLE:
        return False
    return True


def _remarks(checksum: Checksum, unknown: Sequence[str], source: str) -> tuple[str, ...]:
    """Say what is odd about a file that could be read."""
    unguarded = f"{source}: has no checksum, another program wrote it; only page checksums guard it"
    ignored = f"{source}: unknown column {', '.join(unknown)} ignored"
    return tuple(line for line, odd in ((unguarded, checksum is Checksum.ABSENT), (ignored, unknown)) if odd)
