"""Evaluate a finished program on episodes of its own, with a confidence interval."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.defaults import CONFIRM, EVALUATION_EPISODES
from roboscribe.evaluation import measure
from roboscribe.runnable import Runnable
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.controller_files import read_runnable
from roboscribe.stages.runtime.files import EPISODES, OUTCOME, write_json
from roboscribe.stages.runtime.progress import ProgressCallback, episode_progress, ignore_progress
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.subtask_tree import ROOT
from roboscribe.world.task import Task


@dataclass(frozen=True)
class Config:
    """Which evaluation.

    Args:
        task: where.
        seed: decides the episodes.
        evaluation_episodes: how many.
        confirm: consecutive steps for which a subgoal must hold to count as reached.
    """

    task: TaskConfig
    seed: int = 0
    evaluation_episodes: int = EVALUATION_EPISODES
    confirm: int = CONFIRM


def record(
    program: Runnable, task: Task, seed: int, count: int, out: Path, report: ProgressCallback = ignore_progress
) -> None:
    """Evaluate a program; write its figures as `outcome.json`, its episodes as `episodes.json`."""
    evaluation = measure(program, task, seed, count, episode_progress(f"roll out {ROOT}", count, report))
    write_json(out / EPISODES, evaluation.table)
    write_json(out / OUTCOME, evaluation.figures)


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `outcome.json` and `episodes.json`.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    program = read_runnable(inputs, task, config.confirm)
    record(program, task, config.seed, config.evaluation_episodes, out, report)


STAGE = Stage("evaluate", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
