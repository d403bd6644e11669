"""A saved program, adapted to demonstrations of another order without any control step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from roboscribe.adapt import Adapted, adapt
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import text
from roboscribe.dsl.types import check_program
from roboscribe.errors import ArtifactError, DemonstrationError, Fail, ProgramError
from roboscribe.evidence import Evidence
from roboscribe.io.atomic import Json
from roboscribe.io.demonstrations import read_demonstrations, task_of
from roboscribe.io.saved_program import SavedProgram, load_program, save_program
from stages.world import TaskConfig


@dataclass(frozen=True)
class Adaptation:
    """A program that was adapted.

    Args:
        saved: the program with all that is needed to run it.
        adapted: its new guards.
        task: that the demonstrations show.
    """

    saved: SavedProgram
    adapted: Adapted
    task: str


def adapt_saved(directory: Path, demonstrations: Path, task: str | None = None) -> Adaptation | Fail:
    """Learn the guards of a saved program again.

    Args:
        directory: of the program; it is only read.
        demonstrations: Parquet file.
        task: that they show; left out: what the file says.

    Returns:
        The program with new guards, without figures, since it was not measured; Fail where no guard explains the
        demonstrations.

    Raises:
        ArtifactError: the program's files are damaged.
        ProgramError: its text is no program.
        DemonstrationError: the file is damaged, or shows other objects than the program speaks of.
    """
    saved = load_program(directory)
    program = parse_program(saved.program_text)
    where = TaskConfig(task_of(demonstrations) if task is None else task)
    shown = where.make()
    try:
        check_program(program, shown.layout)
    except ProgramError as error:
        msg = f"{demonstrations}: shows {', '.join(shown.layout.names)}, which the program does not fit ({error})"
        raise DemonstrationError(msg) from error
    read = read_demonstrations(demonstrations, shown)
    adapted = adapt(program, Evidence.of(read.trajectories, shown.solved))
    if isinstance(adapted, Fail):
        return adapted
    origin: dict[str, Json] = {
        "program": saved.program_text,
        "task": saved.manifest["task"],
        "seed": saved.manifest["seed"],
    }
    stated: dict[str, Json] = {
        "task": where.name,
        "demonstrations": read.digest,
        "figures": {},
        "adapted_from": origin,
        "command": "",
    }
    new = replace(saved, program_text=text(adapted.program), manifest={**saved.manifest, **stated}, edited=False)
    return Adaptation(new, adapted, where.name)


def save(adaptation: Adaptation, directory: Path, original: Path) -> None:
    """Write an adapted program.

    Raises:
        ArtifactError: it would overwrite the original.
    """
    if directory.exists() and directory.resolve() == original.resolve():
        msg = f"{directory}: is the program that is adapted; expected another directory"
        raise ArtifactError(msg)
    save_program(directory, adaptation.saved)
