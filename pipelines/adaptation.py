"""A saved program, adapted to demonstrations of another order without any control step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from roboscribe.adapt import adapt
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import pretty
from roboscribe.dsl.syntax import Program
from roboscribe.dsl.types import check_program
from roboscribe.errors import ArtifactError, DemonstrationError, Fail, ProgramError
from roboscribe.evidence import Evidence
from roboscribe.io.atomic import Json
from roboscribe.io.demonstrations import read_demonstrations, task_of
from roboscribe.io.saved_program import SavedProgram, load_program, save_program
from roboscribe.onnx_controllers import copy_onnx
from roboscribe.stages.runtime.task_config import TaskConfig


@dataclass(frozen=True)
class Adaptation:
    """A program that was adapted.

    Args:
        saved: the program with all that is needed to run it.
        loops: old and new line of every loop over entities.
        task: that the demonstrations show.
    """

    saved: SavedProgram
    loops: tuple[tuple[str, str], ...]
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
    new = _changed(saved, adapted.program, where.name, read.digest)
    pairs = zip(loop_lines(pretty(program)), loop_lines(new.program_text), strict=True)
    return Adaptation(new, tuple(pairs), where.name)


def _changed(saved: SavedProgram, program: Program, task: str, digest: str) -> SavedProgram:
    """Return a saved program with another text, for another task, and where it comes from."""
    kept = ("task", "seed", "demonstrations")
    origin: dict[str, Json] = {entry: saved.manifest[entry] for entry in kept if entry in saved.manifest}
    origin["program"] = saved.program_text
    stated: dict[str, Json] = {"task": task, "demonstrations": digest, "figures": {}, "adapted_from": origin}
    return replace(saved, program_text=pretty(program), manifest={**saved.manifest, **stated}, edited=False)


def loop_lines(program: str) -> list[str]:
    """List the lines that begin loops over entities."""
    return [line.strip() for line in program.splitlines() if line.strip().startswith("while") and ":= get(" in line]


def save(adaptation: Adaptation, directory: Path, original: Path) -> None:
    """Write an adapted program.

    Raises:
        ArtifactError: it would overwrite the original.
    """
    if directory.exists() and directory.resolve() == original.resolve():
        msg = f"{directory}: is the program that is adapted; expected another directory"
        raise ArtifactError(msg)
    save_program(directory, adaptation.saved)
    copy_onnx(original, directory)
