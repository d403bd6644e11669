"""VALIDATE: check every edge of a subtask tree against the demonstrations."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.files import write_fail, write_json
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.serialization import read_tree
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig, load_evidence
from roboscribe.subtask_tree import validate


@dataclass(frozen=True)
class Config:
    """What the demonstrations show."""

    task: TaskConfig


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `valid.json`, or why the tree cannot be right.

    Inputs:
        demonstrations: a Parquet file.
        tree: the subtask tree.
    """
    evidence = load_evidence(inputs["demonstrations"], config.task)
    tree = read_tree(inputs["tree"])
    invalid = validate(tree, lambda phi, psi: evidence.edge_steps(tree, phi, psi))
    if invalid is not None:
        write_fail(out, invalid)
    else:
        write_json(out / "valid.json", {"edges": len(tree.edges)})


STAGE = Stage("validate", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
