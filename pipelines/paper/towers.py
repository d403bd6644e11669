"""The paper's transfer experiment (Sec. 5.2): what was made for one single tower builds others, without training."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from rich.console import Console

from roboscribe.envs.catalogue import CONTACTS
from roboscribe.errors import ArtifactError
from roboscribe.evaluation import format_success
from roboscribe.pipelines.paper.cell_runner import run_cells
from roboscribe.pipelines.paper.cells import TransferCell
from roboscribe.pipelines.paper.experiment import (
    ExperimentContext,
    ExperimentResult,
    Options,
    failures_of,
    finish,
    run_trials,
)
from roboscribe.pipelines.paper.given_programs import GivenProgram, given_program
from roboscribe.pipelines.paper.methods import budget_of
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.stages import transfer
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.paper import towers
from roboscribe.stages.paper.rows import OURS, Trial
from roboscribe.stages.paper.towers import Measurement, tabulate
from roboscribe.stages.paper.values import SUCCESS, TASKS
from roboscribe.stages.runtime.files import OUTCOME, read_json
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.experiment import ChildRun

TITLE = "paper towers"
SINGLE_TOWER = re.compile(r"tower-([0-9]+)(-crowded)?")
"""Names of the tasks for which programs are transferred."""
QUICK = ("tower-4", "tower-5", "multitower-4", "pyramid-4")
QUICK_PROGRAMS = ("tower-4", "tower-5")
"""Shipped programs, which a quick run measures instead of synthesizing any."""


@dataclass(frozen=True)
class Experiment:
    """What is compared.

    Args:
        trained: blocks of the single towers for which programs are synthesized.
        contacts: contact models under which programs are measured.
    """

    trained: tuple[int, ...] = tuple(SUCCESS)
    contacts: tuple[str, ...] = CONTACTS


@dataclass(frozen=True)
class Subject:
    """A program or policy that is measured.

    Args:
        trained: blocks of the single tower for which it was made.
        method: that made it.
        seed: that decided it.
        directory: where it lies.
    """

    trained: int
    method: str
    seed: int
    directory: Path

    def __str__(self) -> str:
        own = "" if self.method == OURS else f"{self.method} "
        return f"{own}tower-{self.trained} seed {self.seed}"


def measure_towers(
    experiment: Experiment, options: Options, context: ExperimentContext, console: Console
) -> ExperimentResult:
    """Synthesize the programs or take the given ones, measure each, and write the report.

    The same experiment goes on where it was interrupted: finished stages and measurements are in the store.

    Raises:
        ArtifactError: a given program cannot be used.
        TaskError: an unknown contact model, or a tower that cannot be built.
    """
    options = _quickly(options)
    contacts = experiment.contacts[:1] if options.quick else experiment.contacts
    places = [TaskConfig(task, contact) for contact, task in product(contacts, options.tasks or TASKS)]
    trials = trials_of(experiment, options)
    for task in (*(trial.task for trial in trials), *places):
        task.make()  # so that hours of training do not end in a typing error
    failures: tuple[str, ...] = ()
    with ExitStack() as stack:
        if options.programs:
            named = [(name, stack.enter_context(given_program(name, context.workspace))) for name in options.programs]
            subjects = _distinct([_subject(name, found) for name, found in named])
        else:
            outcomes = run_trials(TITLE, trials, context, console)
            failures = failures_of(outcomes)
            subjects = [
                Subject(int(each.trial.task.name.rpartition("-")[2]), each.trial.method, each.trial.seed, where)
                for each in outcomes
                if (where := each.directory / DIRECTORY).is_dir()
            ]
        measured = _measured(subjects, places, options, context, console)
    if not measured:
        return ExperimentResult("", failures)
    table = tabulate(measured)
    words = _words(experiment)
    children = [_child(each) for each in measured]
    return finish(
        "towers",
        towers.report(table, quick=options.quick),
        options,
        context,
        failures=failures,
        keys=towers.KEYS,
        children=children,
        words=words,
    )


def trials_of(experiment: Experiment, options: Options) -> list[Trial]:
    """List what is synthesized or trained: nothing where programs are given."""
    if options.programs:
        return []
    pairs = product(experiment.trained, options.methods or (OURS,), range(options.seeds))
    profile = (options.profiles or ("actions",))[0]
    return [
        Trial(
            TaskConfig(f"tower-{blocks}"),
            method,
            profile if method == OURS else "",
            seed,
            budget_of(method, f"tower-{blocks}", options),
            evaluation_episodes=options.evaluation_episodes,
            quick=options.quick,
        )
        for blocks, method, seed in pairs
    ]


def _quickly(options: Options) -> Options:
    """Take shipped programs in a quick run."""
    if not options.quick:
        return options
    return replace(options.quickly(QUICK), programs=options.programs or QUICK_PROGRAMS)


def _subject(name: str, found: GivenProgram) -> Subject:
    """Say what a given program is.

    Raises:
        ArtifactError: it was made for something else than a single tower.
    """
    family = SINGLE_TOWER.fullmatch(found.task)
    if family is None:
        msg = f"program {name}: was made for task {found.task}, expected a single tower such as tower-5"
        raise ArtifactError(msg)
    return Subject(int(family[1]), found.method, found.seed, found.directory)


def _measured(
    subjects: Sequence[Subject],
    places: Sequence[TaskConfig],
    options: Options,
    context: ExperimentContext,
    console: Console,
) -> list[Measurement]:
    """Measure every subject in every task."""
    pairs = list(product(subjects, places))
    cells = [
        TransferCell(
            f"{s} on {t.name}, {t.contact} contact",
            s.directory,
            transfer.Config(t, s.seed, options.evaluation_episodes),
        )
        for s, t in pairs
    ]
    outs = run_cells(
        TITLE, cells, context.cell_context, context.runner, console, lambda _, out: format_success(figures_in(out))
    )
    commit = checkout_commit()
    return [
        Measurement(
            s.trained, s.seed, t.contact, t.name, figures_in(out), s.method, timing=t.timing, quick=options.quick,
            commit=commit,
        )
        for (s, t), out in zip(pairs, outs, strict=True)
    ]  # fmt: skip


def figures_in(out: Path) -> dict[str, float]:
    """Read what an evaluation found."""
    figures: dict[str, float] = read_json(out / OUTCOME)
    return figures


def _words(experiment: Experiment) -> list[str]:
    """Spell what is compared, as the command line takes it, where it is not the usual."""
    usual = Experiment()
    trained = experiment.trained if experiment.trained != usual.trained else ()
    contacts = experiment.contacts if experiment.contacts != usual.contacts else ()
    words = [word for blocks in trained for word in ("--trained", str(blocks))]
    return [*words, *(word for contact in contacts for word in ("--contact", contact))]


def _child(each: Measurement) -> ChildRun:
    """Return a measurement as it is tracked."""
    params = {
        "task": each.task,
        "trained": f"tower-{each.trained}",
        "method": each.method,
        "seed": str(each.seed),
        "contact": each.contact,
        "timing": each.timing,
        "quick": str(each.quick),
    }
    name = f"{each.method} tower-{each.trained} seed {each.seed} on {each.task}, {each.contact} contact"
    return ChildRun(name, params, {figure: float(each.figures[figure]) for figure in towers.FIGURES})


def _distinct(subjects: list[Subject]) -> list[Subject]:
    """Refuse programs that the report could not tell apart.

    Raises:
        ArtifactError: two programs are for the same tower and of the same seed.
    """
    names = [str(subject) for subject in subjects]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        msg = f"two of the programs are {twice}; expected another tower or seed for each"
        raise ArtifactError(msg)
    return subjects
