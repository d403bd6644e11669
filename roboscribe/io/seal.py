"""A seal over every byte of a Parquet file, so that any damage is seen before anything is read from it.

Page checksums guard the data pages only; page headers and the footer carry none. The seal lies in the gap that Parquet
allows between the last column and the footer, where other programs ignore it, and a program that rewrites the file
drops it. A file is therefore sealed and intact, sealed and damaged, or not sealed: written by something else.
"""

from __future__ import annotations

import hashlib
from enum import Enum

_HEAD = b"\x93RBSCRB\xff\xfe\x00seal\r\n\x1a"
_TAIL = b"\x93RBSCRB\xff\xfd\x00seal\r\n\x1a"
_HASH_BYTES = 32
_SIZE = len(_HEAD) + 2 * _HASH_BYTES + len(_TAIL)
_TRAILER_BYTES = 8
"""Parquet ends with the footer's length (4 bytes, little endian) and the magic number PAR1."""


class Seal(Enum):
    """What the seal says about a file."""

    ABSENT = "not sealed"
    INTACT = "intact"
    BODY_DAMAGED = "damaged before the footer"
    DAMAGED = "damaged, the footer included"


def sealed(parquet: bytes) -> bytes:
    """Insert the seal before the footer of a complete Parquet file."""
    cut = _footer_start(parquet)
    body, footer = parquet[:cut], parquet[cut:]
    return b"".join((body, _HEAD, _hash(body), _hash(footer), _TAIL, footer))


def examine(data: bytes) -> Seal:
    """Say whether a file is sealed and intact.

    Both ends of the seal are searched for in the whole file, so that damage to one of them, or to the footer's length,
    does not make a sealed file look like one that never had a seal.
    """
    if data.rfind(_HEAD) < 0 and data.rfind(_TAIL) < 0:
        return Seal.ABSENT
    cut = _footer_start(data)
    start = cut - _SIZE
    seal, body, footer = data[max(start, 0) : cut], data[: max(start, 0)], data[cut:]
    if not (seal.startswith(_HEAD) and seal.endswith(_TAIL) and len(seal) == _SIZE):
        return Seal.DAMAGED
    body_hash, footer_hash = seal[len(_HEAD) :][:_HASH_BYTES], seal[len(_HEAD) + _HASH_BYTES :][:_HASH_BYTES]
    if footer_hash != _hash(footer):
        return Seal.DAMAGED
    return Seal.INTACT if body_hash == _hash(body) else Seal.BODY_DAMAGED


def _footer_start(data: bytes) -> int:
    """Return where the footer begins, by the length that the last bytes state; 0 when they cannot be right."""
    length = int.from_bytes(data[-_TRAILER_BYTES:-4], "little")
    return max(len(data) - _TRAILER_BYTES - length, 0)


def _hash(data: bytes) -> bytes:
    """Return the SHA-256 of bytes."""
    return hashlib.sha256(data).digest()
