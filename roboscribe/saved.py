"""Whatever was saved, ready to run: a program with its controllers, or a baseline."""

from __future__ import annotations

from collections.abc import Mapping

from roboscribe.dsl.interpreter import Controller
from roboscribe.dsl.parser import parse_program
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import SavedProgram
from roboscribe.runnable import Runnable, runnable
from roboscribe.world import Task

KIND = "kind"
BASELINE = "baseline"
"""What the manifest of a baseline has under `KIND`; that of a program has nothing there."""


def open_saved(saved: SavedProgram, task: Task, where: str) -> Runnable:
    """Make what was saved ready to run on a task.

    Raises:
        ArtifactError: its controllers or limits cannot be used, or not on this task.
        ProgramError: its text, edited perhaps, is no program.
    """
    if saved.manifest.get(KIND) != BASELINE:
        return runnable(saved, task, where)
    library = {name: _policy(saved, name, about, task, where) for name, about in saved.controllers.items()}
    return Runnable(parse_program(saved.program_text), library, {})


def _policy(saved: SavedProgram, name: str, about: Json, task: Task, where: str) -> Controller:
    """Read a baseline's network."""
    from roboscribe.baselines.policy import from_parts

    if not isinstance(about, Mapping) or about.get("outputs") != task.action_size:
        found = about.get("outputs") if isinstance(about, Mapping) else about
        msg = f"{where}: baseline {name} gives {found} numbers, actions of {task.name} have {task.action_size}"
        raise ArtifactError(msg)
    own = {key.removeprefix(f"{name}."): part for key, part in saved.weights.items() if key.startswith(f"{name}.")}
    return from_parts(about, own, task.layout)
