"""One synthesis from start to end: its directories, its lock, its tracking, and what is left behind."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Literal, TypeAlias

from roboscribe.errors import ArtifactError, DemonstrationError, Fail
from roboscribe.io.atomic import Json, canonical_json, sha256_of, write_file
from roboscribe.io.saved_program import CONTROLLERS, PROGRAM, TREE, load_program, save_program
from roboscribe.onnx_controllers import copy_onnx
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.flows.prefect_server import prefect_server
from roboscribe.pipelines.flows.run_ahead import run_ahead
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.pipelines.synthesis_pipeline import SynthesisResult, command, run_pipeline
from roboscribe.pipelines.workspace import Workspace
from roboscribe.programs import program_name
from roboscribe.stages.runtime.code_version import code_version
from roboscribe.stages.runtime.configuration import encode, flattened
from roboscribe.stages.runtime.events import Event, EventCallback
from roboscribe.stages.runtime.plan_file import CONFIG, to_toml
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.store import AnyStage, Inputs, Store, locked
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.tracking.description import begun, failed, solved
from roboscribe.stages.tracking.event_log import CHRONICLE, EventLogWriter
from roboscribe.stages.tracking.mlflow_store import NOTE_TAG, run_id_of
from roboscribe.stages.tracking.source import source_tags
from roboscribe.stages.tracking.tracker import SECONDS, Tracker
from roboscribe.tree_json import tree_to_json

FIGURES = ("success", "ci_low", "ci_high", "episodes", "env_steps", "evaluation_steps", "refinements")
"""Figures of the result that are tracked."""
STAGES = tuple(f"roboscribe.stages.{name}" for name in ("steps", "collect", "ingest", "evaluate", "package", "film"))
"""Modules whose code a run depends on."""
SHOWN = 8
"""Characters by which a run is found again, see `roboscribe runs`."""
Engine: TypeAlias = Literal["prefect", "local"]


@dataclass(frozen=True)
class SynthesisRun:
    """One synthesis: plan, workspace, engine, tracking.

    Args:
        plan: what is asked for.
        workspace: where it is kept.
        engine: what runs the stages.
        out: where the program goes; None is a directory under `data/programs`.
        track: whether MLflow is told.
    """

    plan: SynthesisPlan
    workspace: Workspace
    engine: Engine = "prefect"
    out: Path | None = None
    track: bool = True

    def run(self, callbacks: Callbacks) -> dict[str, Json] | Fail:
        """Synthesize, or go on with an interrupted synthesis of the same plan.

        Returns:
            What `roboscribe synthesize --json` writes, or why there is no program.
        """
        start, commit = perf_counter(), checkout_commit()  # before the work: the checkout may move on meanwhile
        directory = self.workspace.data / "runs" / self.key()
        directory.mkdir(parents=True, exist_ok=True)
        with locked(directory):
            tracker = Tracker(directory, self.workspace.mlruns, self._params(), self._title(), self.plan.task.name)
            if self.track:
                tracker.start()
            spelled = command(self.plan, self.plan.profile)
            tracker.settings(self._settings())
            tracker.tags({**source_tags(spelled, commit), NOTE_TAG: begun(spelled)})
            write_file(directory / CONFIG, to_toml(self.plan).encode())
            tracker.attach(directory / CONFIG)
            event_log = EventLogWriter(directory / CHRONICLE, self._about(commit))
            try:
                found = self._synthesize(callbacks, (tracker.on_event, event_log.on_event), tracker)
                result = found if isinstance(found, Fail) else self._result(found, tracker.env_steps, commit)
            except BaseException as error:
                tracker.stopped_by(error)
                raise
            seconds = round(tracker.seconds(perf_counter() - start), 3)
            event_log.end(
                {"reason": result.reason} if isinstance(result, Fail) else {**result, "wall_seconds": seconds}
            )
            tracker.attach(event_log.path)
            if isinstance(result, Fail):
                tracker.tags({NOTE_TAG: failed(spelled, result.reason)}, last=True)
                tracker.status("FAILED")
                tracker.close()
                return result
            tracker.tags({NOTE_TAG: solved(spelled, result, tracker.subgoals, directory.name[:SHOWN])}, last=True)
            figures = {name: float(str(result[name])) for name in FIGURES}
            tracker.result({**figures, SECONDS: seconds}, tracker.env_steps + int(str(result["evaluation_steps"])))
            tracker.status("FINISHED")
            return {**result, "wall_seconds": seconds, "mlflow_run_id": tracker.close()}

    def key(self) -> str:
        """Identify the run: the same plan, demonstrations and code give the same key.

        Raises:
            DemonstrationError: the demonstration file cannot be read.
        """
        given = self.plan.demonstrations
        try:
            digest = None if given is None else sha256_of(given)
        except OSError as error:
            msg = f"{given}: cannot be read ({error.strerror}), expected demonstrations in Parquet"
            raise DemonstrationError(msg) from error
        plan = encode(replace(self.plan, demonstrations=None))
        code = [*map(code_version, STAGES), self.plan.task.code()]
        text = canonical_json({"plan": plan, "demonstrations": digest, "code": code})
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def _synthesize(
        self, callbacks: Callbacks, listeners: tuple[EventCallback, ...], tracker: Tracker
    ) -> SynthesisResult | Fail:
        store = Store(self.workspace.data / "stages")

        def on_progress(progress: Progress) -> None:
            tracker.on_progress(progress)
            callbacks.on_progress(progress)

        def tell(event: Event) -> None:
            for on_event in (*listeners, callbacks.on_event):
                on_event(event)

        def call(label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
            callbacks.on_stage(label)
            return store.run(stage, config, inputs, on_progress)

        if self.engine == "local":
            return run_pipeline(self.plan, call, store.put, tell)
        with prefect_server(self.workspace.data / "prefect") as server:
            from roboscribe.pipelines.flows.synthesis import synthesize_with_prefect

            rest = run_ahead(self.plan, call, store.put, tell, server)
            return synthesize_with_prefect(
                self._title(), self.plan, call, store.put, rest, server, lambda: run_id_of(tracker.directory)
            )

    def _result(self, found: SynthesisResult, env_steps: int, commit: str) -> dict[str, Json]:
        """Publish the program and say what was found."""
        plan, figures = self.plan, found.figures
        name = f"{program_name(plan.task.name)}-{found.profile}-seed{plan.seed}"
        out = self.out or self.workspace.data / "programs" / name
        publish(found.directory, out, {"env_steps": env_steps}, commit)
        return {
            "task": plan.task.name,
            "seed": plan.seed,
            "profile": found.profile,
            "horizon": found.horizon,
            "success": figures["success"],
            "episodes": figures["episodes"],
            "ci_low": figures["ci_low"],
            "ci_high": figures["ci_high"],
            "refinements": len(found.solution.refinements),
            "env_steps": env_steps,
            "evaluation_steps": figures["control_steps"],
            "program": (found.directory / PROGRAM).read_text(encoding="utf-8"),
            "tree": tree_to_json(found.solution.tree),
            "program_dir": str(out.resolve()),
        }

    def _about(self, commit: str) -> dict[str, Json]:
        """Say what is asked for."""
        plan = encode(replace(self.plan, demonstrations=None))
        given = None if self.plan.demonstrations is None else str(self.plan.demonstrations)
        spelled = command(self.plan, self.plan.profile)
        return {"title": self._title(), "plan": plan, "demonstrations": given, "command": spelled, "commit": commit}

    def _title(self) -> str:
        return f"{self.plan.task.name} seed {self.plan.seed}"

    def _settings(self) -> dict[str, str]:
        """Return the whole configuration, by the names that `--set` takes."""
        plan = flattened(encode(replace(self.plan, demonstrations=None)))
        return {name: str(value) for name, value in plan.items() if name != "demonstrations"}

    def _params(self) -> dict[str, str]:
        plan = self.plan
        return {
            "task": plan.task.name,
            "contact": plan.task.contact,
            "timing": plan.task.timing,
            "seed": str(plan.seed),
            "budget": str(plan.training.budget),
        }


def publish(packaged: Path, out: Path, about: Mapping[str, Json], commit: str) -> None:
    """Save a program of the store elsewhere and complete its manifest; one that is there already stays as it is.

    The commit is not part of the packaging stage, whose outputs would otherwise change with every commit. It is the
    one under which the program was first published, so that finding the same program again changes no file either.

    Args:
        packaged: the program's directory in the store.
        out: where it goes.
        about: further entries of the manifest.
        commit: of the checkout; "" where there is none.
    """
    saved = load_program(packaged)
    manifest = {**saved.manifest, **about}
    if not _published(packaged, out, manifest):
        save_program(out, replace(saved, manifest={**manifest, "commit": commit}))
        copy_onnx(packaged, out)


def _published(packaged: Path, out: Path, manifest: Mapping[str, Json]) -> bool:
    """Whether a program lies somewhere already, whatever commit its manifest names."""
    try:
        found = load_program(out).manifest
    except ArtifactError:
        return False
    same = all((out / name).read_bytes() == (packaged / name).read_bytes() for name in (PROGRAM, TREE, CONTROLLERS))
    return same and {key: value for key, value in found.items() if key != "commit"} == manifest
