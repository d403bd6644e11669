"""Demonstration sizes: syntheses from few and many demonstrations, in other styles, and with failing ones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from rich.console import Console

from roboscribe.pipelines.paper.experiment import (
    ExperimentContext,
    ExperimentResult,
    Options,
    children_of,
    chosen_tasks,
    failures_of,
    finish,
    run_trials,
    table_of,
)
from roboscribe.pipelines.paper.methods import budget_of
from roboscribe.stages.paper import demos
from roboscribe.stages.paper.rows import OURS, Trial
from roboscribe.stages.paper.values import DEMONSTRATIONS
from roboscribe.stages.runtime.task_config import TaskConfig

Way = tuple[int, str, float]
"""Demonstrations, their style, and the share of them that fails."""
SIZES: tuple[Way, ...] = tuple((size, "default", 0.0) for size in (2, 5, *DEMONSTRATIONS))
"""The paper's sizes, and fewer."""
STYLES: tuple[Way, ...] = ((50, "mixed", 0.0), (50, "slow", 0.0), (50, "default", 0.2))
WAYS: dict[str, tuple[Way, ...]] = {
    demos.TASK: (*SIZES, *STYLES),
    "tower-5": tuple((size, "default", 0.0) for size in (10, 20)),
}
"""How each task is shown; other tasks in the usual style, which is all that some of them know."""
QUICK_WAYS: tuple[Way, ...] = ((10, "default", 0.0), (50, "default", 0.0))


def trials_of(options: Options, tasks: Sequence[str]) -> list[Trial]:
    """List what is run."""
    profiles = options.profiles or ("actions",)
    return [
        Trial(
            TaskConfig(task),
            OURS,
            profile,
            seed,
            budget_of(OURS, task, options),
            *way,
            evaluation_episodes=options.evaluation_episodes,
            quick=options.quick,
        )
        for task in tasks
        for profile, way, seed in product(profiles, ways_of(task, quick=options.quick), range(options.seeds))
    ]


def ways_of(task: str, *, quick: bool) -> tuple[Way, ...]:
    """Return how a task is shown."""
    return QUICK_WAYS if quick else WAYS.get(task, SIZES)


def draw_demos(options: Options, context: ExperimentContext, console: Console) -> ExperimentResult:
    """Synthesize from every number of demonstrations; 50 of the usual style are those of `paper curves`.

    Raises:
        TaskError: an unknown task.
    """
    options = options.quickly((demos.TASK,))
    tasks, missing = chosen_tasks(options, tuple(WAYS))
    trials = trials_of(options, [task for task in tasks if task not in missing])
    outcomes = run_trials("paper demos", trials, context, console)
    failures = failures_of(outcomes)
    if not outcomes:
        return ExperimentResult("", failures, missing)
    report = demos.report(table_of(outcomes), tasks, missing, quick=options.quick)
    return finish("demos", report, options, context, missing=missing, failures=failures, children=children_of(outcomes))
