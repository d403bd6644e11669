"""Programs that are shipped with the package, how programs are named, and what is saved of one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roboscribe.controllers import Library, to_parts
from roboscribe.dsl.printer import program_text
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.errors import ArtifactError, did_you_mean
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import MANIFEST, SavedProgram, load_program
from roboscribe.io.tracked import is_run_id, tracked_program, usual_mlruns
from roboscribe.subtask_tree import Tree
from roboscribe.tree_json import tree_to_json

TRAINED = Path(__file__).resolve().parent / "trained"
"""Where the programs lie that are shipped with the package, each in a directory of its task's name."""
IN_FILE = re.compile(r".*\.py:")
"""What comes before the name of a task that lies in a file of its own."""


def shipped_names() -> tuple[str, ...]:
    """List the shipped programs."""
    return tuple(sorted(path.parent.name for path in TRAINED.glob(f"*/{MANIFEST}")))


@dataclass(frozen=True)
class Shipped:
    """What is known about a shipped program.

    Args:
        name: by which commands find it.
        manifest: what its manifest says about the run.
        size: bytes of its files.
    """

    name: str
    manifest: Mapping[str, Any]
    size: int


def shipped_programs() -> tuple[Shipped, ...]:
    """Read the manifests of the shipped programs.

    Raises:
        ArtifactError: the files of one are damaged.
    """
    return tuple(_shipped(name) for name in shipped_names())


def _shipped(name: str) -> Shipped:
    directory = TRAINED / name
    return Shipped(name, load_program(directory).manifest, sum(path.stat().st_size for path in directory.iterdir()))


def find_program(name: str | Path, *also: str) -> Path:
    """Find a program: a directory, or a shipped program; they are tried in this order.

    Args:
        name: a path, or the name of a shipped program.
        also: what else is expected where nothing is found, for the message.

    Raises:
        ArtifactError: it is none of them.
    """
    if Path(name).exists():
        return Path(name)
    if str(name) in shipped_names():
        return TRAINED / name
    shipped = f"a shipped program ({', '.join(shipped_names()) or 'there are none'})"
    expected = " or ".join((", ".join(("a program's directory", *also)), shipped))
    msg = f"program {name}: does not exist; {did_you_mean(str(name), shipped_names())}expected {expected}"
    raise ArtifactError(msg)


@contextmanager
def program_directory(name: str | Path, mlruns: Path | None = None) -> Iterator[Path]:
    """Find a program: a directory, an MLflow run's program, copied to a temporary directory, or a shipped program.

    Args:
        name: a path, an MLflow run id, or the name of a shipped program; they are tried in this order.
        mlruns: directory of the tracking store; None is `mlruns` where `ROBOSCRIBE_HOME` says, or here.

    Raises:
        ArtifactError: it is none of them.
    """
    if is_run_id(name):
        with tracked_program(str(name), usual_mlruns() if mlruns is None else mlruns) as found:
            yield found
    else:
        yield find_program(name, "an MLflow run id")


def program_name(task: str) -> str:
    """Name a program after its task: "pick-place-1" gives "PickPlace1", "path/to/task.py:Push" gives "Push"."""
    words = re.findall(r"[^\W_]+", IN_FILE.sub("", task))
    return "".join(word[:1].upper() + word[1:] for word in words) or "P"


def saved_form(program: Program, tree: Tree, library: Library, manifest: Mapping[str, Json]) -> SavedProgram:
    """Return what is saved of a program: of its library only what it uses."""
    used = {run.controller for run in controllers(program)}
    descriptions, weights = to_parts({name: skill for name, skill in library.items() if name in used})
    return SavedProgram(program_text(program), tree_to_json(tree), weights, descriptions, manifest)
