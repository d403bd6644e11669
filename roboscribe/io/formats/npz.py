"""NumPy's archive of arrays.

We write `episode_index`, `frame_index` and `timestamp` (N,) for the N frames of all episodes, one array (N, w) per
attribute, `action` (N, A) and `snapshot` (N, S), NaN where there is no value, and the number `frequency`. What is read
may also be stacked, episodes of equal length in arrays (E, T, w), or one episode alone. Pickled objects are refused.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from math import prod
from pathlib import Path
from tokenize import TokenError
from zipfile import BadZipFile, ZipFile, ZipInfo

import numpy as np

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import replacing
from roboscribe.io.episodes import damaged
from roboscribe.io.formats.csv_file import episode_column
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
    named_parts,
    snapshots_of,
)
from roboscribe.io.formats.tables import EPISODE, FRAME, TIME, check_order, check_times, complain
from roboscribe.world.layout import FloatArray, IntArray

_UNREADABLE = (
    BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError, ValueError, KeyError, SyntaxError,
    TokenError, MemoryError, TypeError, OverflowError,
)  # fmt: skip
"""What zipfile and NumPy raise on bytes that are no archive of arrays."""
_SUFFIX = ".npy"
_FREQUENCY = "frequency"
_HEADER_BYTES = 1 << 16


@dataclass(frozen=True)
class _Header:
    """What an array says about itself: shape, type, order of its axes, and where its numbers begin."""

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    fortran: bool
    offset: int


@dataclass(frozen=True)
class _Archive:
    """An open archive; `rows` are each episode's rows, None where episodes are stacked."""

    contents: Contents
    _path: Path
    _headers: dict[str, _Header]
    _rows: tuple[slice, ...] | None

    def recordings(self, columns: Sequence[str]) -> Iterator[Recording]:
        """Read columns of every episode."""
        numbering = [name for name in (FRAME, TIME) if name in self._headers and self._rows is not None]
        arrays = {name: _read(self._path, name, self._headers[name]) for name in (*numbering, *columns)}
        for number, length in enumerate(self.contents.lengths):
            where: slice | int = number if self._rows is None else self._rows[number]
            found = {name: _as_rows(array[where], array.ndim - (self._rows is None)) for name, array in arrays.items()}
            self._check(found, number, length)
            yield {name: found[name] for name in columns}

    def _check(self, found: Recording, number: int, length: int) -> None:
        """Compare frame numbers and times with what they must be."""
        source, frequency = str(self._path), self.contents.frequency
        if FRAME in found:
            check_order(found[FRAME][:, 0], number, source)
        if TIME in found and frequency is not None:
            check_times(found[TIME][:, 0], np.arange(length) / frequency, frequency, number, source)


@contextmanager
def open_npz(path: Path, episode: str | None = None) -> Iterator[Source]:
    """Open an archive.

    Args:
        path: the file.
        episode: array of episode numbers; left out: one that is called so; empty: there is none.

    Raises:
        DemonstrationError: the file cannot be read, or its arrays do not fit together.
    """
    headers = _headers(path)
    chosen = episode_column(tuple(headers), episode, str(path))
    rows, lengths = _by_number(path, chosen, headers[chosen]) if chosen else _by_shape(path, headers)
    shape = (len(lengths), max(lengths, default=0)) if rows is None else (sum(lengths),)
    fields = tuple(
        Field(name, int(prod(header.shape[len(shape) :])))
        for name, header in headers.items()
        if _is_column(name, header, shape) and name not in (chosen, FRAME, TIME)
    )
    frequency = None
    if _FREQUENCY in headers and headers[_FREQUENCY].shape == () and headers[_FREQUENCY].dtype.kind in "iuf":
        frequency = float(_read(path, _FREQUENCY, headers[_FREQUENCY]))
    usable = frequency if frequency is not None and 0 < frequency < np.inf else None
    yield _Archive(Contents(fields, lengths, usable), path, headers, rows)


def write_npz(path: Path, shown: Shown) -> None:
    """Write demonstrations as one archive; all of them lie in memory once.

    Raises:
        ArtifactError: the system refused the write.
    """
    ends = np.cumsum(shown.header.lengths)
    total = int(ends[-1]) if len(ends) else 0
    arrays = {column.name: np.empty((total, column.attribute.width)) for column in shown.columns}
    numbering = {EPISODE: np.empty(total, np.int64), FRAME: np.empty(total, np.int64), TIME: np.empty(total)}
    if shown.actions:
        arrays[ACTION] = np.full((total, shown.task.action_size), np.nan)
    if shown.snapshot_size:
        arrays[SNAPSHOT] = np.empty((total, shown.snapshot_size))
    for number, trajectory in enumerate(shown.trajectories()):
        stop = int(ends[number])
        rows = slice(stop - len(trajectory), stop)
        frames = np.arange(len(trajectory))
        numbering[EPISODE][rows], numbering[FRAME][rows], numbering[TIME][rows] = (
            number, frames, frames / shown.header.frequency,
        )  # fmt: skip
        for column, values in named_parts(trajectory):
            arrays[column.name][rows] = values
        if shown.actions:
            arrays[ACTION][rows.start : stop - 1] = actions_of(trajectory, shown.task.action_size)
        if shown.snapshot_size:
            arrays[SNAPSHOT][rows] = snapshots_of(trajectory, shown.snapshot_size)
    with replacing(path) as hidden, hidden.open("wb") as file:
        np.savez(file, **numbering, **arrays, frequency=np.float64(shown.header.frequency))


