"""Learned controllers as ONNX files beside a program, for robots on which no Python runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from roboscribe.dsl.interpreter import Controller
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.io.atomic import write_file
from roboscribe.rl.skill import Skill

FOLDER = "onnx"


def write_onnx(directory: Path, program: Program, library: Mapping[str, Controller]) -> tuple[Path, ...]:
    """Write every learned controller of a program to `onnx/NAME.onnx`; scripted ones have no weights to write.

    Args:
        directory: of the program.
        program: P; the first statement that runs a controller names its inputs.
        library: its controllers.

    Returns:
        The files.

    Raises:
        ArtifactError: the system refused.
    """
    runs = {run.controller: run for run in reversed(controllers(program))}
    skills = {name: skill for name in runs if isinstance(skill := library.get(name), Skill)}
    if not skills:
        return ()
    from roboscribe.rl.onnx_graph import skill_model

    folder = directory / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name, skill in skills.items():
        write_file(folder / f"{name}.onnx", skill_model(skill, runs[name]).SerializeToString(deterministic=True))
    return tuple(folder / f"{name}.onnx" for name in skills)


def copy_onnx(source: Path, target: Path) -> None:
    """Copy the ONNX files of a program to a copy of it.

    Raises:
        ArtifactError: the system refused.
    """
    for path in sorted((source / FOLDER).glob("*.onnx")):
        (target / FOLDER).mkdir(exist_ok=True)
        write_file(target / FOLDER / path.name, path.read_bytes())
