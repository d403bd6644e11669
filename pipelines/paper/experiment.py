"""What every command of the paper shares: options, tasks that exist, cells, the report and its tracking."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pandas as pd
from rich.console import Console

from roboscribe.defaults import EVALUATION_EPISODES
from roboscribe.errors import TaskError
from roboscribe.evaluation import format_success
from roboscribe.io.atomic import Json, canonical_json, sha256_of, write_files
from roboscribe.pipelines.paper.cell_runner import Runner, run_cells
from roboscribe.pipelines.paper.cells import CellContext, cell_of
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.paper.curves import cell_metrics
from roboscribe.stages.paper.report import About, Report, report_files
from roboscribe.stages.paper.rows import CELL_COLUMNS, Record, Row, Trial, read_record, rows_of, tabulate
from roboscribe.stages.paper.since import COMMIT, changes, newest
from roboscribe.stages.runtime.code_version import ROOT, code_version
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.store import locked
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.experiment import ChildRun, track_experiment

QUICK_STEPS, QUICK_EPISODES = 100_000, 50
QUICK_TASKS = ("pick-place-1", "point-pick-place-1")


@dataclass(frozen=True)
class Options:
    """What a command of the paper is asked for.

    Args:
        tasks: instead of those that the experiment has.
        methods: "roboscribe" and baselines, instead of those that the experiment has.
        profiles: what programs may be learned from, instead of those that the experiment has.
        seeds: how many; they count from 0.
        evaluation_episodes: of each final evaluation.
        budget: "default", "paper" or a number of steps of learning.
        quick: a run that is no result.
        programs: given ones, instead of synthesizing any.
    """

    tasks: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    profiles: tuple[str, ...] = ()
    seeds: int = 5
    evaluation_episodes: int = EVALUATION_EPISODES
    budget: str = "default"
    quick: bool = False
    programs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse options that contradict each other.

        Raises:
            TaskError: a budget that is neither a word nor a number.
        """
        if self.budget not in ("default", "paper") and not (self.budget.isdecimal() and int(self.budget) > 0):
            msg = f"--budget {self.budget}: expected default, paper or a number of control steps"
            raise TaskError(msg)

    def quickly(self, tasks: tuple[str, ...] = QUICK_TASKS) -> Options:
        """Return the options of a quick run where one is asked for: seed 0, few episodes, small tasks."""
        if not self.quick:
            return self
        return replace(
            self, tasks=self.tasks or tasks, seeds=1, evaluation_episodes=min(self.evaluation_episodes, QUICK_EPISODES)
        )

    def words(self) -> list[str]:
        """Spell the options that are not the usual ones, as the command line takes them."""
        usual, words = Options(), list[str]()
        several = (("--task", self.tasks), ("--method", self.methods), ("--profile", self.profiles))
        for option, values in (*several, ("--program", self.programs)):
            words += [word for value in values for word in (option, value)]
        for option, value, default in (
            ("--seeds", self.seeds, usual.seeds),
            ("--episodes", self.evaluation_episodes, usual.evaluation_episodes),
            ("--budget", self.budget, usual.budget),
        ):
            words += [option, str(value)] if value != default else []
        return [*words, *(["--quick"] if self.quick else [])]


@dataclass(frozen=True)
class ExperimentContext:
    """Where an experiment is done.

    Args:
        workspace: where everything is kept.
        runner: what runs the cells.
        out: where the report goes; None is `data/paper/NAME`.
        track: whether MLflow is told.
    """

    workspace: Workspace
    runner: Runner = field(default_factory=Runner)
    out: Path | None = None
    track: bool = True

    @property
    def cell_context(self) -> CellContext:
        """Where cells are computed."""
        return CellContext(self.workspace, self.track)


@dataclass(frozen=True)
class ExperimentResult:
    """The result of an experiment.

    Args:
        summary: the report in Markdown; "" where nothing could be measured.
        failures: cells without a result, and why.
        missing: tasks that do not exist yet.
        directory: of the report; None where there is none.
        run_id: MLflow's; None where nothing was tracked.
    """

    summary: str
    failures: tuple[str, ...]
    missing: tuple[str, ...] = ()
    directory: Path | None = None
    run_id: str | None = None


