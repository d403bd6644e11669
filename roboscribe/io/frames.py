"""Rows of a demonstration table, to and from trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from roboscribe.errors import DemonstrationError
from roboscribe.io.columns import Column, columns_of, missing
from roboscribe.io.schema import ACTION, EPISODE, FRAME, SNAPSHOT, TIMESTAMP
from roboscribe.world import Layout, Trajectory
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

_LISTS = pa.large_list(pa.float64())
_MOST_EPISODES = 100_000
IN_ORDER = f"ascending numbers from 0 to {_MOST_EPISODES - 1}, each episode in one piece"
"""What the numbers of a file's episodes are to be."""
_DRIFT = 0.5
"""Part of a control period by which a timestamp may be off before it belongs to another frame."""


@dataclass(frozen=True)
class Index:
    """Which row of a table is which frame of which episode.

    Args:
        source: file, for messages.
        episode: episode number by row (n,).
        frame: frame number by row (n,).
        slices: rows by episode number; empty where an episode has none.
    """

    source: str
    episode: IntArray
    frame: IntArray
    slices: tuple[slice, ...]

    def complain(self, row: int, column: str, what: str) -> NoReturn:
        """Raise the error for one row of one column."""
        where = f"{self.source}: episode {self.episode[row]}, frame {self.frame[row]}, column {column}"
        msg = f"{where}: {what}"
        raise DemonstrationError(msg)


@dataclass(frozen=True)
class _Numbers:
    """A column as an array (n, w), NaN where it is null, and where it is null (n,)."""

    values: FloatArray
    null: BoolArray


def encode(trajectory: Trajectory, episode: int, frequency: float, schema: pa.Schema) -> pa.Table:
    """Write one episode as a table of T + 1 rows."""
    length, states = len(trajectory), trajectory.states
    frames = np.arange(length)
    arrays = [pa.array(np.full(length, episode)), pa.array(frames), pa.array(frames / frequency)]
    for column in columns_of(trajectory.layout):
        given = None if missing(states, column).all() else states[:, column.place]
        arrays.append(_array(given, length, schema.field(column.name).type))
    for field, values in ((ACTION, trajectory.actions), (SNAPSHOT, trajectory.snapshots)):
        if field.name in schema.names:
            arrays.append(_array(values, length, field.type))
    return pa.table(arrays, schema=schema)


def index_of(table: pa.Table, frequency: float, source: str) -> Index:
    """Find the episodes of a table, and check their numbers and times.

    Args:
        table: the whole file.
        frequency: frames per second.
        source: file, for messages.

    Raises:
        DemonstrationError: an episode in pieces, a frame out of order, a time that belongs to another frame.
    """
    episode, frame = whole_numbers(table, EPISODE.name, source), whole_numbers(table, FRAME.name, source)
    index = Index(source, episode, frame, ())
    starts = np.flatnonzero(np.append(True, episode[1:] != episode[:-1])[: len(episode)])
    sizes = np.diff(np.append(starts, len(episode)))
    numbers, position = episode[starts], np.arange(len(episode)) - np.repeat(starts, sizes)
    broken = starts[(np.diff(numbers, prepend=-1) <= 0) | (numbers >= _MOST_EPISODES)]
    if broken.size:
        index.complain(int(broken[0]), EPISODE.name, f"out of order in row {broken[0]}, expected {IN_ORDER}")
    skipped = np.flatnonzero(frame != position)
    if skipped.size:
        index.complain(int(skipped[0]), FRAME.name, f"found {frame[skipped[0]]}, expected {position[skipped[0]]}")
    _check_times(table, index, np.repeat(starts, sizes), frequency)
    slices = [slice(0, 0)] * (int(numbers[-1]) + 1 if len(numbers) else 0)
    for number, start, size in zip(numbers, starts, sizes, strict=True):
        slices[number] = slice(int(start), int(start + size))
    return Index(source, episode, frame, tuple(slices))


def whole_numbers(table: pa.Table, name: str, source: str) -> IntArray:
    """Read a column of whole numbers (n,).

    Raises:
        DemonstrationError: the column holds anything else.
    """
    column = table.column(name)
    if not pa.types.is_integer(column.type) or column.null_count:
        found = f"{column.type} with nulls" if column.null_count else column.type
        msg = f"{source}: column {name}: found {found}, expected whole numbers without nulls"
        raise DemonstrationError(msg)
    return np.asarray(column.cast(pa.int64()).to_numpy())


def decode(table: pa.Table, layout: Layout, action_size: int, index: Index) -> tuple[Trajectory, ...]:
    """Read every episode of a table.

    Raises:
        DemonstrationError: a column of the wrong type or width, a NaN, a value missing within an episode.
    """
    states = np.full((len(index.episode), layout.size), np.nan)
    for column in columns_of(layout):
        states[:, column.place] = attribute_values(table, column, index)
    actions = action_values(table, index, action_size)
    snapshots = snapshot_values(table, index)
    return tuple(
        Trajectory(layout, states[rows], done, saved)
        for rows, done, saved in zip(index.slices, actions, snapshots, strict=True)
    )


def _array(values: FloatArray | None, length: int, kind: pa.DataType) -> pa.Array:
    """Store rows (n, w) as numbers or lists; rows that are lacking are null."""
    if values is None:
        return pa.nulls(length, kind)
    if pa.types.is_floating(kind):
        return pa.array(values[:, 0])
    large = pa.types.is_large_list(kind)
    offsets = pa.array(np.arange(len(values) + 1) * values.shape[1], pa.int64() if large else pa.int32())
    lists = (pa.LargeListArray if large else pa.ListArray).from_arrays(offsets, pa.array(values.ravel()))
    return pa.concat_arrays([lists, pa.nulls(length - len(values), kind)])


