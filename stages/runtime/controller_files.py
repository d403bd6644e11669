"""Libraries of controllers on disk: what each sees in JSON, its weights in safetensors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from roboscribe.controllers import Library, Scripted, from_parts, to_parts
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import write_file
from roboscribe.rl.skill import Skill
from roboscribe.runnable import Runnable
from roboscribe.stages.runtime.files import read_json, read_program, write_json
from roboscribe.world.task import Task

DESCRIPTIONS, WEIGHTS = "controllers.json", "controllers.safetensors"


def write_library(out: Path, library: Library) -> None:
    """Write a library's two files."""
    descriptions, weights = to_parts(library)
    write_file(out / WEIGHTS, safetensors.save({name: np.ascontiguousarray(a) for name, a in weights.items()}))
    write_json(out / DESCRIPTIONS, descriptions)


def read_library(descriptions: Path, weights: Path, task: Task) -> dict[str, Skill | Scripted]:
    """Read a library's two files.

    Raises:
        ArtifactError: one of them is damaged, or they do not fit the task.
    """
    try:
        arrays = safetensors.load_file(weights)
    except (OSError, SafetensorError) as error:
        msg = f"{weights}: cannot be read as safetensors ({error})"
        raise ArtifactError(msg) from error
    return from_parts(read_json(descriptions), arrays, task, str(weights))


def read_runnable(inputs: Mapping[str, Path], task: Task, confirm: int) -> Runnable:
    """Read a program with its controllers and step limits, as the training stage wrote them.

    Args:
        inputs: files by name: `program`, `controllers`, `weights` and `limits`.
        task: where it is to run.
        confirm: consecutive steps for which a subgoal must hold to count as reached.

    Raises:
        ArtifactError: a file is damaged, or does not fit the task.
        ProgramError: the text is no program.
    """
    library = read_library(inputs["controllers"], inputs["weights"], task)
    return Runnable(read_program(inputs["program"]), library, read_json(inputs["limits"]), confirm)