def existing(tasks: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Separate the tasks of the paper that can be made from those that do not exist yet."""
    built = tuple(task for task in tasks if _exists(task))
    return built, tuple(task for task in tasks if task not in built)


def _exists(task: str) -> bool:
    try:
        TaskConfig(task).make()
    except TaskError:
        return False
    return True


def chosen_tasks(options: Options, usual: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the tasks of a run, and which of them do not exist yet.

    Raises:
        TaskError: a task that the user names is neither known nor one of the paper.
    """
    for task in options.tasks:
        if task not in usual:
            TaskConfig(task).make()
    tasks = options.tasks or tuple(usual)
    return tasks, existing(tasks)[1]


@dataclass(frozen=True)
class CellOutcome:
    """A cell that was computed.

    Args:
        trial: what was run.
        record: what it found.
        directory: where it lies.
    """

    trial: Trial
    record: Record
    directory: Path

    @property
    def rows(self) -> list[Row]:
        """One row per evaluation."""
        return rows_of(self.trial, self.record)


def run_trials(title: str, trials: Sequence[Trial], context: ExperimentContext, console: Console) -> list[CellOutcome]:
    """Run every trial, or find it in the store."""
    cells = [cell_of(trial) for trial in trials]

    def say(number: int, out: Path) -> str:
        record = read_record(out)
        if record.reason:
            return f"{record.ended}: {record.reason}"
        last = rows_of(trials[number], record)[-1]
        return f"{format_success(last)}, {last['control_steps']} control steps"

    found = run_cells(title, cells, context.cell_context, context.runner, console, say)
    return [CellOutcome(trial, read_record(out), out) for trial, out in zip(trials, found, strict=True)]


def failures_of(outcomes: Sequence[CellOutcome]) -> tuple[str, ...]:
    """Name the cells that gave no program."""
    return tuple(f"{each.trial}: {each.record.reason}" for each in outcomes if each.record.reason)


def table_of(outcomes: Sequence[CellOutcome], more: Sequence[Row] = ()) -> pd.DataFrame:
    """Make the table of all evaluations of cells."""
    return tabulate([*(row for each in outcomes for row in each.rows), *more])


def finish(
    name: str,
    report: Report,
    options: Options,
    context: ExperimentContext,
    *,
    missing: Sequence[str] = (),
    failures: Sequence[str] = (),
    keys: Sequence[str] = CELL_COLUMNS,
    children: Sequence[ChildRun] = (),
    words: Sequence[str] = (),
) -> ExperimentResult:
    """Write the report's files and track them.

    Args:
        name: of the experiment.
        report: its table, text and pictures.
        options: what was asked for.
        context: where it was done.
        missing: tasks that do not exist yet.
        failures: cells without a result, and why.
        keys: columns that tell one cell from another.
        children: the cells as they are tracked.
        words: further options of the command line.
    """
    commit, title = checkout_commit(), f"paper {name}"
    earlier = newest(context.workspace.data / "runs", title, name, commit, quick=options.quick)
    about = About(
        name,
        shlex.join(["roboscribe", "paper", name, *options.words(), *words]),
        commit,
        options.quick,
        tuple(missing),
        tuple(failures),
        changes(report.table, earlier, keys),
        {"asked": encode(options)},
    )
    files = report_files(report, about)
    out = context.out or context.workspace.data / "paper" / (f"{name}-quick" if options.quick else name)
    out.mkdir(parents=True, exist_ok=True)
    write_files({out / file: data for file, data in files.items()})
    summary = files[f"{name}.md"].decode()
    run_id = _track(title, report, about, files, context, children) if context.track else None
    return ExperimentResult(summary, tuple(failures), tuple(missing), out, run_id)


def _track(
    title: str,
    report: Report,
    about: About,
    files: Mapping[str, bytes],
    context: ExperimentContext,
    children: Sequence[ChildRun],
) -> str | None:
    """Track the run and its cells in MLflow; tracked again, it is the same run."""
    identity: Json = {
        "command": about.command,
        "commit": about.commit,
        "table": hashlib.sha256(files[f"{about.name}.csv"]).hexdigest(),
        "code": code_version("roboscribe.stages.paper.curves"),
    }
    directory = context.workspace.data / "runs" / hashlib.sha256(canonical_json(identity).encode()).hexdigest()[:32]
    directory.mkdir(parents=True, exist_ok=True)
    params = {"quick": str(about.quick), "command": about.command}
    lock = ROOT / "requirements.lock"
    tags = {
        COMMIT: about.commit,
        "mlflow.note.content": files[f"{about.name}.md"].decode(),
        "roboscribe.lock": sha256_of(lock) if lock.is_file() else "",
    }
    with locked(directory):
        return track_experiment(directory, context.workspace.mlruns, title, title, params, {}, files, tags, children)


def children_of(outcomes: Sequence[CellOutcome]) -> list[ChildRun]:
    """Return the cells of trials as they are tracked: parameters, figures of the end, and the curve."""
    return [_child(each) for each in outcomes]


def _child(each: CellOutcome) -> ChildRun:
    rows, trial = each.rows, each.trial
    last = rows[-1]
    names = (
        "task",
        "method",
        "profile",
        "seed",
        "budget",
        "contact",
        "timing",
        "n_demonstrations",
        "style",
        "failing",
        "quick",
    )
    params = {name: str(last[name]) for name in names}
    curve = [(int(str(row["control_steps"])), float(str(row["success"]))) for row in rows]
    refined = {} if each.record.refinements is None else {"refinements": float(each.record.refinements)}
    metrics = {**cell_metrics(last), **refined}
    tags = {COMMIT: each.record.commit, **({"reason": each.record.reason} if each.record.reason else {})}
    return ChildRun(str(trial), params, metrics, tuple(curve), each.record.demonstrations, tags)
