"""Cells of experiments: what is computed once, kept in the store, and found there by whoever asks again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Protocol, assert_never, cast

from roboscribe.baselines.config import RECIPES, method_named
from roboscribe.errors import Fail
from roboscribe.io.atomic import Json, sha256_of
from roboscribe.pipelines.baseline_run import BaselinePlan, BaselineRun
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.pipelines.synthesis_run import SynthesisRun
from roboscribe.pipelines.workspace import Workspace
from roboscribe.rl.config import Profile, TrainConfig
from roboscribe.stages import baseline, collect, evaluate, transfer
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.paper.rows import GIVEN_UP, NO_PROGRAM, OURS, EvaluationPoint, Record, Trial, write_record
from roboscribe.stages.runtime.control_steps import ControlStepCounter
from roboscribe.stages.runtime.controller_files import DESCRIPTIONS, WEIGHTS
from roboscribe.stages.runtime.events import (
    Decision,
    Evaluated,
    Event,
    Failed,
    Filmed,
    Ingested,
    Packaged,
    Programmed,
    RolledOut,
    Trained,
)
from roboscribe.stages.runtime.files import OUTCOME, PROGRAM, program_bytes, read_json
from roboscribe.stages.runtime.store import TIMING, Inputs, Stage, Store
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import DEMONSTRATIONS
from roboscribe.stages.train import LIMITS
from roboscribe.subtask_tree import ROOT

CHECKED = baseline.Config.rollout_episodes
"""Episodes of each evaluation during the training of a baseline."""


@dataclass(frozen=True)
class CellContext:
    """Where cells are computed.

    Args:
        workspace: whose store keeps them.
        track: whether MLflow is told of the syntheses and trainings in them.
    """

    workspace: Workspace
    track: bool = True

    @property
    def store(self) -> Store:
        """The store of finished stages."""
        return Store(self.workspace.data / "stages")


class Cell(Protocol):
    """Something that is computed once; frozen data, so that it can be sent to another process."""

    def __str__(self) -> str:
        """Name it as its task run and its child run are named."""

    def run(self, context: CellContext, callbacks: Callbacks) -> Path:
        """Compute it, or find it; returns the directory of what was found."""


@dataclass(frozen=True)
class TransferCell:
    """A saved program or baseline, measured.

    Args:
        label: says what is measured where.
        directory: of what is measured.
        config: where, on which episodes.
    """

    label: str
    directory: Path
    config: transfer.Config

    def __str__(self) -> str:
        """Return the label."""
        return self.label

    def run(self, context: CellContext, callbacks: Callbacks) -> Path:
        """Measure it."""
        callbacks.on_stage(self.label)
        return context.store.run(transfer.STAGE, self.config, transfer.inputs_of(self.directory), callbacks.on_progress)


@dataclass(frozen=True)
class SynthesisCell:
    """A program, synthesized, and every program on the way to it that was trained for the task itself.

    Args:
        trial: what is run.
    """

    trial: Trial

    def __str__(self) -> str:
        """Return the trial's name."""
        return str(self.trial)

    def run(self, context: CellContext, callbacks: Callbacks) -> Path:
        """Synthesize, then measure what was trained on the way; leaves `cell.json` and, if found, `program/`."""
        plan = planned(self.trial, demonstrations(self.trial, context, callbacks))
        run = SynthesisRun(plan, context.workspace, "local", track=context.track)
        identity = CellConfig(run.key(), self.trial.rollout_episodes, _own_code())

        def work(config: CellConfig, inputs: Inputs, out: Path, report: object) -> None:
            _synthesize(plan, config.checked, context, callbacks, out)

        return context.store.run(Stage("cell", CellConfig, work), identity, {})


@dataclass(frozen=True)
class CellConfig:
    """What decides a cell.

    Args:
        run: key of the run, which hashes plan, demonstrations and code.
        checked: episodes of each evaluation on the way.
        code: SHA-256 of what makes cells of runs.
    """

    run: str
    checked: int
    code: str


