"""LEARNCLASSIFIER: compare demonstrations with failing rollouts to find a subgoal."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.classifier import learn_classifier
from roboscribe.errors import Fail
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.files import REFINEMENT, write_fail, write_json
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.serialization import read_failures, read_tree, refinement_to_json
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig, load_evidence


@dataclass(frozen=True)
class Config:
    """Which comparison.

    Args:
        task: what the demonstrations show.
        goal: name of the goal that was not reached.
    """

    task: TaskConfig
    goal: str


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `refinement.json` with the ranked table, or why nothing separates.

    Inputs:
        demonstrations: a Parquet file.
        tree: the subtask tree, `tree.json` of `update_tree`.
        failures: N_s, `failures.safetensors` of `roll_out`.
    """
    evidence = load_evidence(inputs["demonstrations"], config.task)
    failures = read_failures(inputs["failures"])
    refinement = learn_classifier(failures, evidence, read_tree(inputs["tree"]), config.goal)
    if isinstance(refinement, Fail):
        write_fail(out, refinement)
    else:
        write_json(out / REFINEMENT, refinement_to_json(refinement))


STAGE = Stage("classify", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
