"""Running a program episode by episode, and what that says about it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, TypeAlias
from zlib import crc32

import numpy as np

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.io.atomic import Json
from roboscribe.runnable import Runnable
from roboscribe.steps import Limits, Outcome
from roboscribe.subtask_tree import ROOT
from roboscribe.success_rate import wilson
from roboscribe.world.layout import BoolArray, IntArray
from roboscribe.world.task import Task

WAVE = 125
"""Episodes between two messages of progress."""
LONGEST_TRIAL = 4
"""Times the usual episodes that trying a program may take at most: enough to tell 94 from 97 %."""
PURPOSE = "evaluate"
"""What the seeds of evaluation episodes are drawn for, see `episode_seeds`."""
Watch: TypeAlias = Callable[[int, int], None]
"""Told how many episodes are done, and in how many of them the program succeeded."""


def ignore_counts(done: int, successes: int) -> None:
    """Ignore the counts."""


def episode_seeds(seed: int, purpose: str, episodes: int) -> IntArray:
    """Draw the episodes' seeds (E,), of their own for every purpose; more episodes begin with the same ones."""
    rng = np.random.default_rng([seed, crc32(purpose.encode())])
    return rng.integers(2**31, size=episodes, dtype=np.int64)


def trial_seeds(seed: int, goal: str, episodes: int) -> IntArray:
    """Draw the seeds (E,) of the episodes in which programs for a goal are tried."""
    return episode_seeds(seed, f"roll out {goal}", episodes)


def waves(
    program: Runnable, task: Task, seeds: IntArray, goal: str = ROOT, watch: Watch = ignore_counts
) -> Iterator[Rollouts]:
    """Run a program once from every seed, in waves.

    Args:
        program: what runs.
        task: where.
        seeds: (E,) one per episode.
        goal: node that the program is to reach; ψ_R is the task itself, of any other it has to reach its end.
        watch: told before the first wave and after each.
    """
    successes = 0
    watch(0, 0)
    for start in range(0, len(seeds), WAVE):
        rollouts = execute(
            program.program,
            program.library,
            task,
            seeds[start : start + WAVE],
            limits=program.limits,
            batch=min(task.most_rows, WAVE),
            until_end=goal != ROOT,
            confirm=program.confirm,
        )
        successes += int(rollouts.success.sum())
        watch(min(start + WAVE, len(seeds)), successes)
        yield rollouts


def try_program(
    program: Runnable,
    task: Task,
    seed: int,
    goal: str,
    episodes: int,
    limits: Limits | None = None,
    watch: Callable[[int], Watch] = lambda _: ignore_counts,
) -> Iterator[Rollouts]:
    """Run a program in so many episodes, and in as many again while these cannot tell whether it is good enough.

    Args:
        program: what runs.
        task: where.
        seed: decides the episodes.
        goal: as in `waves`.
        episodes: E; `LONGEST_TRIAL` times as many are run at most.
        limits: what is good enough; None runs E episodes whatever they show.
        watch: given how many episodes come next, returns whom to tell of them.

    Departs: the paper runs a fixed number. At 95 of 100 a program may be better than asked or miss it clearly; episodes
        cost less than another subgoal.
    """
    seeds = trial_seeds(seed, goal, LONGEST_TRIAL * episodes)
    successes = 0
    for start in range(0, len(seeds), episodes):
        if start and (limits is None or not limits.doubtful(Outcome(successes, start))):
            return
        for rollouts in waves(program, task, seeds[start : start + episodes], goal, watch(episodes)):
            successes += int(rollouts.success.sum())
            yield rollouts


@dataclass(frozen=True, eq=False)
class Endings:
    """How episodes ended, and nothing of what happened in them: thousands of them take little room.

    Args:
        success: (E,) whether each succeeded.
        diverged: (E,) whether physics broke in it.
        steps: (E,) control steps that it took.
    """

    success: BoolArray
    diverged: BoolArray
    steps: IntArray

    @staticmethod
    def of(rollouts: Rollouts) -> Endings:
        """Return how rollouts ended."""
        steps = np.array([len(lines) for lines in rollouts.lines], dtype=np.int64)
        return Endings(rollouts.success, rollouts.diverged, steps)


def summary(done: Sequence[Endings]) -> dict[str, Json]:
    """Count what happened."""
    return {
        "successes": sum(int(wave.success.sum()) for wave in done),
        "episodes": sum(len(wave.success) for wave in done),
        "diverged": sum(int(wave.diverged.sum()) for wave in done),
        "control_steps": sum(int(wave.steps.sum()) for wave in done),
    }


def episode_table(done: Sequence[Endings], seeds: IntArray) -> dict[str, Json]:
    """List every episode: its seed, how it ended, and after how many control steps."""
    rows = [
        [int(won), int(broken), int(steps)]
        for wave in done
        for won, broken, steps in zip(wave.success, wave.diverged, wave.steps, strict=True)
    ]
    data: list[Json] = [[i, int(seed), *row] for i, (seed, row) in enumerate(zip(seeds, rows, strict=True))]
    return {"columns": ["episode", "seed", "success", "diverged", "steps"], "data": data}


def failures(table: Mapping[str, Any]) -> list[list[int]]:
    """List the episodes of a table that failed: number, seed, whether physics broke, control steps."""
    rows = (dict(zip(table["columns"], row, strict=True)) for row in table["data"])
    return [[row["episode"], row["seed"], row["diverged"], row["steps"]] for row in rows if not row["success"]]


@dataclass(frozen=True)
class Evaluation:
    """How well a program does.

    Args:
        task: name of the task it ran in.
        seed: decided the episodes.
        figures: successes, episodes, diverged, control_steps, success, ci_low, ci_high (95 % Wilson interval).
        table: every episode, see `episode_table`.
    """

    task: str
    seed: int
    figures: dict[str, Json]
    table: dict[str, Json]

    @property
    def episodes(self) -> int:
        """How many were run."""
        return int(str(self.figures["episodes"]))

    @property
    def success(self) -> float:
        """Share of them that solved the task."""
        return float(str(self.figures["success"]))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Wilson interval of the success rate."""
        return float(str(self.figures["ci_low"])), float(str(self.figures["ci_high"]))

    @property
    def outcome(self) -> Outcome:
        """The same as what rollouts of Algorithm 2 show."""
        return Outcome(int(str(self.figures["successes"])), self.episodes)

    def __str__(self) -> str:
        """Spell the success rate with its interval."""
        return f"{self.task}: success {format_success(self.figures)} of {self.episodes} episodes, 95 % interval"

    def _repr_html_(self) -> str:
        """Show the figures in a notebook."""
        return f"<p>{escape(str(self))}</p>"


def measure(program: Runnable, task: Task, seed: int, episodes: int, watch: Watch = ignore_counts) -> Evaluation:
    """Run a program on the evaluation episodes of a seed."""
    seeds = episode_seeds(seed, PURPOSE, episodes)
    done = [Endings.of(rollouts) for rollouts in waves(program, task, seeds, watch=watch)]
    counts = summary(done)
    won = sum(int(wave.success.sum()) for wave in done)
    low, high = wilson(won, episodes)
    figures: dict[str, Json] = {**counts, "success": won / episodes, "ci_low": round(low, 6), "ci_high": round(high, 6)}
    return Evaluation(task.name, seed, figures, episode_table(done, seeds))


def format_success(figures: Mapping[str, Any]) -> str:
    """Spell a success rate with its interval, in per cent."""
    success, low, high = (100 * float(figures[name]) for name in ("success", "ci_low", "ci_high"))
    return f"{success:.1f} % ({low:.1f} to {high:.1f})"
