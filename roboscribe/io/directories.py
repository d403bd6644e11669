"""Directories that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from roboscribe.errors import ArtifactError
from roboscribe.io.lock import try_lock

_SUFFIX = ".unfinished-directory"


@contextmanager
def building(path: Path) -> Iterator[Path]:
    """Give a hidden, empty directory to fill, and call it `path` when the block ends well.

    What a writer that was killed left behind is removed by the next one in the same place.

    Args:
        path: target; it must not exist, its parent must.

    Raises:
        ArtifactError: the target exists, or the system refused.
    """
    if path.exists():
        msg = f"{path}: exists already, expected a new directory; choose another name or remove it first"
        raise ArtifactError(msg)
    _remove_abandoned(path.parent)
    hidden = path.with_name(f".{path.name}.{secrets.token_hex(8)}{_SUFFIX}")
    lock: int | None = None
    try:
        hidden.mkdir()
        lock = _locked(hidden)
        yield hidden
        _sync(hidden)
        hidden.rename(path)
        _sync_one(path.parent)
    except OSError as error:
        msg = f"{path}: could not be written ({error.strerror or error})"
        raise ArtifactError(msg) from error
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _remove_abandoned(parent: Path) -> None:
    """Remove hidden directories whose writers are dead."""
    for hidden in parent.glob(f".*{_SUFFIX}"):
        lock = _locked(hidden)
        if lock is not None:
            shutil.rmtree(hidden, ignore_errors=True)
            os.close(lock)


def _locked(directory: Path) -> int | None:
    """Take the lock of a directory; None when another process holds it, or the directory is gone."""
    try:
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:  # renamed or removed since it was listed, or not ours to open
        return None
    if try_lock(descriptor):
        return descriptor
    os.close(descriptor)
    return None


def _sync(directory: Path) -> None:
    """Wait until everything within a directory is on the disk."""
    for folder, _, files in os.walk(directory, topdown=False):
        for name in files:
            _sync_one(Path(folder, name))
        _sync_one(Path(folder))


def _sync_one(path: Path) -> None:
    """Wait until one file or directory is on the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
