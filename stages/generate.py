"""GENPROGRAM: from a subtask tree to a program."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.errors import Fail
from roboscribe.io.atomic import write_file
from roboscribe.program_gen import gen_program
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.files import PROGRAM, program_bytes, write_fail
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.serialization import read_tree
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig, load_evidence
from roboscribe.subtask_tree import ROOT


@dataclass(frozen=True)
class Config:
    """Which program.

    Args:
        task: what the demonstrations show.
        goal: name of the node that the program reaches.
        name: what the program is called.
    """

    task: TaskConfig
    goal: str = ROOT
    name: str = "P"


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `program.txt`, or why there is no program.

    Inputs:
        demonstrations: a Parquet file.
        tree: the subtask tree.
    """
    evidence = load_evidence(inputs["demonstrations"], config.task)
    program = gen_program(config.goal, evidence, read_tree(inputs["tree"]), config.name)
    if isinstance(program, Fail):
        write_fail(out, program)
    else:
        write_file(out / PROGRAM, program_bytes(program))


STAGE = Stage("generate", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