@dataclass(frozen=True)
class BaselineCell:
    """A baseline, trained and measured.

    Args:
        trial: what is run.
    """

    trial: Trial

    def __str__(self) -> str:
        """Return the trial's name."""
        return str(self.trial)

    def run(self, context: CellContext, callbacks: Callbacks) -> Path:
        """Train, then measure; leaves `cell.json` and `program/`."""
        trial = self.trial
        given = demonstrations(trial, context, callbacks)
        plan = BaselinePlan(
            method_named(trial.method),
            trial.task,
            trial.seed,
            trial.budget,
            given,
            trial.n_demonstrations,
            trial.evaluation_episodes,
        )
        run = BaselineRun(plan, context.workspace, "local", track=context.track)
        identity = CellConfig(run.key(), CHECKED, _own_code())

        def work(config: CellConfig, inputs: Inputs, out: Path, report: object) -> None:
            _train(plan, context, callbacks, out)

        return context.store.run(Stage("cell", CellConfig, work), identity, {})


def cell_of(trial: Trial) -> Cell:
    """Return the cell of a trial."""
    return SynthesisCell(trial) if trial.method == OURS else BaselineCell(trial)


def planned(trial: Trial, given: Path | None = None) -> SynthesisPlan:
    """Plan the synthesis of a trial, as `roboscribe synthesize` does; nothing is filmed."""
    training = TrainConfig() if trial.budget is None else TrainConfig(budget=trial.budget)
    return SynthesisPlan(
        trial.task,
        trial.seed,
        cast(Profile, trial.profile),  # names are checked where options are read
        given,
        trial.n_demonstrations,
        evaluation_episodes=trial.evaluation_episodes,
        training=training,
        video=False,
    )


def demonstrations(trial: Trial, context: CellContext, callbacks: Callbacks) -> Path | None:
    """Collect demonstrations of an unusual style; None for usual ones, which the run collects itself."""
    usual = collect.Config(trial.task, trial.n_demonstrations, trial.seed)
    config = replace(usual, style=trial.style, failing=trial.failing)
    if config == usual:
        return None
    callbacks.on_stage(f"collect {trial.style} demonstrations")
    return context.store.run(collect.STAGE, config, {}, callbacks.on_progress) / DEMONSTRATIONS


@dataclass
class SynthesisObserver:
    """Keeps every program that was trained for the task itself, and the seconds it took until then.

    Args:
        callbacks: who hears of everything, too.
        counter: counts control steps.
        start: when the work began.
        seconds: that trainings and rollouts took, as the store remembers it.
        took: seconds until the last event before the final evaluation.
        programs: control steps, seconds, the program's text, and the directory of its controllers.
        digest: of the demonstrations.
        profile: what was learned from.
    """

    callbacks: Callbacks
    counter: ControlStepCounter = field(default_factory=ControlStepCounter)
    start: float = field(default_factory=perf_counter)
    seconds: float = 0.0
    took: float = 0.0
    programs: list[tuple[int, float, bytes, Path]] = field(default_factory=list)
    digest: str = ""
    profile: str = ""
    _program: bytes = b""

    @property
    def elapsed(self) -> float:
        """Seconds since the start, or those that the store remembers, where an interruption lies between."""
        return max(self.seconds, perf_counter() - self.start)

    def on_event(self, event: Event) -> None:
        """Keep what was trained and counted."""
        self.counter.on_event(event)
        if not isinstance(event, Evaluated | Packaged):
            self.took = self.elapsed
        match event:
            case Ingested(report, profile):
                self.digest, self.profile = str(report["digest"]), profile
            case Programmed(_, program):
                self._program = program_bytes(program)
            case RolledOut(_, _, table):
                self._spent(table.parent)
            case Trained(goal, _, metrics):
                self._spent(metrics.parent)
                if goal == ROOT:
                    self.programs.append((self.counter.env_steps, self.elapsed, self._program, metrics.parent))
            case Decision() | Evaluated() | Packaged() | Filmed() | Failed():
                pass
            case _:
                assert_never(event)
        self.callbacks.on_event(event)

    def _spent(self, out: Path) -> None:
        self.seconds += float(read_json(out / TIMING)["wall_seconds"])


