"""Append-only records in a JSON Lines file: each record is kept once, even when a resumed run appends it again.

Whoever is killed in the middle of a line leaves a torn one; the next writer cuts it off. A record that is told again,
because a run was resumed from before it, is recognised by its identity and keeps its first time stamp. Every record
carries a checksum; one that was damaged ends the journal, and what followed is told again when the run goes on.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from time import time_ns
from typing import TypeAlias
from zlib import crc32

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json, canonical_json, parse_json

Record: TypeAlias = Mapping[str, Json]
SUM = "sum"
"""Field with the checksum, in the file alone."""
log = logging.getLogger(__name__)


class Journal:
    """One file, one writer.

    Args:
        path: the file; made when the first record comes.
        identity: names of the fields by which a record is recognised.
    """

    def __init__(self, path: Path, identity: Sequence[str]) -> None:
        """Read what is there, and cut off a torn last line."""
        self.path = path
        self._identity = tuple(identity)
        whole = 0
        self._known: dict[str, Record] = {}
        for end, record in read_records(path):
            whole = end
            self._known.setdefault(self._key(record), record)
        if path.exists() and path.stat().st_size > whole:
            os.truncate(path, whole)

    def append(self, record: Record) -> Record:
        """Append a record unless it is known.

        Args:
            record: JSON values; `time` may be given where it happened before now.

        Returns:
            The record as it stands in the file: with `time`, milliseconds since 1970, at which it was first told.

        Raises:
            ArtifactError: the system refused the write.
        """
        known = self._known.get(self._key(record))
        if known is not None:
            return known
        stamped = {"time": time_ns() // 1_000_000, **record}
        try:
            with self.path.open("ab") as file:
                file.write(canonical_json({**stamped, SUM: _sum(stamped)}).encode() + b"\n")
        except OSError as error:
            msg = f"{self.path}: could not be written ({error.strerror or error})"
            raise ArtifactError(msg) from error
        self._known[self._key(record)] = stamped
        return stamped

    def records(self) -> tuple[Record, ...]:
        """Return every record, oldest first."""
        return tuple(self._known.values())

    def _key(self, record: Record) -> str:
        return canonical_json([record.get(name) for name in self._identity])


def read_records(path: Path, start: int = 0) -> Iterator[tuple[int, Record]]:
    """Read whole lines of a journal, which another process may be writing.

    Args:
        path: the file; one that does not exist has no records.
        start: byte at which to begin, 0 or an end given before.

    Yields:
        The byte after each record, and the record. Reading stops at a line that is torn or no JSON object.
    """
    if not path.exists():
        return
    with path.open("rb") as file:
        file.seek(start)
        for line in file:
            record = _parsed(line)
            if record is None:
                if line.endswith(b"\n"):
                    log.warning("%s: damaged at byte %d; what follows is left out", path, start)
                return
            start += len(line)
            yield start, record


def _parsed(line: bytes) -> Record | None:
    if not line.endswith(b"\n"):
        return None
    try:
        record = parse_json(line.decode())
    except (ValueError, UnicodeDecodeError):
        return None
    if not isinstance(record, Mapping):
        return None
    told = {name: value for name, value in record.items() if name != SUM}
    return told if record.get(SUM) in (None, _sum(told)) else None


def _sum(record: Record) -> str:
    """Return a record's checksum."""
    return f"{crc32(canonical_json(record).encode()):08x}"
