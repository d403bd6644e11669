"""Files that are either whole or absent, their hashes, and JSON with one spelling.

A file is written under a hidden name in its own directory, flushed to the disk and renamed, so that whoever is killed
at any moment leaves the old file or the new one. The writer holds a lock on the hidden file while it lives; a hidden
file without a living owner is rubbish of a dead process, and the next writer in that directory removes it.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version
from typing import NoReturn, TypeAlias

from roboscribe.errors import ArtifactError
from roboscribe.io.lock import try_lock

Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"

_SUFFIX = ".unfinished"
_CHUNK_BYTES = 1 << 22


@dataclass(frozen=True)
class _Staged:
    """A file under its hidden name; `descriptor` holds the lock that says its owner lives."""

    hidden: Path
    descriptor: int


def write_file(path: Path, data: bytes) -> None:
    """Write one file so that `path` holds the old or the new bytes whatever happens.

    Args:
        path: target; its directory must exist.
        data: whole content.

    Raises:
        ArtifactError: the system refused (disk full, no permission); what was at `path` is still there.
    """
    write_files({path: data})


def write_files(files: Mapping[Path, bytes]) -> None:
    """Write several files, each atomically, renamed in the order given once all of them are on the disk.

    The group is not one transaction: whoever is killed between two renames leaves some files new and the later ones
    old, each of them whole. Put the file that vouches for the others last.

    Args:
        files: content by target; the targets' directories must exist.

    Raises:
        ArtifactError: the system refused a write; no target has been touched unless a rename itself failed.
    """
    for directory in dict.fromkeys(path.parent for path in files):
        remove_unfinished(directory)
    staged: list[_Staged] = []
    path = Path()
    try:
        for path, data in files.items():
            staged.append(_reserve(path))
            _write_through(staged[-1].descriptor, data)
        for path, item in zip(files, staged, strict=True):
            os.replace(item.hidden, path)
        for path in dict.fromkeys(path.parent for path in files):
            _sync_directory(path)
    except OSError as error:
        raise _refused(path, error) from error
    finally:
        for item in staged:
            item.hidden.unlink(missing_ok=True)
            os.close(item.descriptor)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the path of a hidden, empty file to fill, and put it in the place of `path` when the block ends well.

    For files that are too large to be held as bytes. The hidden file is locked: whoever opens it for writing must not
    ask for a lock of its own.

    Args:
        path: target; its directory must exist.

    Raises:
        ArtifactError: the system refused; what was at `path` is still there.
    """
    remove_unfinished(path.parent)
    item: _Staged | None = None
    try:
        item = _reserve(path)
        yield item.hidden
        os.fsync(item.descriptor)
        os.replace(item.hidden, path)
        _sync_directory(path.parent)
    except OSError as error:
        raise _refused(path, error) from error
    finally:
        if item is not None:
            item.hidden.unlink(missing_ok=True)
            os.close(item.descriptor)


def remove_unfinished(directory: Path) -> tuple[Path, ...]:
    """Remove hidden files that writers killed in the middle left in a directory.

    Returns:
        The removed paths; files whose writer still lives stay.
    """
    found = sorted(directory.glob(f".*{_SUFFIX}"))
    return tuple(path for path in found if _remove_if_orphan(path))


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def sha256_of_bytes(data: bytes) -> str:
    """Return the SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def canonical_json(value: Json) -> str:
    """Spell a value as JSON in the one way that equal values share: sorted keys, no blanks.

    Raises:
        ValueError: NaN or an infinity, which JSON does not have.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def indented_json(value: Json) -> str:
    """Spell a value as JSON for human readers: sorted keys, two blanks, a newline at the end."""
    return json.dumps(value, sort_keys=True, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def parse_json(text: str) -> Json:
    """Read strict JSON: no NaN, no infinity, no key twice, no nesting beyond Python's own limit.

    Raises:
        ValueError: the text is anything else; the message says where.
    """
    try:
        value: Json = json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_without_repeats)
    except RecursionError:
        msg = "JSON is nested too deep"
        raise ValueError(msg) from None
    return value


def package_versions(names: Iterable[str]) -> dict[str, str]:
    """Look up versions of Python and of the named packages; packages that are not installed are left out."""
    found = {name: _installed(name) for name in names}
    return {"python": python_version(), **{name: number for name, number in found.items() if number}}


@cache
def _installed(name: str) -> str | None:
    """Return a package's version, None where it is not installed; it cannot change while the process lives."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _refused(path: Path, error: OSError) -> ArtifactError:
    """Say that the system refused to write a file."""
    msg = f"{path}: could not be written ({error.strerror or error}); what stood there before is unchanged"
    return ArtifactError(msg)


def _reserve(path: Path) -> _Staged:
    """Create and lock a hidden file beside `path`; try again where a cleaner took it before the lock."""
    while True:
        hidden = path.with_name(f".{path.name}.{secrets.token_hex(8)}{_SUFFIX}")
        descriptor = os.open(hidden, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        if try_lock(descriptor) and os.fstat(descriptor).st_nlink:
            return _Staged(hidden, descriptor)
        os.close(descriptor)


def _write_through(descriptor: int, data: bytes) -> None:
    """Write all bytes and wait until they are on the disk."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(descriptor, rest[:_CHUNK_BYTES]) :]
    os.fsync(descriptor)


def _sync_directory(directory: Path) -> None:
    """Wait until renames in a directory are on the disk."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _remove_if_orphan(path: Path) -> bool:
    """Remove a hidden file unless its writer lives; True when this call removed it."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:  # renamed or removed since it was listed, or not ours to open
        return False
    try:
        if not try_lock(descriptor):
            return False
        path.unlink(missing_ok=True)
        return True
    finally:
        os.close(descriptor)


def _refuse_constant(name: str) -> NoReturn:
    """Refuse NaN, Infinity and -Infinity, which Python would accept."""
    msg = f"{name} is not JSON"
    raise ValueError(msg)


def _without_repeats(pairs: list[tuple[str, Json]]) -> dict[str, Json]:
    """Build an object, refusing a key that stands in it twice."""
    found = dict(pairs)
    if len(found) != len(pairs):
        msg = "a key stands twice in one JSON object"
        raise ValueError(msg)
    return found
