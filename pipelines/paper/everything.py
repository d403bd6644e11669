"""All experiments of the paper, cheapest first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from rich.console import Console

from roboscribe.pipelines.paper.confined import Confinement, measure_confined
from roboscribe.pipelines.paper.curves import draw_curves, make_table1
from roboscribe.pipelines.paper.demos import draw_demos
from roboscribe.pipelines.paper.experiment import ExperimentContext, ExperimentResult, Options
from roboscribe.pipelines.paper.towers import Experiment, measure_towers
from roboscribe.stages.paper.rows import OURS

Conduct: TypeAlias = Callable[[Options, ExperimentContext, Console], ExperimentResult]
EXPERIMENTS: dict[str, tuple[float, Conduct]] = {
    "table1": (0.6, make_table1),
    "demos": (0.5, draw_demos),
    "confined": (0.3, lambda options, context, console: measure_confined(Confinement(), options, context, console)),
    "towers": (0.8, lambda options, context, console: measure_towers(Experiment(), options, context, console)),
    "curves": (1.5, draw_curves),
}
"""By name, cheapest first: core-hours of programs per seed where nothing is in the store, and what does it."""
BASELINE_HOURS = 25.0
"""Core-hours per seed of all baselines on all tasks, in `curves`."""
QUICK_HOURS = 0.03
"""The same of one experiment of a quick run."""


def do_everything(options: Options, context: ExperimentContext, console: Console) -> dict[str, ExperimentResult]:
    """Do all experiments; given tasks hold for those that are about single tasks.

    Raises:
        TaskError: an unknown task or method.
    """
    done: dict[str, ExperimentResult] = {}
    for name, (_, conduct) in EXPERIMENTS.items():
        own = options if name not in ("confined", "towers") else replace(options, tasks=())
        out = None if context.out is None else context.out / name
        done[name] = conduct(own, replace(context, out=out), console)
    return done


def expectation(options: Options) -> str:
    """Say how long everything takes."""
    hours = QUICK_HOURS * len(EXPERIMENTS)
    if not options.quick:
        others = 0.0 if options.methods == (OURS,) else BASELINE_HOURS
        hours = options.seeds * (others + sum(per_seed for per_seed, _ in EXPERIMENTS.values()))
    about = f"{hours:.0f} core-hours" if hours >= 1 else f"{60 * hours:.0f} minutes"
    return f"{', '.join(EXPERIMENTS)}: about {about} where nothing is in the store yet"