def _synthesize(plan: SynthesisPlan, checked: int, context: CellContext, callbacks: Callbacks, out: Path) -> None:
    """Do the work of a cell."""
    commit, observer = checkout_commit(), SynthesisObserver(callbacks)
    run = SynthesisRun(plan, context.workspace, "local", out / DIRECTORY, context.track)
    result = run.run(Callbacks(callbacks.on_stage, observer.on_event, callbacks.on_progress))
    points = tuple(_measured(plan, checked, context, callbacks, kept) for kept in observer.programs)
    if isinstance(result, Fail):
        last = EvaluationPoint(observer.counter.env_steps, 0, plan.evaluation_episodes, observer.took, final=True)
        record = Record((*points, last), observer.profile, observer.digest, commit, None, NO_PROGRAM, result.reason)
    else:
        last = EvaluationPoint(
            int(str(result["env_steps"])), _successes(result), plan.evaluation_episodes, observer.took, final=True
        )
        refinements = int(str(result["refinements"]))
        record = Record((*points, last), observer.profile, observer.digest, commit, refinements)
    write_record(out, record)


def _train(plan: BaselinePlan, context: CellContext, callbacks: Callbacks, out: Path) -> None:
    """Do the work of a baseline's cell."""
    commit, observer = checkout_commit(), SynthesisObserver(callbacks)
    run = BaselineRun(plan, context.workspace, "local", out / DIRECTORY, context.track)
    result = run.run(Callbacks(callbacks.on_stage, observer.on_event, callbacks.on_progress))
    profile = RECIPES[plan.method].profile
    if isinstance(result, Fail):
        last = EvaluationPoint(0, 0, plan.evaluation_episodes, observer.took, final=True)
        record = Record((last,), profile, observer.digest, commit, ended=NO_PROGRAM, reason=result.reason)
    else:
        last = EvaluationPoint(
            int(str(result["env_steps"])), _successes(result), plan.evaluation_episodes, observer.took, final=True
        )
        ended = GIVEN_UP if result["hopeless"] else ""
        record = Record((*_on_the_way(result["curve"]), last), profile, observer.digest, commit, ended=ended)
    write_record(out, record)


def _on_the_way(curve: Json) -> tuple[EvaluationPoint, ...]:
    """Read the evaluations during a training; a journal says when they were, not how long it had taken."""
    assert isinstance(curve, list), "a list of figures by step"
    measured = [point for point in curve if isinstance(point, Mapping) and "success" in point]
    return tuple(
        EvaluationPoint(int(str(point["step"])), round(float(str(point["success"])) * CHECKED), CHECKED, None)
        for point in measured
    )


def _successes(result: Mapping[str, Json]) -> int:
    return round(float(str(result["success"])) * int(str(result["episodes"])))


def _measured(
    plan: SynthesisPlan, checked: int, context: CellContext, callbacks: Callbacks, kept: tuple[int, float, bytes, Path]
) -> EvaluationPoint:
    """Measure a program that was trained on the way, on the first of the episodes of the final evaluation."""
    steps, seconds, text, trained = kept
    store = context.store
    inputs = {
        "program": store.put(PROGRAM, text),
        "controllers": trained / DESCRIPTIONS,
        "weights": trained / WEIGHTS,
        "limits": trained / LIMITS,
    }
    callbacks.on_stage(f"evaluate what was trained after {steps} control steps")
    config = evaluate.Config(plan.task, plan.seed, checked, plan.training.confirm)
    figures = read_json(store.run(evaluate.STAGE, config, inputs, callbacks.on_progress) / OUTCOME)
    return EvaluationPoint(steps, int(figures["successes"]), int(figures["episodes"]), seconds)


def _own_code() -> str:
    """Hash what makes a cell of a run: this file, for what it calls is in the run's key."""
    return sha256_of(Path(__file__))
