"""Episodes of tables whose rows are frames, as Parquet and CSV files of other programs hold them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from roboscribe.errors import DemonstrationError
from roboscribe.io.episodes import tables_by_episode
from roboscribe.io.formats.foreign import Recording
from roboscribe.world.layout import FloatArray, IntArray

EPISODE = "episode_index"
FRAME = "frame_index"
TIME = "timestamp"
_DRIFT = 0.5
"""Part of a control period by which a timestamp may be off before a frame is missing."""


def recordings_of(
    tables: Iterable[pa.Table],
    columns: Sequence[str],
    *,
    episode: str | None,
    lengths: Sequence[int],
    frequency: float | None,
    source: str,
) -> Iterator[Recording]:
    """Cut tables into episodes and read the wanted columns, checking frame numbers and times where there are any.

    Args:
        tables: rows in the order of the file.
        columns: names of the wanted columns.
        episode: column of episode numbers; None where all rows are one episode.
        lengths: count of frames that each episode must have.
        frequency: frames per second, by which timestamps are checked; None leaves them alone.
        source: file, for messages.

    Raises:
        DemonstrationError: an episode of another length, a frame out of order or missing, a value that is no number.
    """
    pieces = enumerate([pa.concat_tables(tables)]) if episode is None else tables_by_episode(tables, episode, source)
    read = -1
    for read, (number, table) in enumerate(pieces):
        if read >= len(lengths) or len(table) != lengths[read]:
            expected = lengths[read] if read < len(lengths) else "no more episodes"
            complain(source, number, 0, episode or FRAME, f"found {len(table)} frames, expected {expected}")
        check_frames(table, number, frequency, source)
        yield {name: numbers_of(table, name, number, source) for name in columns}
    if read + 1 != len(lengths):
        msg = f"{source}: found {read + 1} episodes, expected {len(lengths)}"
        raise DemonstrationError(msg)


def lengths_in(tables: Iterable[pa.Table], episode: str, source: str) -> tuple[int, ...]:
    """Count the rows of each episode."""
    return tuple(len(table) for _, table in tables_by_episode(tables, episode, source))


def check_frames(table: pa.Table, number: int, frequency: float | None, source: str) -> None:
    """Refuse frames that are out of order or missing, as far as the file numbers and times them."""
    counted = np.arange(len(table), dtype=np.float64)
    if FRAME in table.column_names:
        check_order(numbers_of(table, FRAME, number, source)[:, 0], number, source)
    if TIME in table.column_names and frequency is not None:
        times = numbers_of(table, TIME, number, source)[:, 0]
        check_times(times, counted / frequency, frequency, number, source)


def check_order(frames: FloatArray, number: int, source: str) -> None:
    """Refuse frame numbers (n,) other than 0, 1, 2 and so on."""
    wrong = np.flatnonzero(frames != np.arange(len(frames)))
    if wrong.size:
        at = int(wrong[0])
        complain(source, number, at, FRAME, f"found {frames[at]:g}, expected {at}")


def check_times(times: FloatArray, expected: FloatArray, frequency: float, number: int, source: str) -> None:
    """Refuse times (n,) in seconds that do not belong to their frames."""
    elapsed = times - times[:1]
    wrong = np.flatnonzero(~(np.abs(elapsed - expected) <= _DRIFT / frequency))
    if wrong.size:
        at = int(wrong[0])
        what = f"found {elapsed[at]:g} s after the first frame, expected {expected[at]:g} s at {frequency:g} per second"
        complain(source, number, at, TIME, what)


def is_numeric(kind: pa.DataType) -> bool:
    """Whether a column's type is a number or a list of numbers, however deep."""
    while pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        kind = kind.value_type
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind))


def numbers_of(table: pa.Table, name: str, number: int, source: str) -> FloatArray:
    """Read a column of one episode as numbers (n, w); where there is no value, NaN."""
    column = table.column(name)
    if not is_numeric(column.type):
        complain(source, number, 0, name, f"found {column.type}, expected numbers or lists of numbers")
    array = pa.concat_arrays(column.chunks) if column.num_chunks else pa.array([], column.type)
    return _flat(array, name, number, source)


def _flat(array: pa.Array, name: str, number: int, source: str) -> FloatArray:
    """Flatten lists of equal lengths into rows of numbers."""
    kind = array.type
    if not (pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)):
        values = np.asarray(array.cast(pa.float64()).fill_null(np.nan), dtype=np.float64)
        return values[:, None]
    null = np.asarray(array.is_null())
    sizes: IntArray = np.asarray(pc.list_value_length(array).drop_null(), dtype=np.int64)
    odd = np.flatnonzero(sizes != sizes[:1].sum())
    if odd.size:
        frame = int(np.flatnonzero(~null)[odd[0]])
        complain(source, number, frame, name, f"found a list of {sizes[odd[0]]}, expected {sizes[0]} numbers")
    inner = _flat(array.drop_null().flatten(), name, number, source)
    width = inner.shape[1] * int(sizes[:1].sum())
    values = np.full((len(array), width), np.nan)
    values[~null] = inner.reshape(len(sizes), width)
    return values


def complain(source: str, number: int, frame: int, column: str, what: str) -> NoReturn:
    """Raise the error for one place of a file."""
    msg = f"{source}: episode {number}, frame {frame}, column {column}: {what}"
    raise DemonstrationError(msg)
