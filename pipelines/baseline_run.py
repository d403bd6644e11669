"""Training and measuring one baseline: stages, tracking, and what is left behind."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from roboscribe.baselines.config import RECIPES, BaselineConfig, Method
from roboscribe.defaults import EVALUATION_EPISODES, N_DEMONSTRATIONS
from roboscribe.errors import DemonstrationError, Fail, TaskError
from roboscribe.io.atomic import Json, canonical_json, sha256_of
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.flows.prefect_server import prefect_server
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.pipelines.synthesis_pipeline import usable_demonstrations
from roboscribe.pipelines.synthesis_run import Engine, publish
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages import baseline, transfer
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.runtime.code_version import code_version
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.events import Evaluated, Event, EventCallback, Ingested, Trained
from roboscribe.stages.runtime.files import EPISODES, OUTCOME, read_json
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.store import METRICS, AnyStage, Inputs, Store, locked
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.steps import RunStage
from roboscribe.stages.tracking.source import source_tags
from roboscribe.stages.tracking.tracker import SECONDS, Tracker

STAGES = tuple(f"roboscribe.stages.{name}" for name in ("collect", "ingest", "baseline", "transfer"))
"""Modules whose code a run depends on."""
TRACKED = ("success", "ci_low", "ci_high", "episodes", "env_steps", "gradient_steps", "evaluation_steps")
"""Figures of the result that are tracked."""


def engine_named(name: str) -> Engine:
    """Look up what runs stages.

    Raises:
        TaskError: there is no such engine.
    """
    match name:
        case "prefect" | "local":
            return name
        case _:
            msg = f"unknown engine {name!r}: expected prefect or local"
            raise TaskError(msg)


@dataclass(frozen=True)
class BaselinePlan:
    """What is asked for.

    Args:
        method: which baseline.
        task: where.
        seed: decides everything.
        steps: gradient steps of clones, control steps of the others; None is what is usual.
        demonstrations: a Parquet file; None collects some, the same as a synthesis of this seed does.
        n_demonstrations: how many to collect.
        evaluation_episodes: episodes of the final evaluation.
        settings: of the methods.
    """

    method: Method
    task: TaskConfig
    seed: int = 0
    steps: int | None = None
    demonstrations: Path | None = None
    n_demonstrations: int = N_DEMONSTRATIONS
    evaluation_episodes: int = EVALUATION_EPISODES
    settings: BaselineConfig = field(default_factory=BaselineConfig)

    @property
    def title(self) -> str:
        """How the run is called."""
        return f"{self.method} on {self.task.name} seed {self.seed}"

    @property
    def command(self) -> str:
        """The command line that makes it, as far as options can say what is planned."""
        usual = BaselinePlan(self.method, TaskConfig(self.task.name))
        options = (
            ("--steps", self.steps, usual.steps),
            ("--demos", self.demonstrations, usual.demonstrations),
            ("--episodes", self.evaluation_episodes, usual.evaluation_episodes),
            ("--contact", self.task.contact, usual.task.contact),
            ("--timing", self.task.timing, usual.task.timing),
        )
        words = ["roboscribe", "baseline", self.method, self.task.name, "--seed", str(self.seed)]
        for option, value, default in options:
            words += [option, str(value)] if value != default else []
        return shlex.join(words)


@dataclass
class BaselineStages:
    """The stages of one baseline, in order; each leaves what the next one needs.

    Args:
        plan: what is asked for.
        call: runs a stage.
        tell: hears what happens.
    """

    plan: BaselinePlan
    call: RunStage
    tell: EventCallback
    shown: Path | None = None
    digest: str = ""
    trained: Path = Path()
    evaluated: Path = Path()
    fail: Fail | None = None

    def steps(self) -> dict[str, Callable[[], None]]:
        """List what is to be done, by name."""
        plan = self.plan
        found: dict[str, Callable[[], None]] = {}
        if RECIPES[plan.method].states:
            found["demonstrations"] = self._collect
        return {**found, f"train {plan.method}": self._train, f"evaluate {plan.method}": self._evaluate}

    def _collect(self) -> None:
        plan, recipe = self.plan, RECIPES[self.plan.method]
        asked = SynthesisPlan(
            plan.task, plan.seed, demonstrations=plan.demonstrations, n_demonstrations=plan.n_demonstrations
        )
        path, report = usable_demonstrations(asked, self.call)
        if isinstance(report, Fail):
            self.fail = report
            return
        if recipe.actions and not report["actions"]:
            msg = f"{plan.demonstrations}: found no actions, expected them for {plan.method}"
            raise DemonstrationError(msg)
        self.plan = replace(plan, task=replace(plan.task, horizon=int(report["horizon"])))
        self.shown, self.digest = path, str(report["digest"])
        self.tell(Ingested(report, recipe.profile))

    def _train(self) -> None:
        if self.fail is not None:
            return
        plan = self.plan
        own = baseline.Config(plan.task, plan.method, plan.seed, plan.steps, settings=plan.settings)
        config = replace(own, demonstrations=self.digest, command=plan.command)
        inputs = {} if self.shown is None else {"demonstrations": self.shown}
        self.trained = self.call(f"train {plan.method}", baseline.STAGE, config, inputs)
        outcome = read_json(self.trained / OUTCOME)
        self.tell(Trained("ψ_R", (_report(plan.method, outcome),), self.trained / METRICS))

    def _evaluate(self) -> None:
        if self.fail is not None:
            return
        plan = self.plan
        config = transfer.Config(plan.task, plan.seed, plan.evaluation_episodes)
        inputs = transfer.inputs_of(self.trained / DIRECTORY)
        self.evaluated = self.call(f"evaluate {plan.method}", transfer.STAGE, config, inputs)
        self.tell(Evaluated(read_json(self.evaluated / OUTCOME), self.evaluated / EPISODES))


@dataclass(frozen=True)
class BaselineRun:
    """One training and evaluation of a baseline: plan, workspace, engine, tracking.

    Args:
        plan: what is asked for.
        workspace: where it is kept.
        engine: what runs the stages.
        out: where the policy goes; None is a directory under `data/baselines`.
        track: whether MLflow is told.
    """

    plan: BaselinePlan
    workspace: Workspace
    engine: Engine = "prefect"
    out: Path | None = None
    track: bool = True

    def run(self, callbacks: Callbacks) -> dict[str, Json] | Fail:
        """Train and evaluate, or go on where the same plan was interrupted.

        Returns:
            What `roboscribe baseline --json` writes, or why nothing can be learned from the demonstrations.
        """
        start, commit = perf_counter(), checkout_commit()
        directory = self.workspace.data / "runs" / self.key()
        directory.mkdir(parents=True, exist_ok=True)
        with locked(directory):
            plan = self.plan
            tracker = Tracker(
                directory, self.workspace.mlruns, self._params(), plan.title, plan.task.name, kind="baseline"
            )
            if self.track:
                tracker.start()
            tracker.tags(source_tags(f"roboscribe baseline {plan.title}", commit))
            try:
                work = self._work(callbacks, tracker)
                result = work.fail or self._result(work, commit)
            except BaseException as error:
                tracker.stopped_by(error)
                raise
            seconds = round(tracker.seconds(perf_counter() - start), 3)
            if isinstance(result, Fail):
                tracker.status("FAILED")
                tracker.close()
                return result
            tracker.keep(Path(str(result["program_dir"])))
            figures = {**{name: float(str(result[name])) for name in TRACKED}, SECONDS: seconds}
            tracker.result(figures, int(str(result["env_steps"])))
            tracker.status("FINISHED")
            return {**result, "wall_seconds": seconds, "mlflow_run_id": tracker.close()}

    def _work(self, callbacks: Callbacks, tracker: Tracker) -> BaselineStages:
        """Run the stages."""
        store = Store(self.workspace.data / "stages")

        def on_progress(progress: Progress) -> None:
            tracker.on_progress(progress)
            callbacks.on_progress(progress)

        def tell(event: Event) -> None:
            tracker.on_event(event)
            callbacks.on_event(event)

        def call(label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
            callbacks.on_stage(label)
            return store.run(stage, config, inputs, on_progress)

        work = BaselineStages(self.plan, call, tell)
        steps = work.steps()
        if self.engine == "local":
            for step in steps.values():
                step()
            return work
        with prefect_server(self.workspace.data / "prefect") as server:
            from roboscribe.pipelines.flows.measurement import measure_with_prefect

            measure_with_prefect(self.plan.title, list(steps), lambda number: list(steps.values())[number](), server)
        return work

    def _result(self, work: BaselineStages, commit: str) -> dict[str, Json]:
        """Publish the policy and say what was found."""
        plan, taken, figures = self.plan, read_json(work.trained / OUTCOME), read_json(work.evaluated / OUTCOME)
        out = self.out or self.workspace.data / "baselines" / f"{plan.method}-{plan.task.name}-seed{plan.seed}"
        publish(work.trained / DIRECTORY, out, {"figures": figures}, commit)
        return {
            "task": plan.task.name,
            "method": plan.method,
            "profile": RECIPES[plan.method].profile,
            "seed": plan.seed,
            **{name: figures[name] for name in ("success", "episodes", "ci_low", "ci_high")},
            "env_steps": taken["control_steps"],
            "gradient_steps": taken["gradient_steps"],
            "evaluation_steps": figures["control_steps"],
            "hopeless": taken["hopeless"],
            "curve": taken["curve"],
            "demonstrations": work.digest,
            "program_dir": str(out.resolve()),
        }

    def key(self) -> str:
        """Identify the run: the same plan, demonstrations and code give the same key."""
        given = self.plan.demonstrations
        digest = None if given is None or not given.is_file() else sha256_of(given)
        plan = encode(replace(self.plan, demonstrations=None))
        code: list[Json] = [*map(code_version, STAGES), self.plan.task.code()]
        text = canonical_json({"baseline": plan, "demonstrations": digest, "code": code})
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def _params(self) -> dict[str, str]:
        plan, task = self.plan, self.plan.task
        where = {"task": task.name, "contact": task.contact, "timing": task.timing}
        steps = "usual" if plan.steps is None else str(plan.steps)
        return {**where, "seed": str(plan.seed), "method": plan.method, "budget": steps}


def _report(method: Method, outcome: Mapping[str, Any]) -> dict[str, Any]:
    """Describe a training in the form of a controller's training report."""
    measured = [float(point["success"]) for point in outcome["curve"] if "success" in point]
    return {
        "controller": method.replace("-", "_"),
        "learner": method,
        "success": measured[-1] if measured else 0.0,
        "warm_success": 0.0,
        "starts": 0,
        "control_steps": outcome["control_steps"],
    }
