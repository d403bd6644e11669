"""Measure a saved program or baseline, untrained, in a task that may be another than the one it was made for."""

from __future__ import annotations

import shutil
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from roboscribe.defaults import EVALUATION_EPISODES
from roboscribe.io.saved_program import CONTROLLERS, MANIFEST, PROGRAM, TREE, load_program
from roboscribe.saved import open_saved
from roboscribe.stages.evaluate import record
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig

FILES = {"program": PROGRAM, "tree": TREE, "controllers": CONTROLLERS, "manifest": MANIFEST}
"""Names of a saved program's files by the names of the inputs."""


@dataclass(frozen=True)
class Config:
    """Which evaluation.

    Args:
        task: where.
        seed: decides the episodes.
        evaluation_episodes: how many.
    """

    task: TaskConfig
    seed: int = 0
    evaluation_episodes: int = EVALUATION_EPISODES


def inputs_of(directory: Path) -> dict[str, Path]:
    """Return a saved program's files as the stage takes them."""
    return {name: directory / file for name, file in FILES.items()}


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `outcome.json` and `episodes.json`.

    Inputs:
        program, tree, controllers, manifest: the files of a saved program.
    """
    task = config.task.make()
    with tempfile.TemporaryDirectory() as scratch:
        for name, file in FILES.items():  # a program is loaded from one directory, wherever its files lie here
            shutil.copyfile(inputs[name], Path(scratch) / file)
        program = open_saved(load_program(Path(scratch)), task, str(inputs["controllers"]))
    record(program, task, config.seed, config.evaluation_episodes, out, report)


STAGE = Stage("transfer", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