def _check_times(table: pa.Table, index: Index, start: IntArray, frequency: float) -> None:
    """Refuse timestamps that do not belong to their frame; `start` is the first row of each row's episode."""
    times = _scalars(table, TIMESTAMP.name, index).values[:, 0]
    elapsed, expected = times - times[start], index.frame / frequency
    wrong = np.flatnonzero(~(np.abs(elapsed - expected) <= _DRIFT / frequency))
    if wrong.size:
        row = int(wrong[0])
        what = f"found {elapsed[row]:g} s after the first frame, expected {expected[row]:g} s"
        index.complain(row, TIMESTAMP.name, what)


def attribute_values(table: pa.Table, column: Column, index: Index) -> FloatArray:
    """Read one attribute (n, w); null only for whole episodes.

    Raises:
        DemonstrationError: as `decode` has it.
    """
    width = column.attribute.width
    numbers = _scalars(table, column.name, index) if width == 1 else _lists(table, column.name, index, width)
    wrong = ~np.isfinite(numbers.values) & ~numbers.null[:, None]
    if wrong.any():
        row, component = np.argwhere(wrong)[0]
        found = f"found {numbers.values[row, component]:g}, expected a finite number"
        index.complain(row, column.component(component), found)
    for rows in index.slices:
        if not _uniform(numbers.null[rows]):
            row = rows.start + int(numbers.null[rows].argmax())
            index.complain(row, column.name, "found no value, expected one as in the episode's other frames")
    return numbers.values


def action_values(table: pa.Table, index: Index, action_size: int) -> list[FloatArray | None]:
    """Read the actions of every episode.

    Raises:
        DemonstrationError: as `decode` has it.
    """
    numbers = _lists(table, ACTION.name, index, action_size)
    return [_actions(numbers, rows, index) for rows in index.slices]


def snapshot_values(table: pa.Table, index: Index) -> list[FloatArray | None]:
    """Read the simulator states of every episode.

    Raises:
        DemonstrationError: as `decode` has it.
    """
    stored = SNAPSHOT.name in table.column_names
    numbers = _lists(table, SNAPSHOT.name, index, None) if stored else None
    return [_snapshots(numbers, rows, index) for rows in index.slices]


def _actions(numbers: _Numbers, rows: slice, index: Index) -> FloatArray | None:
    """Take an episode's actions (T, A); None when it has none."""
    null = numbers.null[rows]
    if not len(null):
        return None
    if not null[-1]:
        index.complain(rows.stop - 1, ACTION.name, "found an action, expected none at the last frame")
    if not _uniform(null[:-1]):
        row = rows.start + int(null.argmax())
        index.complain(row, ACTION.name, "found no value, expected an action as in the episode's other frames")
    return None if null[0] else numbers.values[rows][:-1]


def _snapshots(numbers: _Numbers | None, rows: slice, index: Index) -> FloatArray | None:
    """Take an episode's snapshots (T + 1, S); None when it has none."""
    if numbers is None or numbers.null[rows].all():
        return None
    if not _uniform(numbers.null[rows]):
        row = rows.start + int(numbers.null[rows].argmax())
        index.complain(row, SNAPSHOT.name, "found no value, expected one as in the episode's other frames")
    return numbers.values[rows]


def _uniform(flags: BoolArray) -> bool:
    """Whether all flags are the same."""
    return bool(flags.all() or not flags.any())


def _scalars(table: pa.Table, name: str, index: Index) -> _Numbers:
    """Read a column of floating-point numbers (n, 1)."""
    column = table.column(name)
    if pa.types.is_null(column.type):
        return _nothing(len(column), 1)
    if not pa.types.is_floating(column.type):
        _wrong_type(index.source, name, column.type, "floating-point numbers")
    null = np.asarray(column.is_null().to_numpy())
    values = column.cast(pa.float64()).fill_null(np.nan).to_numpy()
    return _Numbers(np.asarray(values)[:, None], null)


def _lists(table: pa.Table, name: str, index: Index, width: int | None) -> _Numbers:
    """Read a column of lists of floating-point numbers, all of one width (of any, when None)."""
    column = table.column(name)
    if pa.types.is_null(column.type):
        return _nothing(len(column), width or 0)
    kind, expected = column.type, f"lists of {width or 'equally many'} floating-point numbers"
    if not _is_list(kind) or not pa.types.is_floating(kind.value_type):
        _wrong_type(index.source, name, kind, expected)
    array = pa.concat_arrays([pa.array([], _LISTS), *column.cast(_LISTS).chunks])
    null = np.asarray(array.is_null().to_numpy(zero_copy_only=False))
    sizes = np.asarray(pc.list_value_length(array).drop_null().to_numpy())
    wanted = width if width is not None else int(sizes[0]) if len(sizes) else 0
    odd = np.flatnonzero(sizes != wanted)
    if odd.size:
        row = int(np.flatnonzero(~null)[odd[0]])
        index.complain(row, name, f"found a list of {sizes[odd[0]]}, expected {expected}")
    values = np.full((len(array), wanted), np.nan)
    values[~null] = np.asarray(array.flatten().fill_null(np.nan)).reshape(len(sizes), wanted)
    return _Numbers(values, null)


def _nothing(length: int, width: int) -> _Numbers:
    """Read a column that holds nothing at all, for which other programs choose a type of its own."""
    return _Numbers(np.full((length, width), np.nan), np.ones(length, dtype=np.bool_))


def _is_list(kind: pa.DataType) -> bool:
    """Whether a type is a list of any sort."""
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _wrong_type(source: str, name: str, found: pa.DataType, expected: str) -> NoReturn:
    """Raise for a column of the wrong type."""
    msg = f"{source}: column {name}: found {found}, expected {expected}"
    raise DemonstrationError(msg)
