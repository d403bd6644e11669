"""Comma-separated values: a row per frame, a column per number, names in the first row.

Columns are `episode_index`, `frame_index`, `timestamp` (s), one per number of an attribute (`b1.position.x`),
`action[0]` and so on, and `snapshot[0]` and so on where simulator states are stored. A cell without a value is empty:
actions at an episode's last frame, goals that are not given. Numbers are
spelled so that reading them gives the same bits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import replacing
from roboscribe.io.episodes import UNREADABLE, damaged
from roboscribe.io.formats.foreign import (
    ACTION,
    SNAPSHOT,
    Contents,
    Field,
    Format,
    Recording,
    Shown,
    Source,
    actions_of,
    component_names,
    snapshots_of,
)
from roboscribe.io.formats.tables import EPISODE, FRAME, TIME, complain, is_numeric, lengths_in, recordings_of
from roboscribe.world import Trajectory
from roboscribe.world.layout import FloatArray

EPISODE_NAMES = (EPISODE, "episode", "episode_id", "demo", "trial", "trajectory")
"""Names under which a column of episode numbers is looked for."""
_DECIMALS = 6
"""Places to which a frequency is rounded that is worked out from times."""


@dataclass(frozen=True)
class _Table:
    """An open file; `episode` is None where all rows are one episode."""

    contents: Contents
    _path: Path
    _names: tuple[str, ...]
    _episode: str | None

    def recordings(self, columns: Sequence[str]) -> Iterator[Recording]:
        """Read columns of every episode."""
        numbering = [name for name in (FRAME, TIME) if name in self._names]
        wanted = {name: pa.float64() for name in (*numbering, *columns)}
        if self._episode is not None:
            wanted[self._episode] = pa.int64()
        try:
            yield from recordings_of(
                _tables(self._path, wanted), columns,
                episode=self._episode, lengths=self.contents.lengths, frequency=self.contents.frequency,
                source=str(self._path),
            )  # fmt: skip
        except pa.ArrowInvalid as error:
            _locate(self._path, columns, self._episode)
            raise damaged(str(self._path), error, "no comma-separated values") from error


@contextmanager
def open_csv(path: Path, episode: str | None = None) -> Iterator[Source]:
    """Open a file.

    Args:
        path: the file.
        episode: column of episode numbers; left out: one that is called so; empty: all rows are one episode.

    Raises:
        DemonstrationError: the file cannot be read, names a column twice, or lacks the column of episode numbers.
    """
    kinds = _kinds(path)
    chosen = episode_column(tuple(kinds), episode, str(path))
    fields = tuple(Field(name, 1) for name, numeric in kinds.items() if numeric and name not in (chosen, FRAME, TIME))
    wanted = {chosen: pa.int64()} if chosen else {next(iter(kinds)): pa.string()}
    try:
        tables = _tables(path, wanted)
        lengths = lengths_in(tables, chosen, str(path)) if chosen else (sum(len(table) for table in tables),)
        frequency = _frequency(path, lengths[0]) if kinds.get(TIME) and lengths else None
    except UNREADABLE as error:
        raise damaged(str(path), error, "no comma-separated values") from error
    yield _Table(Contents(fields, lengths, frequency), path, tuple(kinds), chosen)


def write_csv(path: Path, shown: Shown) -> None:
    """Write demonstrations as one file.

    Raises:
        ArtifactError: the system refused the write.
    """
    names = [name for column in shown.columns for name in component_names(column)]
    names += [f"{ACTION}[{i}]" for i in range(shown.task.action_size)] * shown.actions
    names += [f"{SNAPSHOT}[{i}]" for i in range(shown.snapshot_size)]
    numbers = [pa.field(name, pa.float64()) for name in names]
    schema = pa.schema(
        [pa.field(EPISODE, pa.int64()), pa.field(FRAME, pa.int64()), pa.field(TIME, pa.float64()), *numbers]
    )
    with replacing(path) as hidden, csv.CSVWriter(hidden, schema) as writer:
        for number, trajectory in enumerate(shown.trajectories()):
            frames = np.arange(len(trajectory))
            values = _values(trajectory, shown)
            cells = [pa.array(values[:, i], from_pandas=True) for i in range(values.shape[1])]
            numbering = [np.full(len(frames), number), frames, frames / shown.header.frequency]
            writer.write_table(pa.table([*map(pa.array, numbering), *cells], schema=schema))


def episode_column(names: Sequence[str], asked: str | None, source: str) -> str | None:
    """Choose the column of episode numbers; None where all rows are one episode.

    Raises:
        DemonstrationError: there is no such column.
    """
    if asked is None:
        return next((name for name in EPISODE_NAMES if name in names), None)
    if asked and asked not in names:
        msg = f"{source}: no column {asked!r} of episode numbers, found {', '.join(names)}"
        raise DemonstrationError(msg)
    return asked or None


def _values(trajectory: Trajectory, shown: Shown) -> FloatArray:
    """Return all numbers of an episode (T + 1, n), NaN where a cell is to be empty."""
    parts = [trajectory.states]
    if shown.actions:
        last = np.full((1, shown.task.action_size), np.nan)
        parts.append(np.concatenate([actions_of(trajectory, shown.task.action_size), last]))
    if shown.snapshot_size:
        parts.append(snapshots_of(trajectory, shown.snapshot_size))
    return np.concatenate(parts, axis=1)


def _kinds(path: Path) -> dict[str, bool]:
    """Say of each column whether its first rows are numbers, or empty."""
    if not path.is_file():
        msg = f"{path}: no such file, expected comma-separated values"
        raise DemonstrationError(msg)
    try:
        with csv.open_csv(path) as reader:
            schema = reader.schema
        names = schema.names
    except UNREADABLE as error:
        raise damaged(str(path), error, "no comma-separated values") from error
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        msg = f"{path}: column {', '.join(repeated)} stands more than once in the first row, expected once"
        raise DemonstrationError(msg)
    return {field.name: is_numeric(field.type) or pa.types.is_null(field.type) for field in schema}


def _tables(path: Path, kinds: dict[str, pa.DataType]) -> Iterator[pa.Table]:
    """Read columns, some thousand rows at a time."""
    options = csv.ConvertOptions(include_columns=list(kinds), column_types=kinds, strings_can_be_null=True)
    with csv.open_csv(path, convert_options=options) as reader:
        for batch in reader:
            yield pa.Table.from_batches([batch])


def _frequency(path: Path, length: int) -> float | None:
    """Work out frames per second from the times of the first episode; None where they do not say."""
    if length < 2:
        return None
    times = np.concatenate([np.asarray(t.column(TIME), dtype=np.float64) for t in _first(path, length)])[:length]
    step = float(np.median(np.diff(times)))
    return round(1.0 / step, _DECIMALS) if step > 0.0 else None


def _first(path: Path, length: int) -> Iterator[pa.Table]:
    """Read the times of at least so many rows."""
    read = 0
    for table in _tables(path, {TIME: pa.float64()}):
        yield table
        read += len(table)
        if read >= length:
            return


def _locate(path: Path, columns: Sequence[str], episode: str | None) -> None:
    """Find the first cell that is no number, and complain about it."""
    kinds = {name: pa.string() for name in columns} | ({episode: pa.int64()} if episode else {})
    number, frame = 0, 0
    for table in _tables(path, kinds):
        numbers = table.column(episode).to_pylist() if episode else [0] * len(table)
        cells = {name: table.column(name).to_pylist() for name in columns}
        for row, present in enumerate(numbers):
            number, frame = (present, 0) if present != number else (number, frame)
            for name in columns:
                text = cells[name][row]
                if text is not None and not _is_number(text):
                    complain(str(path), number, frame, name, f"found {text[:40]!r}, expected a number")
            frame += 1


def _is_number(text: str) -> bool:
    """Whether a cell reads as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


FORMAT = Format(
    name="csv",
    spelling="comma-separated values with a row per frame",
    directory=False,
    least_frames=1,
    open=open_csv,
    write=write_csv,
)
