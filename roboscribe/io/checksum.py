"""A checksum over every byte of a Parquet file, so that any damage is seen before anything is read from it.

Page checksums guard the data pages only; page headers and the footer carry none. The checksum lies in the gap
that Parquet allows between the last column and the footer, where other programs ignore it, and a program that rewrites
the file drops it. A file therefore has one and is intact, has one and is damaged, or has none, for something else
wrote it.
"""

from __future__ import annotations

import hashlib
import os
from enum import Enum
from mmap import mmap
from pathlib import Path
from typing import BinaryIO, TypeAlias

Content: TypeAlias = "bytes | mmap"
"""A whole file, in memory or mapped into it."""

_HEAD = b"\x93RBSCRB\xff\xfe\x00seal\r\n\x1a"
_TAIL = b"\x93RBSCRB\xff\xfd\x00seal\r\n\x1a"
_HASH_BYTES = 32
_SIZE = len(_HEAD) + 2 * _HASH_BYTES + len(_TAIL)
_CHUNK_BYTES = 1 << 22
_TRAILER_BYTES = 8
"""Parquet ends with the footer's length (4 bytes, little endian) and the magic number PAR1."""


class Checksum(Enum):
    """What the checksum says about a file."""

    ABSENT = "without a checksum"
    INTACT = "intact"
    BODY_DAMAGED = "damaged before the footer"
    DAMAGED = "damaged, the footer included"


def add_checksum(path: Path) -> str:
    """Insert the checksum before a complete Parquet file's footer; returns the SHA-256 of the result, hexadecimal."""
    with path.open("r+b") as file:
        file.seek(-_TRAILER_BYTES, os.SEEK_END)
        trailer = file.read()
        cut = file.tell() - _TRAILER_BYTES - int.from_bytes(trailer[:4], "little")
        file.seek(cut)
        footer = file.read()
        file.seek(0)
        whole = _hashed_until(file, cut)
        rest = b"".join((_HEAD, whole.digest(), _hash(footer), _TAIL, footer))
        file.seek(cut)
        file.write(rest)
    whole.update(rest)
    return whole.hexdigest()


def verify_checksum(data: Content) -> Checksum:
    """Say whether a file has a checksum and is intact.

    Both ends of the checksum are searched for in the whole file, so that damage to one of them, or to the footer's
    length, does not make a file with a checksum look like one that never had one.
    """
    if data.rfind(_HEAD) < 0 and data.rfind(_TAIL) < 0:
        return Checksum.ABSENT
    cut = _footer_start(data)
    start = cut - _SIZE
    checksum, footer = data[max(start, 0) : cut], data[cut:]
    if not (checksum.startswith(_HEAD) and checksum.endswith(_TAIL) and len(checksum) == _SIZE):
        return Checksum.DAMAGED
    body_hash, footer_hash = checksum[len(_HEAD) :][:_HASH_BYTES], checksum[len(_HEAD) + _HASH_BYTES :][:_HASH_BYTES]
    if footer_hash != _hash(footer):
        return Checksum.DAMAGED
    with memoryview(data) as view, view[:start] as body:
        return Checksum.INTACT if body_hash == _hash(body) else Checksum.BODY_DAMAGED


def _footer_start(data: Content) -> int:
    """Return where the footer begins, by the length that the last bytes state; 0 when they cannot be right."""
    length = int.from_bytes(data[-_TRAILER_BYTES:-4], "little")
    return max(len(data) - _TRAILER_BYTES - length, 0)


def _hash(data: bytes | memoryview) -> bytes:
    """Return the SHA-256 of bytes."""
    return hashlib.sha256(data).digest()


def _hashed_until(file: BinaryIO, end: int) -> hashlib._Hash:
    """Hash a file from where it stands up to a position."""
    found = hashlib.sha256()
    while (rest := end - file.tell()) > 0:
        found.update(file.read(min(rest, _CHUNK_BYTES)))
    return found
