"""Exec(M, P): run a program, count its successes and keep the states of its failures."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.syntax import Program
from roboscribe.io.atomic import Json, write_file
from roboscribe.subtask_tree import ROOT
from roboscribe.synthesize import Outcome
from roboscribe.world.layout import IntArray
from roboscribe.world.protocols import Task
from stages import alone
from stages.progress import Progress, Report, silent
from stages.skills import Library, as_controllers, read_library
from stages.store import Inputs, Stage
from stages.values import EPISODES, FAILURES, OUTCOME, failures_bytes, read_json, read_program, write_json
from stages.world import TaskConfig, episode_seeds

WAVE = 125
"""Episodes between two messages of progress, run at once where worlds are batched."""
GYM_BATCH = 8
"""Episodes run at once where every row is an environment of its own."""


@dataclass(frozen=True)
class Config:
    """Which rollouts.

    Args:
        task: where.
        goal: node that the program is to reach; ψ_R is the task itself.
        seed: decides the episodes.
        episodes: how many.
        confirm: consecutive steps for which a subgoal must hold to count as reached.
    """

    task: TaskConfig
    goal: str = ROOT
    seed: int = 0
    episodes: int = 100
    confirm: int = 3


@dataclass(frozen=True)
class Grounded:
    """A program that can run.

    Args:
        program: P.
        library: its controllers.
        limits: step limit by controller.
        confirm: consecutive steps for which a subgoal must hold.
    """

    program: Program
    library: Library
    limits: Mapping[str, int]
    confirm: int = 3


def waves(
    grounded: Grounded, task: Task, seeds: IntArray, goal: str = ROOT, report: Report = silent
) -> Iterator[Rollouts]:
    """Run a program once from every seed, in waves, telling after each how many succeeded so far."""
    successes, what = 0, f"roll out {goal}"
    report(Progress(what, 0, len(seeds), "episodes"))
    for start in range(0, len(seeds), WAVE):
        rollouts = execute(
            grounded.program,
            as_controllers(grounded.library),
            task,
            seeds[start : start + WAVE],
            limits=grounded.limits,
            batch=GYM_BATCH if task.name.startswith("gym:") else WAVE,
            until_end=goal != ROOT,
            confirm=grounded.confirm,
        )
        successes += int(rollouts.success.sum())
        done = min(start + WAVE, len(seeds))
        report(Progress(what, done, len(seeds), "episodes", {"success": successes / done}))
        yield rollouts


def run(config: Config, inputs: Inputs, out: Path, report: Report = silent) -> None:
    """Write `outcome.json`, `episodes.json` and `failures.safetensors`.

    Inputs:
        program: its text.
        controllers, weights, limits: its library, as the training stage wrote it.
    """
    task = config.task.make()
    library = read_library(inputs["controllers"], inputs["weights"], task)
    grounded = Grounded(read_program(inputs["program"]), library, read_json(inputs["limits"]), config.confirm)
    seeds = episode_seeds(config.seed, f"roll out {config.goal}", config.episodes)
    done = list(waves(grounded, task, seeds, config.goal, report))
    failures = np.concatenate([Outcome.of(rollouts).failures for rollouts in done])
    write_file(out / FAILURES, failures_bytes(failures))
    write_json(out / EPISODES, episode_table(done, seeds))
    write_json(out / OUTCOME, summary(done))


def summary(done: list[Rollouts]) -> dict[str, Json]:
    """Count what happened."""
    return {
        "successes": sum(int(rollouts.success.sum()) for rollouts in done),
        "episodes": sum(len(rollouts.success) for rollouts in done),
        "diverged": sum(int(rollouts.diverged.sum()) for rollouts in done),
        "control_steps": sum(rollouts.control_steps for rollouts in done),
    }


def episode_table(done: list[Rollouts], seeds: IntArray) -> dict[str, Json]:
    """List every episode: its seed, how it ended, and after how many control steps."""
    rows = [
        [int(won), int(broken), len(lines)]
        for rollouts in done
        for won, broken, lines in zip(rollouts.success, rollouts.diverged, rollouts.lines, strict=True)
    ]
    data: list[Json] = [[i, int(seed), *row] for i, (seed, row) in enumerate(zip(seeds, rows, strict=True))]
    return {"columns": ["episode", "seed", "success", "diverged", "steps"], "data": data}


STAGE = Stage("roll_out", Config, run)

if __name__ == "__main__":
    sys.exit(alone.main(STAGE))
