"""Fig. 19 and Table 1: syntheses and baselines of every task, method and seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from rich.console import Console

from roboscribe.pipelines.paper.cell_runner import run_cells
from roboscribe.pipelines.paper.cells import TransferCell
from roboscribe.pipelines.paper.experiment import (
    CellOutcome,
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
from roboscribe.pipelines.paper.methods import MOST_QUICK, budget_of, every_method
from roboscribe.stages import transfer
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.paper import curves, table1
from roboscribe.stages.paper.rows import OURS, EvaluationPoint, Record, Row, Trial, rows_of
from roboscribe.stages.paper.values import REPORTED
from roboscribe.stages.runtime.files import OUTCOME, read_json
from roboscribe.stages.runtime.task_config import TaskConfig

PROFILES = ("actions", "states")
"""Profiles that are drawn; `paper` takes half an hour per seed of one block and is drawn on demand."""
PLANAR = "point-"
"""How names of tasks in the plane begin."""


def trials_of(options: Options, tasks: Sequence[str], methods: Sequence[str]) -> list[Trial]:
    """List what is run: of every task every method, programs under every profile, each seed."""
    ways = [
        (task, method, profile)
        for task, method in product(tasks, methods)
        for profile in (_profiles(task, options) if method == OURS else ("",))
    ]
    return [
        Trial(
            TaskConfig(task),
            method,
            profile,
            seed,
            budget_of(method, task, options),
            evaluation_episodes=options.evaluation_episodes,
            quick=options.quick,
        )
        for (task, method, profile), seed in product(ways, range(options.seeds))
    ]


def _profiles(task: str, options: Options) -> tuple[str, ...]:
    """Return what programs are learned from; in a quick run a task in the plane takes the controllers it brings."""
    if options.profiles or not options.quick:
        return options.profiles or PROFILES
    return ("scripted",) if task.startswith(PLANAR) else PROFILES[:1]


def draw_curves(options: Options, context: ExperimentContext, console: Console) -> ExperimentResult:
    """Run every method on every task, draw success over control steps, and measure what was found in the end.

    Raises:
        TaskError: an unknown task or method.
    """
    methods = options.methods or (MOST_QUICK if options.quick else every_method())
    options = options.quickly()
    tasks, missing = chosen_tasks(options, tuple(REPORTED))
    built = [task for task in tasks if task not in missing]
    outcomes = run_trials("paper curves", trials_of(options, built, methods), context, console)
    failures = failures_of(outcomes)
    if not outcomes:
        return ExperimentResult("", failures, missing)
    rows = [] if options.quick else _elsewhere(outcomes, context, console)
    report = curves.report(table_of(outcomes, rows), tasks, missing, quick=options.quick)
    return finish(
        "curves", report, options, context, missing=missing, failures=failures, children=children_of(outcomes)
    )


def _elsewhere(outcomes: Sequence[CellOutcome], context: ExperimentContext, console: Console) -> list[Row]:
    """Measure the final programs under the paper's contact model, where a task has one."""
    found = [each for each in outcomes if not each.record.ended and not each.trial.task.name.startswith(PLANAR)]
    trials = [replace(each.trial, task=replace(each.trial.task, contact="paper")) for each in found]
    cells = [
        TransferCell(f"{trial}, paper contact", each.directory / DIRECTORY, _config(trial))
        for each, trial in zip(found, trials, strict=True)
    ]
    outs = run_cells("paper curves, paper contact", cells, context.cell_context, context.runner, console)
    rows: list[Row] = []
    for each, trial, out in zip(found, trials, outs, strict=True):
        figures, last = read_json(out / OUTCOME), each.record.points[-1]
        point = EvaluationPoint(
            last.control_steps, int(figures["successes"]), trial.evaluation_episodes, last.seconds, final=True
        )
        rows += rows_of(trial, _only(each.record, point))
    return rows


def _config(trial: Trial) -> transfer.Config:
    return transfer.Config(trial.task, trial.seed, trial.evaluation_episodes)


def _only(record: Record, point: EvaluationPoint) -> Record:
    """Return a record with another last point and no others."""
    return replace(record, points=(point,))


def make_table1(options: Options, context: ExperimentContext, console: Console) -> ExperimentResult:
    """Count the refinements of the syntheses of `paper curves`, which are done where they are not there yet.

    Raises:
        TaskError: an unknown task.
    """
    options = options.quickly()
    tasks, missing = chosen_tasks(options, tuple(REPORTED))
    built = [task for task in tasks if task not in missing]
    usual = options if options.quick else replace(options, profiles=options.profiles or PROFILES[:1])
    outcomes = run_trials("paper table1", trials_of(usual, built, (OURS,)), context, console)
    failures = failures_of(outcomes)
    if not outcomes:
        return ExperimentResult("", failures, missing)
    report = table1.report(table_of(outcomes), tasks, missing, quick=options.quick)
    return finish(
        "table1", report, options, context, missing=missing, failures=failures, children=children_of(outcomes)
    )
