"""A synthesised program in a directory: text to read and edit, its tree, its controllers, and a manifest.

`program.txt` may be edited; the other files may not, and their hashes in the manifest say whether they were. Nothing
in the directory is ever executed or unpickled: JSON, UTF-8 text and safetensors only, each of bounded size, each a
regular file of the directory itself.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from roboscribe.defaults import CONTACT, TIMING
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import (
    Json,
    canonical_json,
    indented_json,
    package_versions,
    parse_json,
    sha256_of_bytes,
    write_files,
)

PROGRAM, TREE, CONTROLLERS, MANIFEST = "program.txt", "tree.json", "controllers.safetensors", "manifest.json"
VERSION = 1

Array: TypeAlias = NDArray[Any]
"""Weights of any floating-point or integer type; safetensors keeps it."""

_MOST_BYTES = {PROGRAM: 1 << 20, TREE: 1 << 25, CONTROLLERS: 1 << 30, MANIFEST: 1 << 23}
_REFUSED = {
    "pickles": (".pt", ".pth", ".pkl", ".pickle", ".ckpt", ".joblib", ".npy", ".npz", ".bin"),
    "YAML": (".yaml", ".yml"),
    "archives": (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".zst", ".7z"),
}
_STATED = {"task": str, "profile": str, "seed": int, "figures": dict}
"""What every manifest says about the run, and of which type."""
_OWN = frozenset({"schema_version", "packages", "controllers", "files", "digest"})
"""What `save_program` adds to a manifest."""
_NAME = re.compile(r"[^\W\d]\w*")
_WEIGHT = re.compile(r"[^\W\d]\w*(\.\w+)+")


@dataclass(frozen=True)
class SavedProgram:
    """A program with all that is needed to run it.

    Args:
        program_text: the program as it prints.
        tree: its subtask tree.
        weights: arrays by flat name, the controller's name first: "hold.actor.0.weight".
        controllers: specification by controller name.
        manifest: task, profile, seed, figures, and whatever else is worth keeping about the run.
        edited: whether `program.txt` was changed since it was saved; never stored.
    """

    program_text: str
    tree: Mapping[str, Json]
    weights: Mapping[str, Array]
    controllers: Mapping[str, Json]
    manifest: Mapping[str, Json]
    edited: bool = False

    @property
    def horizon(self) -> int | None:
        """Control steps of the episodes for which it was made; None where the manifest does not say, as older ones."""
        return int(str(self.manifest["horizon"])) if "horizon" in self.manifest else None

    @property
    def contact(self) -> str:
        """Contact model under which it was made; the usual one where the manifest does not say."""
        return str(self.manifest.get("contact", CONTACT))

    @property
    def timing(self) -> str:
        """Simulator timing under which it was made; the usual one where the manifest does not say."""
        return str(self.manifest.get("timing", TIMING))


def save_program(directory: Path, program: SavedProgram) -> None:
    """Write a program's four files, the controllers first and the manifest last.

    Other files of the directory are left alone. Whoever is killed in the middle leaves every single file whole; where
    old and new ones are mixed, `load_program` refuses the directory until it is saved again.

    Args:
        directory: target; made if it does not exist.
        program: what to save.

    Raises:
        ArtifactError: a name, weight or manifest entry that could not be loaded again, or the system refused.
    """
    _check_names(directory, program.controllers, program.weights)
    _check_manifest(directory, program.manifest)
    files = {
        CONTROLLERS: _packed(directory / CONTROLLERS, program.weights),
        TREE: _spelled(directory / TREE, program.tree),
        PROGRAM: program.program_text.encode(),
    }
    manifest: dict[str, Json] = {
        **{key: value for key, value in program.manifest.items() if key not in _OWN},
        "schema_version": VERSION,
        "packages": package_versions(("numpy", "torch", "mujoco", "safetensors")),
        "controllers": program.controllers,
        "files": {name: sha256_of_bytes(data) for name, data in files.items()},
    }
    _spelled(directory / MANIFEST, manifest)  # a digest needs what JSON can spell
    files[MANIFEST] = _spelled(directory / MANIFEST, {**manifest, "digest": _digest(manifest)})
    for name, data in files.items():
        _check_size(directory / name, len(data))
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        _refuse(directory, f"cannot be made a directory ({error.strerror})", "a directory")
    write_files({directory / name: data for name, data in files.items()})


def load_program(directory: Path) -> SavedProgram:
    """Read a program's four files, trusting none of them.

    Args:
        directory: what `save_program` wrote, or a copy whose `program.txt` was edited.

    Raises:
        ArtifactError: a file that is missing, damaged, too large, a link, or of a refused kind.
    """
    _check_directory(directory)
    manifest = _object(directory / MANIFEST)
    _check_own(directory / MANIFEST, manifest)
    hashes, controllers = manifest["files"], manifest["controllers"]
    assert isinstance(hashes, dict)
    assert isinstance(controllers, dict)
    data = {name: _bytes(directory / name) for name in (PROGRAM, TREE, CONTROLLERS)}
    for name in (TREE, CONTROLLERS):
        if sha256_of_bytes(data[name]) != hashes[name]:
            _refuse(directory / name, "was changed since the program was saved", f"SHA-256 {hashes[name]}")
    weights = _weights(directory / CONTROLLERS, data[CONTROLLERS])
    _check_names(directory, controllers, weights)
    return SavedProgram(
        program_text=_text(directory / PROGRAM, data[PROGRAM]),
        tree=_parsed(directory / TREE, data[TREE]),
        weights=weights,
        controllers=controllers,
        manifest={key: value for key, value in manifest.items() if key not in _OWN},
        edited=sha256_of_bytes(data[PROGRAM]) != hashes[PROGRAM],
    )


def _check_directory(directory: Path) -> None:
    """Refuse what is no directory, and directories that hold files of a refused kind."""
    if not directory.is_dir():
        found = "is a file" if directory.exists() else "does not exist"
        _refuse(directory, found, f"a directory with {PROGRAM}, {TREE}, {CONTROLLERS} and {MANIFEST}")
    for path in sorted(directory.iterdir()):
        for kind, suffixes in _REFUSED.items():
            if path.suffix.lower() in suffixes:
                _refuse(path, f"{kind} are refused", "JSON, text and safetensors only")


def _bytes(path: Path) -> bytes:
    """Read a file of bounded size that is a regular file and no link."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        _refuse(path, "is a link" if path.is_symlink() else f"cannot be read ({error.strerror})", "a regular file")
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            _refuse(path, "is no regular file", "a regular file")
        _check_size(path, status.st_size)
        with os.fdopen(descriptor, "rb", closefd=False) as stream:
            return stream.read(_MOST_BYTES[path.name])
    finally:
        os.close(descriptor)


