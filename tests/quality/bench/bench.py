"""Runs the learner on tasks of the bench and judges what it finds."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context

from roboscribe.dsl.printer import pretty
from roboscribe.errors import Fail
from tests.quality.bench.checker import judge
from tests.quality.bench.development import TASKS as DEVELOPMENT_TASKS
from tests.quality.bench.held_out import TASKS as HELD_OUT_TASKS
from tests.quality.bench.scripted import fresh_rollouts, patience, solve
from tests.quality.bench.task import KinematicTask

TASKS: dict[str, KinematicTask] = {task.name: task for task in (*DEVELOPMENT_TASKS, *HELD_OUT_TASKS)}
"""Every task by name."""
DEVELOPMENT = 0.95
"""Share of the development tasks on which the learner has to be right."""
HELD_OUT = 0.85
"""The same of the tasks that were set aside."""


@dataclass(frozen=True)
class Result:
    """What came of one task and seed.

    Args:
        task: its name.
        seed: of the demonstrations and of the learner.
        outcome: "right", "wrong", "Fail" or "error".
        reason: why it is not right.
        seconds: that the learner took.
        program: what it found, if anything.
    """

    task: str
    seed: int
    outcome: str
    reason: str = ""
    seconds: float = 0.0
    program: str = ""


def attempt(name: str, seed: int) -> Result:
    """Learn one task from the demonstrations of one seed, and judge the program; whatever breaks is an outcome too."""
    begin = time.perf_counter()
    try:
        return _attempt(TASKS[name], seed)
    except Exception as error:
        return Result(name, seed, "error", f"{type(error).__name__}: {error}", time.perf_counter() - begin)


def _attempt(task: KinematicTask, seed: int) -> Result:
    shown = task.demonstrate(task.demos, seed)
    begin = time.perf_counter()
    answer = solve(task, shown, seed)
    seconds = time.perf_counter() - begin
    if isinstance(answer, Fail):
        return Result(task.name, seed, "Fail", answer.reason, seconds)
    rollouts = fresh_rollouts(task, answer.program, answer.skills, patience(shown))
    problem = judge(task, answer.program, rollouts)
    return Result(task.name, seed, "wrong" if problem else "right", problem, seconds, pretty(answer.program))


def attempts(names: Iterable[str], seeds: Iterable[int], jobs: int) -> Iterator[Result]:
    """Attempt tasks, several at a time, in order."""
    work = [(name, seed) for name in names for seed in seeds]
    if jobs == 1:
        yield from (attempt(*each) for each in work)
        return
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")  # each process has a core of its own
    with get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap(_attempt_pair, work)


def _attempt_pair(work: tuple[str, int]) -> Result:
    return attempt(*work)


def share_right(results: Sequence[Result]) -> float:
    """Share of the results that are right."""
    return sum(result.outcome == "right" for result in results) / max(1, len(results))
