"""Exec(M, P): run a program, count its successes and keep the states of its failures."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.defaults import CONFIRM, ROLLOUT_EPISODES
from roboscribe.evaluation import Endings, episode_table, summary, trial_seeds, try_program
from roboscribe.io.atomic import write_file
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.controller_files import read_runnable
from roboscribe.stages.runtime.files import EPISODES, FAILURES, OUTCOME, write_json
from roboscribe.stages.runtime.progress import ProgressCallback, episode_progress, ignore_progress
from roboscribe.stages.runtime.serialization import failures_bytes, lost_to_json
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.steps import Limits, Outcome
from roboscribe.subtask_tree import ROOT


@dataclass(frozen=True)
class Config:
    """Which rollouts.

    Args:
        task: where.
        goal: node that the program is to reach; ψ_R is the task itself.
        seed: decides the episodes.
        rollout_episodes: how many.
        success: share of them that is wanted: more are run while these cannot tell whether it is reached; None runs
            just so many.
        confirm: consecutive steps for which a subgoal must hold to count as reached.
    """

    task: TaskConfig
    goal: str = ROOT
    seed: int = 0
    rollout_episodes: int = ROLLOUT_EPISODES
    success: float | None = None
    confirm: int = CONFIRM


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `outcome.json`, `episodes.json` and `failures.safetensors`.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    program = read_runnable(inputs, task, config.confirm)
    limits = None if config.success is None else Limits(success=config.success)
    label, episodes = f"roll out {config.goal}", config.rollout_episodes
    done = list(
        try_program(
            program,
            task,
            config.seed,
            config.goal,
            episodes,
            limits,
            lambda count: episode_progress(label, count, report),
        )
    )
    outcome = Outcome.total(map(Outcome.of, done))
    write_file(out / FAILURES, failures_bytes(outcome.failures()))
    ended = [Endings.of(rollouts) for rollouts in done]
    seeds = trial_seeds(config.seed, config.goal, sum(len(each.success) for each in ended))
    write_json(out / EPISODES, episode_table(ended, seeds))
    write_json(out / OUTCOME, {**summary(ended), **lost_to_json(outcome.lost)})


STAGE = Stage("roll_out", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
