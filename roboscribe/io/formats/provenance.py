"""A small file beside exported demonstrations: where they come from, and the SHA-256 of what was written.

None of the formats guards all of its bytes, and none has a place for what made the demonstrations. A directory holds
`roboscribe.json`; a single file `demos.csv` has `demos.csv.roboscribe.json` beside it. Other programs ignore it, and
without it a file is read all the same, with a remark that nothing guards it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import Json, canonical_json, indented_json, parse_json, sha256_of, sha256_of_bytes, write_file
from roboscribe.io.episodes import Header

_NAME = "roboscribe.json"


@dataclass(frozen=True)
class Provenance:
    """Where exported demonstrations come from.

    Args:
        task: name of the task they show.
        frequency: frames per second.
        generator: what made them.
        seed: the generator's seed; None where it has none.
    """

    task: str
    frequency: float
    generator: str
    seed: int | None


def place_of(path: Path) -> Path:
    """Return where the provenance of a file or directory lies."""
    return path / _NAME if path.is_dir() else path.with_name(f"{path.name}.{_NAME}")


def write_provenance(path: Path, header: Header) -> None:
    """Record where what lies at `path` comes from, and the digests of its files."""
    files = _files(path)
    stated: dict[str, Json] = {
        "task": header.task_name, "frequency": header.frequency, "generator": header.generator, "seed": header.seed,
        "files": {str(file.relative_to(_root(path))): sha256_of(file) for file in files},
    }  # fmt: skip
    digest = sha256_of_bytes(canonical_json(stated).encode())
    write_file(place_of(path), indented_json({"stated": stated, "sha256": digest}).encode())


def read_provenance(path: Path) -> Provenance | None:
    """Read where demonstrations come from, and compare every file with its digest; None where nothing is recorded.

    Raises:
        DemonstrationError: the record cannot be read, or a file has changed since it was written.
    """
    place = place_of(path)
    if not place.is_file():
        return None
    stated = _stated(place)
    files = stated["files"]
    for name, digest in files.items() if isinstance(files, dict) else ():
        file = _root(path) / name
        if not file.is_file() or sha256_of(file) != digest:
            change = "is missing" if not file.is_file() else "has changed"
            msg = (
                f"{file}: {change} since it was written; restore it, or remove {place} to read what is there unguarded"
            )
            raise DemonstrationError(msg)
    seed = stated["seed"]
    return Provenance(
        str(stated["task"]),
        float(str(stated["frequency"])),
        str(stated["generator"]),
        seed if isinstance(seed, int) else None,
    )


def _stated(place: Path) -> dict[str, Json]:
    """Read the record, which guards itself."""
    try:
        whole = parse_json(place.read_text(encoding="utf-8"))
        stated = whole["stated"] if isinstance(whole, dict) else None
        intact = isinstance(whole, dict) and whole["sha256"] == sha256_of_bytes(canonical_json(stated).encode())
    except (OSError, ValueError, KeyError):
        intact = False
    if not intact or not isinstance(stated, dict):
        msg = f"{place}: damaged; restore it, or remove it to read what lies beside it unguarded"
        raise DemonstrationError(msg)
    return stated


def _root(path: Path) -> Path:
    """Return the directory from which files are named."""
    return path if path.is_dir() else path.parent


def _files(path: Path) -> list[Path]:
    """List the files that belong to what was written."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.rglob("*") if file.is_file() and file.name != _NAME)