def _headers(path: Path) -> dict[str, _Header]:
    """List the arrays of numbers in an archive."""
    if not path.is_file():
        msg = f"{path}: no such file, expected an archive of arrays"
        raise DemonstrationError(msg)
    try:
        with ZipFile(path) as archive:
            _check_sums(archive)
            members = [info for info in archive.infolist() if info.filename.endswith(_SUFFIX)]
            found = {info.filename.removesuffix(_SUFFIX): _header(archive, info) for info in members}
    except _UNREADABLE as error:
        raise damaged(str(path), error, "no archive of arrays") from error
    if len(found) != len(members):
        msg = f"{path}: an array stands in it twice"
        raise DemonstrationError(msg)
    return {name: header for name, header in found.items() if header.dtype.kind in "biuf"}


def _check_sums(archive: ZipFile) -> None:
    """Compare everything in an archive with its checksums: its directory alone may hide an array, or its shape."""
    broken = archive.testzip()
    if broken is not None:
        msg = f"{broken} has another checksum"
        raise BadZipFile(msg)


def _header(archive: ZipFile, info: ZipInfo) -> _Header:
    """Read what an array says about itself."""
    with archive.open(info) as stream:
        text = BytesIO(stream.read(_HEADER_BYTES))
    version = np.lib.format.read_magic(text)  # type: ignore[no-untyped-call]  # NumPy 1.26 types none of these
    if version not in ((1, 0), (2, 0)):
        msg = f"version {version} of the array format, expected 1.0 or 2.0"
        raise ValueError(msg)
    reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = reader(text)  # type: ignore[no-untyped-call]  # as above
    found = _Header(shape, dtype, fortran, text.tell())
    if not dtype.hasobject and found.offset + _bytes(found) != info.file_size:
        msg = f"{info.filename} has {info.file_size} bytes, its shape {shape} asks for another count"
        raise ValueError(msg)
    return found


def _bytes(header: _Header) -> int:
    """Return the bytes that an array's numbers take."""
    return prod(header.shape) * header.dtype.itemsize


def _read(path: Path, name: str, header: _Header) -> FloatArray:
    """Read an array as numbers; the archive's checksum is verified."""
    try:
        with ZipFile(path) as archive:
            data = archive.read(name + _SUFFIX)
        values = np.frombuffer(data, header.dtype, offset=header.offset)
        shaped = values.reshape(header.shape, order="F" if header.fortran else "C")
        return np.asarray(shaped, dtype=np.float64)
    except _UNREADABLE as error:
        raise damaged(str(path), error, "no archive of arrays") from error


def _by_number(path: Path, name: str, header: _Header) -> tuple[tuple[slice, ...], tuple[int, ...]]:
    """Find each episode's rows by an array of episode numbers."""
    numbers = _read(path, name, header)
    if numbers.ndim != 1 or header.dtype.kind not in "iu":
        msg = f"{path}: column {name}: found {header.dtype}{header.shape}, expected whole numbers (N,)"
        raise DemonstrationError(msg)
    starts: IntArray = np.flatnonzero(np.append(True, numbers[1:] != numbers[:-1])[: len(numbers)])
    if (np.diff(numbers[starts]) <= 0).any():
        row = int(starts[1:][np.diff(numbers[starts]) <= 0][0])
        what = f"out of order in row {row}, expected ascending numbers, each episode in one piece"
        complain(str(path), int(numbers[row]), 0, name, what)
    stops = [*map(int, starts[1:]), len(numbers)] if len(numbers) else []
    rows = tuple(slice(int(start), stop) for start, stop in zip(starts, stops, strict=True))
    return rows, tuple(part.stop - part.start for part in rows)


def _by_shape(path: Path, headers: dict[str, _Header]) -> tuple[tuple[slice, ...] | None, tuple[int, ...]]:
    """Find episodes by the shapes of arrays: stacked (E, T, w), or one alone (T, w)."""
    stacked = [header.shape for name, header in headers.items() if len(header.shape) == 3 and name != ACTION]
    if stacked:
        return None, (stacked[0][1],) * stacked[0][0]
    flat = [header.shape[0] for name, header in headers.items() if len(header.shape) in (1, 2) and name != ACTION]
    if not flat:
        msg = f"{path}: no arrays of numbers (N, w) or (E, T, w)"
        raise DemonstrationError(msg)
    length = max(flat)
    return (slice(0, length),), (length,)


def _is_column(name: str, header: _Header, shape: tuple[int, ...]) -> bool:
    """Whether an array has a row for every frame; stacked actions may have one less."""
    leading = header.shape[: len(shape)]
    one_less = (*shape[:-1], shape[-1] - 1)
    return len(header.shape) <= len(shape) + 1 and (leading == shape or ("action" in name and leading == one_less))


def _as_rows(values: FloatArray, axes: int) -> FloatArray:
    """Return one episode's values as rows (n, w)."""
    return values[:, None] if axes == 1 else values


FORMAT = Format(
    name="npz",
    spelling="an archive of NumPy arrays",
    directory=False,
    least_frames=1,
    open=open_npz,
    write=write_npz,
)
