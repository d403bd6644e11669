"""Put a finished program, its tree, controllers and figures into one directory that can be loaded, edited and run."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.defaults import CONFIRM
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import save_program
from roboscribe.onnx_controllers import write_onnx
from roboscribe.programs import saved_form
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.controller_files import read_library
from roboscribe.stages.runtime.files import read_json, read_program
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.serialization import read_tree
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig

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
        command: command line that makes it.
    """

    task: TaskConfig
    profile: str
    seed: int
    confirm: int = CONFIRM
    demonstrations: str = ""
    command: str = ""


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write the directory `program/`, with the controllers as ONNX files, too.

    Inputs:
        program, tree: what was found.
        controllers, weights, limits: its library, as the training stage wrote it.
        outcome: figures of the evaluation.
    """
    task = config.task.make()
    library = read_library(inputs["controllers"], inputs["weights"], task)
    manifest: dict[str, Json] = {
        "task": config.task.name,
        "contact": config.task.contact,
        "timing": config.task.timing,
        "horizon": task.horizon,
        "profile": config.profile,
        "seed": config.seed,
        "confirm": config.confirm,
        "limits": read_json(inputs["limits"]),
        "demonstrations": config.demonstrations,
        "command": config.command,
        "figures": read_json(inputs["outcome"]),
    }
    program = read_program(inputs["program"])
    save_program(out / DIRECTORY, saved_form(program, read_tree(inputs["tree"]), library, manifest))
    write_onnx(out / DIRECTORY, program, library)


STAGE = Stage("package", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
