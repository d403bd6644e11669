"""The store of finished stages: what has been computed once from the same inputs is not computed again.

A stage's outputs lie in `<root>/<stage>/<key>/`. The key hashes the stage's settings, the contents of its inputs and
the code that it depends on; `manifest.json`, written last, lists the outputs with their hashes and is the only proof
that the stage finished. A directory without one belongs to a stage that was interrupted, which goes on from what it
left in `progress/`; outputs that no longer have their hashes are computed again. One process at a time works in a
directory, the others wait for it and then find the work done.
"""

from __future__ import annotations

import hashlib
import logging
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Generic, Protocol, TypeAlias, TypeVar, runtime_checkable

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import (
    Json,
    canonical_json,
    indented_json,
    parse_json,
    remove_unfinished,
    sha256_of,
    sha256_of_bytes,
    write_file,
)
from roboscribe.io.lock import held
from roboscribe.stages.runtime.code_version import code_version
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress

Config = TypeVar("Config")
Inputs: TypeAlias = Mapping[str, Path]
Digests: TypeAlias = Mapping[str, str]

MANIFEST = "manifest.json"
PROGRESS = "progress"
"""Directory in a stage's outputs for what an interrupted run goes on from; removed once the stage is finished."""
METRICS, TIMING = "metrics.jsonl", "timing.json"
VOLATILE = (MANIFEST, METRICS, TIMING)
"""Files that tell when, not what: no part of the outputs' identity."""
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Stage(Generic[Config]):
    """One step of the pipeline.

    Args:
        name: its name, and that of its module in `stages`.
        config: its frozen settings.
        run: reads the inputs, calls the library, writes files below the output directory.
    """

    name: str
    config: type[Config]
    run: Callable[[Config, Inputs, Path, ProgressCallback], None]


@runtime_checkable
class HasCode(Protocol):
    """A setting that names code, a task for instance: a stage's result depends on that code, too."""

    def code(self) -> str:
        """Return the version of the code."""


AnyStage: TypeAlias = Stage[Any]
"""A stage where it does not matter which."""


class Store:
    """Outputs of stages by what they were made from."""

    def __init__(self, root: Path) -> None:
        """Use `root`, which is made when the first stage runs."""
        self.root = root
        self._known: dict[str, Path] = {}

    def run(
        self, stage: Stage[Config], config: Config, inputs: Inputs, report: ProgressCallback = ignore_progress
    ) -> Path:
        """Run a stage, or find that it has been run.

        Args:
            stage: what to run.
            config: its settings.
            inputs: files by name.
            report: told how far the stage is.

        Returns:
            Directory of the outputs.

        Raises:
            ArtifactError: an input cannot be read.
        """
        digests = {name: _digest(path) for name, path in inputs.items()}
        identity = _identity(stage, config, digests)
        out = self.root / stage.name / identity["key"]
        out.mkdir(parents=True, exist_ok=True)
        with locked(out):
            if not _is_finished(out, identity["key"]):
                _remove_leftovers(out)
                start = perf_counter()
                stage.run(config, inputs, out, report)
                _write_manifest(out, {**identity, "config": encode(config), "inputs": digests}, perf_counter() - start)
            shutil.rmtree(out / PROGRESS, ignore_errors=True)
        self._known.update({digest: out / name for name, digest in _outputs(out).items()})
        return out

    def put(self, name: str, data: bytes) -> Path:
        """Return a file with these bytes: the output of a stage that has them, or one written for the purpose."""
        digest = sha256_of_bytes(data)
        known = self._known.get(digest)
        if known is None or not known.is_file():
            directory = self.root / "values" / digest
            directory.mkdir(parents=True, exist_ok=True)
            known = self._known[digest] = directory / name
            if not known.is_file() or sha256_of(known) != digest:
                write_file(known, data)
        return known


def read_manifest(out: Path) -> Mapping[str, Json] | None:
    """Read the manifest of a stage's outputs; None where there is none that can be read."""
    try:
        value = parse_json((out / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return value if isinstance(value, Mapping) else None


@contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold a directory for this process alone; wait while another one has it."""

    def say() -> None:
        log.warning("another process is at work in %s; waiting for it", directory)

    with held(directory, say):
        yield


def _identity(stage: AnyStage, config: object, digests: Digests) -> dict[str, str]:
    """Return the stage's name, its code's version, and the key that they, settings and inputs make."""
    code = code_version(stage.run.__module__)
    named = [part.code() for part in vars(config).values() if isinstance(part, HasCode)]
    parts = {"stage": stage.name, "config": encode(config), "inputs": digests, "code": code, "named": named}
    text = canonical_json(parts)
    return {"stage": stage.name, "code": code, "key": hashlib.sha256(text.encode()).hexdigest()}


def _digest(path: Path) -> str:
    """Hash an input."""
    try:
        return sha256_of(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror}), expected an input of a stage"
        raise ArtifactError(msg) from error


def _outputs(out: Path) -> dict[str, str]:
    """Return the outputs that the manifest lists, with their hashes."""
    listed = (read_manifest(out) or {}).get("outputs")
    return {str(name): str(digest) for name, digest in listed.items()} if isinstance(listed, Mapping) else {}


def _is_finished(out: Path, key: str) -> bool:
    """Whether a stage's outputs are there and undamaged."""
    manifest = read_manifest(out)
    if manifest is None or manifest.get("key") != key:
        return False
    damaged = [name for name, digest in _outputs(out).items() if not _has_digest(out / name, digest)]
    if damaged:
        log.warning("%s: %s changed since it was written; computing it again", out, ", ".join(damaged))
    return not damaged


def _has_digest(path: Path, digest: str) -> bool:
    return path.is_file() and not path.is_symlink() and sha256_of(path) == digest


def _remove_leftovers(out: Path) -> None:
    """Remove unfinished outputs of an interrupted stage, but not its checkpoints in `progress/`."""
    (out / MANIFEST).unlink(missing_ok=True)
    remove_unfinished(out)
    for path in sorted(out.iterdir()):
        if path.is_dir() and not path.is_symlink():
            if path.name != PROGRESS:
                shutil.rmtree(path)
        elif path.name != METRICS:
            path.unlink()


def _write_manifest(out: Path, manifest: Mapping[str, Json], seconds: float) -> None:
    """Write the manifest, which proves that the stage finished."""
    files = [path for path in sorted(out.rglob("*")) if path.is_file()]
    names = [path.relative_to(out).as_posix() for path in files]
    kept = [name for name in names if name not in VOLATILE and not name.startswith(f"{PROGRESS}/")]
    outputs = {name: sha256_of(out / name) for name in kept}
    write_file(out / TIMING, indented_json({"wall_seconds": round(seconds, 3)}).encode())
    write_file(out / MANIFEST, indented_json({**manifest, "outputs": outputs}).encode())
