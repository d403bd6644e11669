"""Checkpoints of learners: one safetensors file with the arrays, and JSON in its header. Nothing is unpickled.

A digest over names, shapes, numbers and JSON tells whether a file is still what was written.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from roboscribe.errors import ArtifactError

Arrays: TypeAlias = dict[str, NDArray[np.generic]]
NOTES, DIGEST = "notes", "digest"
"""Header keys of the JSON text, and of what vouches for everything."""


def write_checkpoint(path: Path, arrays: Mapping[str, NDArray[np.generic]], notes: Mapping[str, object]) -> None:
    """Write arrays and JSON values as one file that is either the old or the new one, never half of one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    packed = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    text = json.dumps(notes)
    data = save(packed, {NOTES: text, DIGEST: _digest(packed, text)})
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def read_checkpoint(path: Path, identity: Mapping[str, object]) -> tuple[Arrays, dict[str, object]]:
    """Read what `write_checkpoint` wrote.

    Args:
        path: the file.
        identity: notes that must agree: which run this is.

    Raises:
        ArtifactError: the file is damaged, is no checkpoint, or is another run's.
    """
    try:
        with safe_open(str(path), framework="numpy") as file:
            header = file.metadata() or {}
            notes: dict[str, object] = json.loads(header[NOTES])
            arrays: Arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no mapping
            if header[DIGEST] != _digest(arrays, header[NOTES]):
                msg = "it was changed since it was written"
                raise ValueError(msg)
    except (SafetensorError, KeyError, ValueError, OSError) as error:
        msg = f"checkpoint {path} cannot be read ({error}); delete it to train from the start"
        raise ArtifactError(msg) from error
    found = {name: notes.get(name) for name in identity}
    if found != identity:
        msg = f"checkpoint {path} is another run's: found {found}, expected {identity}; delete it to start afresh"
        raise ArtifactError(msg)
    return arrays, notes


def _digest(arrays: Mapping[str, NDArray[np.generic]], text: str) -> str:
    """Hash everything that a checkpoint says."""
    found = hashlib.sha256(text.encode())
    for name, array in sorted(arrays.items()):
        found.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    return found.hexdigest()


def under(prefix: str, arrays: Mapping[str, NDArray[np.generic]]) -> Arrays:
    """Return the arrays whose names begin with `prefix/`, without it."""
    return {name.removeprefix(f"{prefix}/"): array for name, array in arrays.items() if name.startswith(f"{prefix}/")}


def prefixed(prefix: str, arrays: Mapping[str, NDArray[np.generic]]) -> Arrays:
    """Put `prefix/` before every name."""
    return {f"{prefix}/{name}": array for name, array in arrays.items()}
