"""Programs with their controllers, ready to run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from roboscribe.controllers import from_parts
from roboscribe.defaults import CONFIRM
from roboscribe.dsl.interpreter import Controller
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.syntax import Program
from roboscribe.errors import ArtifactError
from roboscribe.io.saved_program import SavedProgram
from roboscribe.world.task import Task


@dataclass(frozen=True)
class Runnable:
    """A program that can run.

    Args:
        program: P.
        library: its controllers.
        limits: step limit by controller.
        confirm: consecutive steps for which a subgoal must hold.
    """

    program: Program
    library: Mapping[str, Controller]
    limits: Mapping[str, int]
    confirm: int = CONFIRM


def runnable(saved: SavedProgram, task: Task, where: str) -> Runnable:
    """Make a saved program ready to run on a task.

    Raises:
        ArtifactError: its controllers or limits cannot be used.
        ProgramError: its text, edited perhaps, is no program.
    """
    limits: Any = saved.manifest.get("limits", {})
    confirm = saved.manifest.get("confirm", CONFIRM)
    sound = isinstance(limits, Mapping) and all(isinstance(steps, int) for steps in limits.values())
    if not sound or not isinstance(confirm, int):
        msg = f"{where}: found limits {limits!r} and confirm {confirm!r}, expected steps by controller and a count"
        raise ArtifactError(msg)
    library = from_parts(saved.controllers, saved.weights, task, where)
    return Runnable(parse_program(saved.program_text), library, limits, confirm)