def _check_size(path: Path, size: int) -> None:
    """Refuse a file beyond its limit."""
    if size > _MOST_BYTES[path.name]:
        _refuse(path, f"has {size} bytes", f"at most {_MOST_BYTES[path.name]}")


def _text(path: Path, data: bytes) -> str:
    """Decode UTF-8."""
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        _refuse(path, f"is no text (byte {error.start})", "UTF-8")


def _parsed(path: Path, data: bytes) -> dict[str, Json]:
    """Parse a JSON object."""
    try:
        value = parse_json(_text(path, data))
    except ValueError as error:
        _refuse(path, f"is no JSON ({error})", "one JSON object")
    if not isinstance(value, dict):
        _refuse(path, f"holds a JSON {type(value).__name__}", "one JSON object")
    return value


def _object(path: Path) -> dict[str, Json]:
    """Read a JSON object from a file."""
    return _parsed(path, _bytes(path))


def _spelled(path: Path, value: Mapping[str, Json]) -> bytes:
    """Spell a JSON object as bytes."""
    try:
        return indented_json(value).encode()
    except (ValueError, TypeError) as error:
        _refuse(path, f"cannot be written as JSON ({error})", "finite numbers, text, lists and objects")


def _packed(path: Path, weights: Mapping[str, Array]) -> bytes:
    """Put arrays into safetensors; whatever their order in memory, they are stored row by row."""
    for name, array in weights.items():
        if array.dtype.kind not in "fiub":
            _refuse(path, f"weight {name} is of type {array.dtype}", "numbers")
    return safetensors.save({name: np.array(array, order="C") for name, array in weights.items()})


def _weights(path: Path, data: bytes) -> dict[str, Array]:
    """Parse safetensors."""
    try:
        return safetensors.load(data)
    except (SafetensorError, KeyError, ValueError, TypeError) as error:
        _refuse(path, f"is no safetensors file ({error})", "arrays in safetensors format")


def _check_own(path: Path, manifest: Mapping[str, Json]) -> None:
    """Refuse a manifest that lacks, or misstates, what `save_program` put into it."""
    version = manifest.get("schema_version")
    if version != VERSION:
        _refuse(path, f"has schema version {version}", str(VERSION))
    stated = manifest.get("digest")
    if stated != _digest({key: value for key, value in manifest.items() if key != "digest"}):
        _refuse(path, "was changed since the program was saved", f"SHA-256 {stated}")
    hashes = manifest.get("files")
    names = {PROGRAM, TREE, CONTROLLERS}
    if not isinstance(hashes, dict) or set(hashes) != names:
        found = sorted(hashes) if isinstance(hashes, dict) else hashes
        _refuse(path, f"lists the files {found}", ", ".join(sorted(names)))
    if not isinstance(manifest.get("controllers"), dict):
        _refuse(path, "has no controllers", "an object of specifications by name")
    _check_manifest(path, manifest)


def _check_manifest(path: Path, manifest: Mapping[str, Json]) -> None:
    """Refuse a manifest that does not say what was run."""
    for key, kind in _STATED.items():
        value = manifest.get(key)
        if not isinstance(value, kind) or isinstance(value, bool):
            _refuse(path, f"manifest entry {key} is {value!r}", f"a JSON {kind.__name__}")


def _check_names(path: Path, controllers: Mapping[str, Json], weights: Mapping[str, Array]) -> None:
    """Refuse names that are no identifiers, and weights of no controller."""
    for name in controllers:
        if not _NAME.fullmatch(name):
            _refuse(path, f"controller name {name!r}", "letters, digits and underscores")
    for name in weights:
        if not _WEIGHT.fullmatch(name) or name.split(".")[0] not in controllers:
            _refuse(path, f"weight {name!r}", f"a name that begins with one of {', '.join(controllers) or 'none'}")


def _digest(manifest: Mapping[str, Json]) -> str:
    """Hash a manifest without its own digest."""
    return sha256_of_bytes(canonical_json(manifest).encode())


def _refuse(path: Path, found: str, expected: str) -> NoReturn:
    """Raise the one error of this module."""
    msg = f"{path}: {found}; expected {expected}"
    raise ArtifactError(msg)
