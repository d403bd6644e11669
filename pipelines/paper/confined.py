"""Push-Multi Confined (Sec. 5.3): programs for pushing, with a guard that is learned again where the order matters."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from roboscribe.errors import ArtifactError, Fail
from roboscribe.evaluation import format_success
from roboscribe.io.atomic import sha256_of
from roboscribe.io.saved_program import load_program
from roboscribe.pipelines import adaptation
from roboscribe.pipelines.adaptation import adapt_saved, loop_lines, save
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.paper.cell_runner import run_cells
from roboscribe.pipelines.paper.cells import CellContext, TransferCell
from roboscribe.pipelines.paper.experiment import (
    ExperimentContext,
    ExperimentResult,
    Options,
    existing,
    failures_of,
    finish,
    run_trials,
)
from roboscribe.pipelines.paper.given_programs import GivenProgram, given_program
from roboscribe.pipelines.paper.methods import budget_of
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.programs import shipped_names
from roboscribe.stages import collect, transfer
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.paper import confined
from roboscribe.stages.paper.confined import NEW, OLD, ZERO_SHOT, Measurement, tabulate
from roboscribe.stages.paper.rows import OURS, Trial
from roboscribe.stages.runtime.code_version import code_version
from roboscribe.stages.runtime.files import OUTCOME, read_fail, read_json, write_fail, write_json
from roboscribe.stages.runtime.progress import ProgressCallback
from roboscribe.stages.runtime.store import TIMING, Inputs, Stage
from roboscribe.stages.runtime.task_config import DEMONSTRATIONS, TaskConfig
from roboscribe.stages.tracking.experiment import ChildRun

TITLE = "paper confined"
SOURCE = "source.json"
"""File that says which demonstrations a guard was learned from."""
SHOWN = 10
"""Demonstrations of the confined task."""
KEYS = ("task", "trained", "method", "profile", "seed", "way", "contact", "timing")


@dataclass(frozen=True)
class Confinement:
    """What is adapted to what.

    Args:
        trained: task of the programs.
        task: where another order is wanted.
    """

    trained: str = "push-3"
    task: str = "push-confined-3"


def measure_confined(
    experiment: Confinement, options: Options, context: ExperimentContext, console: Console
) -> ExperimentResult:
    """Take programs, learn their guards again, and measure both; policies of baselines are measured as they are.

    Raises:
        ArtifactError: a given program was made for another task.
        TaskError: an unknown method.
    """
    missing = existing((experiment.trained, experiment.task))[1]
    if missing:
        return ExperimentResult("", (), missing)
    options = options.quickly()
    if options.quick and not options.programs:
        if experiment.trained not in shipped_names():
            return ExperimentResult(
                "", (), (f"a shipped program for {experiment.trained}, which a quick run measures,",)
            )
        options = replace(options, programs=(experiment.trained,))
    with ExitStack() as stack:
        if options.programs:
            given = [
                _fitting(stack.enter_context(given_program(name, context.workspace)), experiment)
                for name in options.programs
            ]
            failures: tuple[str, ...] = ()
        else:
            outcomes = run_trials(TITLE, trials_of(experiment, options), context, console)
            failures = failures_of(outcomes)
            given = [
                GivenProgram(each.trial.task.name, each.trial.method, each.record.profile, each.trial.seed, where)
                for each in outcomes
                if (where := each.directory / DIRECTORY).is_dir()
            ]
        ways, unexplained = _variants(given, experiment, context, console)
        measured = _measured(ways, experiment, options, context, console)
    failures = (*failures, *unexplained)
    if not measured:
        return ExperimentResult("", failures)
    report = confined.report(tabulate(measured), quick=options.quick)
    children = [_child(each) for each in measured]
    return finish("confined", report, options, context, failures=failures, keys=KEYS, children=children)


def trials_of(experiment: Confinement, options: Options) -> list[Trial]:
    """List what is synthesized or trained."""
    task, profile = experiment.trained, (options.profiles or ("actions",))[0]
    return [
        Trial(
            TaskConfig(task),
            method,
            profile if method == OURS else "",
            seed,
            budget_of(method, task, options),
            evaluation_episodes=options.evaluation_episodes,
            quick=options.quick,
        )
        for method in options.methods or (OURS,)
        for seed in range(options.seeds)
    ]


def _fitting(given: GivenProgram, experiment: Confinement) -> GivenProgram:
    if given.task != experiment.trained:
        msg = f"program {given.directory}: was made for task {given.task}, expected {experiment.trained}"
        raise ArtifactError(msg)
    return given


@dataclass(frozen=True)
class GuardVariant:
    """A program with one of its guards, or a policy.

    Args:
        given: what it was made from.
        way: "old guard", "new guard" or "zero-shot".
        directory: where it lies.
        demonstrations: SHA-256 of those of the confined task; "" where none were used.
    """

    given: GivenProgram
    way: str
    directory: Path
    demonstrations: str = ""

    def __str__(self) -> str:
        return f"{self.given.method} {self.given.task} seed {self.given.seed}, {self.way}"

    @property
    def loop(self) -> str:
        """The line that begins its loop."""
        lines = loop_lines(load_program(self.directory).program_text) if self.given.method == OURS else []
        return "; ".join(lines)


@dataclass(frozen=True)
class AdaptationConfig:
    """What decides a new guard, beside program and demonstrations.

    Args:
        task: that is shown.
        code: version of the code that learns guards.
        saving: SHA-256 of the code that reads and writes programs for it.
    """

    task: str
    code: str
    saving: str


@dataclass(frozen=True)
class AdaptationCell:
    """A program whose guard is learned again; it takes seconds and no control step.

    Args:
        given: the program.
        task: that is shown.
    """

    given: GivenProgram
    task: str

    def __str__(self) -> str:
        return f"adapt {self.given.task} seed {self.given.seed} to {self.task}"

    def run(self, context: CellContext, callbacks: Callbacks) -> Path:
        """Learn the guard again; leaves `program/`, or the reason why there is none."""
        callbacks.on_stage(str(self))
        wanted = collect.Config(TaskConfig(self.task), SHOWN, self.given.seed)
        shown = context.store.run(collect.STAGE, wanted, {}, callbacks.on_progress) / DEMONSTRATIONS
        inputs = {**transfer.inputs_of(self.given.directory), "demonstrations": shown}
        config = AdaptationConfig(self.task, code_version("roboscribe.adapt"), sha256_of(Path(adaptation.__file__)))

        def work(config: AdaptationConfig, inputs: Inputs, out: Path, report: ProgressCallback) -> None:
            adapted = adapt_saved(self.given.directory, inputs["demonstrations"], config.task)
            if isinstance(adapted, Fail):
                write_fail(out, adapted)
            else:
                save(adapted, out / DIRECTORY, self.given.directory)
                write_json(out / SOURCE, {"demonstrations": sha256_of(inputs["demonstrations"])})

        return context.store.run(Stage("adapt", AdaptationConfig, work), config, inputs)


def _variants(
    given: Sequence[GivenProgram], experiment: Confinement, context: ExperimentContext, console: Console
) -> tuple[list[GuardVariant], tuple[str, ...]]:
    """Adapt every program; returns what is measured, and which guards could not be learned."""
    programs = [each for each in given if each.method == OURS]
    cells = [AdaptationCell(each, experiment.task) for each in programs]
    outs = run_cells(f"{TITLE}, guards", cells, context.cell_context, context.runner, console)
    ways = [GuardVariant(each, OLD, each.directory) for each in programs]
    failures = []
    for each, cell, out in zip(programs, cells, outs, strict=True):
        fail = read_fail(out)
        if fail is None:
            ways.append(GuardVariant(each, NEW, out / DIRECTORY, str(read_json(out / SOURCE)["demonstrations"])))
        else:
            failures.append(f"{cell}: {fail.reason}")
    ways += [GuardVariant(each, ZERO_SHOT, each.directory) for each in given if each.method != OURS]
    return ways, tuple(failures)


def _measured(
    ways: Sequence[GuardVariant],
    experiment: Confinement,
    options: Options,
    context: ExperimentContext,
    console: Console,
) -> list[Measurement]:
    """Measure every program with either guard, every policy as it is."""
    where = TaskConfig(experiment.task)
    configs = [transfer.Config(where, way.given.seed, options.evaluation_episodes) for way in ways]
    cells = [TransferCell(f"{way} on {where.name}", way.directory, c) for way, c in zip(ways, configs, strict=True)]
    outs = run_cells(
        TITLE,
        cells,
        context.cell_context,
        context.runner,
        console,
        lambda _, out: format_success(read_json(out / OUTCOME)),
    )
    commit = checkout_commit()
    return [
        Measurement(
            trained=experiment.trained,
            task=where.name,
            method=way.given.method,
            profile=way.given.profile,
            seed=way.given.seed,
            way=way.way,
            loop=way.loop,
            n_demonstrations=SHOWN if way.way == NEW else 0,
            demonstrations=way.demonstrations,
            contact=where.contact,
            timing=where.timing,
            quick=options.quick,
            commit=commit,
            figures=read_json(out / OUTCOME),
            seconds=float(read_json(out / TIMING)["wall_seconds"]),
        )
        for way, out in zip(ways, outs, strict=True)
    ]


def _child(each: Measurement) -> ChildRun:
    """Return a measurement as it is tracked."""
    params = {
        "task": each.task,
        "trained": each.trained,
        "method": each.method,
        "profile": each.profile,
        "seed": str(each.seed),
        "way": each.way,
        "contact": each.contact,
        "timing": each.timing,
        "quick": str(each.quick),
        "loop": each.loop,
    }
    metrics = {name: float(each.figures[name]) for name in confined.FIGURES}
    name = f"{each.method} seed {each.seed}, {each.way}, on {each.task}"
    return ChildRun(name, params, metrics, demonstrations=each.demonstrations)
