"""Put a finished program, its tree, controllers and figures into one directory that can be loaded, edited and run."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roboscribe.dsl.parser import parse_program
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import SavedProgram, save_program
from roboscribe.world.protocols import Task
from stages import alone
from stages.progress import Report, silent
from stages.roll_out import Grounded
from stages.skills import from_parts, read_library, to_parts
from stages.store import Inputs, Stage
from stages.values import read_json, read_program, read_tree, tree_to_json
from stages.world import TaskConfig

DIRECTORY = "program"


@dataclass(frozen=True)
class Config:
    """What is said about the run.

    Args:
        task: for which it was made.
        profile: how it was learned.
        seed: that decided it.
        confirm: consecutive steps for which a subgoal must hold to count as reached.
        demonstrations: SHA-256 of the demonstrations.
    """

    task: TaskConfig
    profile: str
    seed: int
    confirm: int = 3
    demonstrations: str = ""


def run(config: Config, inputs: Inputs, out: Path, report: Report = silent) -> None:
    """Write the directory `program/`.

    Inputs:
        program, tree: what was found.
        controllers, weights, limits: its library, as the training stage wrote it.
        outcome: figures of the evaluation.
    """
    task = config.task.make()
    library = read_library(inputs["controllers"], inputs["weights"], task)
    descriptions, weights = to_parts(library)
    read_program(inputs["program"])
    manifest: dict[str, Json] = {
        "task": config.task.name,
        "contact": config.task.contact,
        "timing": config.task.timing,
        "profile": config.profile,
        "seed": config.seed,
        "confirm": config.confirm,
        "limits": read_json(inputs["limits"]),
        "demonstrations": config.demonstrations,
        "figures": read_json(inputs["outcome"]),
    }
    tree = tree_to_json(read_tree(inputs["tree"]))
    saved = SavedProgram(inputs["program"].read_text(), tree, weights, descriptions, manifest)
    save_program(out / DIRECTORY, saved)


def grounded(saved: SavedProgram, task: Task, where: str) -> Grounded:
    """Make a saved program ready to run on a task.

    Raises:
        ArtifactError: its controllers or limits cannot be used.
        ProgramError: its text, edited perhaps, is no program.
    """
    limits: Any = saved.manifest.get("limits", {})
    confirm = saved.manifest.get("confirm", 3)
    sound = isinstance(limits, Mapping) and all(isinstance(steps, int) for steps in limits.values())
    if not sound or not isinstance(confirm, int):
        msg = f"{where}: found limits {limits!r} and confirm {confirm!r}, expected steps by controller and a count"
        raise ArtifactError(msg)
    library = from_parts(saved.controllers, saved.weights, task, where)
    return Grounded(parse_program(saved.program_text), library, limits, confirm)


STAGE = Stage("package", Config, run)

if __name__ == "__main__":
    sys.exit(alone.main(STAGE))
