"""Checkpoints of learners: one safetensors file with the arrays, and JSON in its header. Nothing is unpickled."""

from __future__ import annotations

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
NOTES = "notes"
"""Header key of the JSON text."""


def write_checkpoint(path: Path, arrays: Mapping[str, NDArray[np.generic]], notes: Mapping[str, object]) -> None:
    """Write arrays and JSON values as one file that is either the old or the new one, never half of one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data = save({name: np.ascontiguousarray(array) for name, array in arrays.items()}, {NOTES: json.dumps(notes)})
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
            notes: dict[str, object] = json.loads((file.metadata() or {})[NOTES])
            arrays: Arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no mapping
    except (SafetensorError, KeyError, ValueError, OSError) as error:
        msg = f"checkpoint {path} cannot be read ({error}); delete it to train from the start"
        raise ArtifactError(msg) from error
    found = {name: notes.get(name) for name in identity}
    if found != identity:
        msg = f"checkpoint {path} is another run's: found {found}, expected {identity}; delete it to start afresh"
        raise ArtifactError(msg)
    return arrays, notes


def under(prefix: str, arrays: Mapping[str, NDArray[np.generic]]) -> Arrays:
    """Return the arrays whose names begin with `prefix/`, without it."""
    return {name.removeprefix(f"{prefix}/"): array for name, array in arrays.items() if name.startswith(f"{prefix}/")}


def prefixed(prefix: str, arrays: Mapping[str, NDArray[np.generic]]) -> Arrays:
    """Put `prefix/` before every name."""
    return {f"{prefix}/{name}": array for name, array in arrays.items()}
