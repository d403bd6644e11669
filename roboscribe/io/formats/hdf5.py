"""Reading HDF5 files of unknown origin: every access ends in numbers or in a typed error.

Links to other files, virtual and external datasets are refused, and so are datasets of which a part was never written:
the library would give zeros for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roboscribe.errors import DemonstrationError
from roboscribe.io.episodes import damaged
from roboscribe.io.formats.foreign import MOST_NUMBERS
from roboscribe.world.layout import FloatArray

if TYPE_CHECKING:
    import h5py

_UNREADABLE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, OverflowError, MemoryError)
"""What h5py raises on bytes that are no HDF5."""
_MOST_DIGITS = 8
"""Digits of a group's number, at most."""
_DEEPEST = 8
"""Groups within groups that are looked into."""


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file for reading, without a cache: everything is read once.

    Raises:
        DemonstrationError: there is no such file, or it is no HDF5.
    """
    import h5py

    if not path.is_file():
        msg = f"{path}: no such file, expected HDF5"
        raise DemonstrationError(msg)
    with _guarded(str(path)):
        file = h5py.File(path, "r", locking=False, rdcc_nbytes=0)
    try:
        yield file
    finally:
        file.close()


@contextmanager
def created(path: Path) -> Iterator[h5py.File]:
    """Create an HDF5 file in the newest layout, which guards its structure with checksums.

    `path` may be locked by its owner, so HDF5 takes no lock of its own.
    """
    import h5py

    with h5py.File(path, "w", libver="latest", locking=False) as file:
        yield file


def store(group: h5py.Group, name: str, values: FloatArray) -> None:
    """Write an array whose first axis is frames; its bytes are guarded by checksums unless there are none."""
    group.create_dataset(name, data=values, chunks=values.shape if values.size else None, fletcher32=bool(values.size))


def groups(parent: h5py.Group, where: str) -> dict[str, h5py.Group]:
    """List the groups within a group."""
    import h5py

    return {name: item for name, item in _children(parent, where).items() if isinstance(item, h5py.Group)}


def numbered(names: Iterable[str], prefix: str) -> list[str]:
    """List the names that are a prefix and a number, in the order of the numbers."""
    digits = {name: name.removeprefix(prefix) for name in names if name.startswith(prefix)}
    numbers = {name: int(text) for name, text in digits.items() if text.isdecimal() and len(text) <= _MOST_DIGITS}
    return sorted(numbers, key=lambda name: numbers[name])


def child(parent: h5py.Group, name: str, where: str) -> h5py.Group:
    """Return a group that must be there."""
    found = groups(parent, where).get(name)
    if found is None:
        msg = f"{where}: no group {name}"
        raise DemonstrationError(msg)
    return found


def datasets(parent: h5py.Group, where: str, prefix: str = "", depth: int = 0) -> dict[str, h5py.Dataset]:
    """List the datasets of numbers with at most two axes within a group and the groups in it, by their paths."""
    import h5py

    found: dict[str, h5py.Dataset] = {}
    for name, item in _children(parent, where).items():
        if isinstance(item, h5py.Group) and depth < _DEEPEST:
            found |= datasets(item, where, f"{prefix}{name}/", depth + 1)
        elif isinstance(item, h5py.Dataset) and _numeric(item, where):
            found[prefix + name] = item
    return found


def rows(dataset: h5py.Dataset, where: str) -> int:
    """Return the length of a dataset's first axis."""
    with _guarded(where):
        return int(dataset.shape[0])


def width(dataset: h5py.Dataset, where: str) -> int:
    """Return the count of numbers per row."""
    with _guarded(where):
        return int(prod(dataset.shape[1:]))


def read(dataset: h5py.Dataset, where: str) -> FloatArray:
    """Read a dataset as numbers (n, w).

    Raises:
        DemonstrationError: damage, data in other files, or a part that was never written.
    """
    with _guarded(where):
        if dataset.is_virtual or dataset.external:
            msg = f"{where}: its data lie in other files, expected them in this one"
            raise DemonstrationError(msg)
        if dataset.size > MOST_NUMBERS or not _complete(dataset):
            msg = f"{where}: damaged, or never written as a whole: shape {dataset.shape}"
            raise DemonstrationError(msg)
        values = np.asarray(dataset[()], dtype=np.float64)
        return values.reshape(len(values), prod(values.shape[1:]))


def attribute(item: h5py.Group, name: str, where: str) -> object:
    """Read an attribute; None where there is none."""
    with _guarded(f"{where}: attribute {name}"):
        return item.attrs.get(name)


def _children(parent: h5py.Group, where: str) -> dict[str, h5py.Group | h5py.Dataset]:
    """List what lies in a group itself."""
    import h5py

    found: dict[str, h5py.Group | h5py.Dataset] = {}
    with _guarded(where):
        for name in parent:
            if not isinstance(parent.get(name, getlink=True), h5py.HardLink):
                msg = f"{where}: {name} is a link to another place, expected what it stands for"
                raise DemonstrationError(msg)
            found[name] = parent[name]
    return found


def _numeric(dataset: h5py.Dataset, where: str) -> bool:
    """Whether a dataset holds numbers, one row per frame."""
    with _guarded(where):
        return bool(dataset.dtype.kind in "biuf" and len(dataset.shape) in (1, 2))


def _complete(dataset: h5py.Dataset) -> bool:
    """Whether all of a dataset was written."""
    if not dataset.size:
        return True
    if dataset.chunks is None:
        return bool(dataset.id.get_storage_size() == dataset.size * dataset.dtype.itemsize)
    pieces = prod(-(-size // chunk) for size, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    return bool(dataset.id.get_num_chunks() == pieces)


@contextmanager
def _guarded(where: str) -> Iterator[None]:
    """Turn whatever the library raises on damage into a typed error."""
    try:
        yield
    except _UNREADABLE as error:
        raise damaged(where, error, "not what was expected") from error
