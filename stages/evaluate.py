"""Evaluate a finished program on episodes of its own, with a confidence interval."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.io.atomic import Json
from roboscribe.steps import wilson
from roboscribe.world.task import Task
from stages import alone
from stages.files import EPISODES, OUTCOME, read_json, read_program, write_json
from stages.grounded import Grounded, episode_table, summary, waves
from stages.progress import Report, silent
from stages.skills import read_library
from stages.store import Inputs, Stage
from stages.world import TaskConfig, episode_seeds

PURPOSE = "evaluate"
"""What the seeds of evaluation episodes are drawn for, see `episode_seeds`."""


@dataclass(frozen=True)
class Config:
    """Which evaluation.

    Args:
        task: where.
        seed: decides the episodes.
        episodes: how many.
        confirm: consecutive steps for which a subgoal must hold to count as reached.
    """

    task: TaskConfig
    seed: int = 0
    episodes: int = 500
    confirm: int = 3


def measure(
    grounded: Grounded, task: Task, seed: int, episodes: int, report: Report = silent
) -> tuple[dict[str, Json], dict[str, Json]]:
    """Run a program on the evaluation episodes of a seed.

    Returns:
        Figures (success, its interval, counts) and the table of episodes.
    """
    seeds = episode_seeds(seed, PURPOSE, episodes)
    done = list(waves(grounded, task, seeds, report=report))
    counts = summary(done)
    won = sum(int(rollouts.success.sum()) for rollouts in done)
    low, high = wilson(won, episodes)
    figures: dict[str, Json] = {**counts, "success": won / episodes, "ci_low": round(low, 6), "ci_high": round(high, 6)}
    return figures, episode_table(done, seeds)


def record(grounded: Grounded, task: Task, seed: int, episodes: int, out: Path, report: Report = silent) -> None:
    """Run a program as `measure` does; write its figures as `outcome.json`, its episodes as `episodes.json`."""
    figures, table = measure(grounded, task, seed, episodes, report)
    write_json(out / EPISODES, table)
    write_json(out / OUTCOME, figures)


def run(config: Config, inputs: Inputs, out: Path, report: Report = silent) -> None:
    """Write `outcome.json` and `episodes.json`.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    library = read_library(inputs["controllers"], inputs["weights"], task)
    grounded = Grounded(read_program(inputs["program"]), library, read_json(inputs["limits"]), config.confirm)
    record(grounded, task, config.seed, config.episodes, out, report)


STAGE = Stage("evaluate", Config, run)

if __name__ == "__main__":
    sys.exit(alone.main(STAGE))
