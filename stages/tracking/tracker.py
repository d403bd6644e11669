"""Tracking, the writing side: what happens is journaled at once, and a process of its own copies it into MLflow.

The journal is the truth. Whatever is wrong with the tracking store, training goes on, and the copying process, the
next run, or `roboscribe ui` brings the store up to date; time stamps come from the journal, so nothing is there twice.
"""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, assert_never

from roboscribe.dsl.printer import text
from roboscribe.io.atomic import Json, write_file
from roboscribe.stages.runtime.code_version import ROOT
from roboscribe.stages.runtime.control_steps import ControlStepCounter
from roboscribe.stages.runtime.events import (
    Abandoned,
    Decision,
    Evaluated,
    Event,
    Failed,
    Filmed,
    Ingested,
    Loosened,
    Packaged,
    Programmed,
    Refined,
    Removed,
    Retrained,
    RolledOut,
    Trained,
)
from roboscribe.stages.runtime.files import TREE, program_bytes, read_json
from roboscribe.stages.runtime.journal import Journal, Record, read_records
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.store import TIMING
from roboscribe.stages.tracking.mlflow_store import JOURNAL, PARENT, run_id_of
from roboscribe.subtask_tree import ROOT as GOAL
from roboscribe.success_rate import wilson
from roboscribe.tree_json import tree_to_json

LOG = "tracking.log"
IDENTITY = ("run", "kind", "key", "step")
EVALUATION = "evaluation"
SECONDS = "wall_seconds"
STOPPED_SECONDS = 30.0
"""Seconds for which a run that failed waits until that is copied."""
STEPS = "steps"
"""Unit of progress that is a learner's."""
_COLUMNS = (
    "predicate", "accepted", "initial", "kept", "first", "advances", "each", "bits", "entities", "size", "margin"
)  # fmt: skip
log = logging.getLogger(__name__)


@dataclass
class Tracker:
    """Journals the events of one synthesis, or of one baseline's training.

    Args:
        directory: of the run; holds the journal.
        mlruns: directory of the tracking store.
        params: scalar parameters, repeated on every child so that runs can be compared.
        title: how the run is called.
        experiment: group of runs.
        kind: of the run.
        subgoals: goal, name and predicate of every subgoal found so far.
    """

    directory: Path
    mlruns: Path
    params: Mapping[str, str]
    title: str
    experiment: str
    kind: str = "synthesis"
    _follower: subprocess.Popen[bytes] | None = None
    _counts: dict[str, int] = field(default_factory=dict)
    subgoals: tuple[tuple[str, str, str], ...] = ()
    _counter: ControlStepCounter = field(default_factory=ControlStepCounter)
    _last: RolledOut | None = None
    _spent: float = 0.0

    @property
    def env_steps(self) -> int:
        """Control steps so far, those of stages that were found in the store included."""
        return self._counter.env_steps

    def __post_init__(self) -> None:
        """Open the journal and start a new attempt."""
        self.directory.mkdir(parents=True, exist_ok=True)
        self._journal = Journal(self.directory / JOURNAL, IDENTITY)
        self._spent = spent(self._journal.records())
        self.attempt = 1 + sum(r["kind"] == "status" and r["value"] == "RUNNING" for r in self._journal.records())
        self._note(PARENT, "run", "title", self.title)
        self._note(PARENT, "run", "experiment", self.experiment)
        self._params(PARENT, {"kind": self.kind})
        self.status("RUNNING")

    def start(self) -> None:
        """Start the process that copies the journal into MLflow; it ends when this process does."""
        places = [str(self.directory.resolve()), str(self.mlruns.resolve())]
        with (self.directory / LOG).open("ab") as output:
            self._follower = subprocess.Popen(
                [sys.executable, "-m", "roboscribe.stages.tracking.mlflow_process", *places],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
                cwd=ROOT,
                start_new_session=True,
            )

    def close(self, timeout: float = 90.0) -> str | None:
        """Wait until everything is copied; returns MLflow's run id, None where the store could not be reached."""
        if self._follower is not None and self._follower.stdin is not None:
            self._follower.stdin.close()
            try:
                self._follower.wait(timeout)
            except subprocess.TimeoutExpired:
                self._follower.kill()
                self._follower.wait()
            if self._follower.returncode != 0:
                log.warning("the tracking store %s is behind; the journal %s is kept", self.mlruns, self._journal.path)
                return None
        return run_id_of(self.directory)

    def leave(self) -> None:
        """Let the copying process finish by itself, without waiting for it."""
        if self._follower is not None and self._follower.stdin is not None:
            self._follower.stdin.close()

    def stopped_by(self, error: BaseException) -> None:
        """Journal how a run was stopped; whoever was interrupted does not wait until that is copied."""
        killed = isinstance(error, KeyboardInterrupt | SystemExit)
        self.status("KILLED" if killed else "FAILED")
        if killed:
            self.leave()
        else:
            self.close(timeout=STOPPED_SECONDS)

    def status(self, value: str) -> None:
        """Journal the run's status: RUNNING, FINISHED, FAILED or KILLED."""
        self._note(PARENT, "status", value, value, self.attempt)

    def result(self, metrics: Mapping[str, float], step: int) -> None:
        """Journal the figures of the whole run at its last control step; repeated, they keep their first values."""
        self._metrics(PARENT, metrics, step)

    def seconds(self, own: float) -> float:
        """Return what all attempts took together, given what this one took; what a finished run took stays."""
        told = (r["value"] for r in self._journal.records() if r["run"] == PARENT and r["key"] == SECONDS)
        return next((float(str(value)) for value in told), self._spent + own)

    def settings(self, settings: Mapping[str, str]) -> None:
        """Journal the whole configuration of the run; its parts have the few parameters that they share."""
        for key, value in settings.items():
            self._note(PARENT, "param", key, value)

    def tags(self, tags: Mapping[str, str], *, last: bool = False) -> None:
        """Journal what is said of the run besides: user, source, description; each attempt says it anew.

        Args:
            tags: by name.
            last: whether they replace what this attempt said when it began.
        """
        for key, value in tags.items():
            self._note(PARENT, "tag", key, value, 2 * self.attempt + last)

    def attach(self, path: Path) -> None:
        """Journal a file of the run's own."""
        self._note(PARENT, "artifact", path.name, str(path.resolve()), folder="")

    def keep(self, directory: Path) -> None:
        """Journal a saved program's or baseline's directory."""
        self._note(PARENT, "artifacts", "program", str(directory))
        self._note(PARENT, "model", "program", str(directory))

    def on_progress(self, progress: Progress) -> None:
        """Journal a learner's figures as they come."""
        if progress.unit == STEPS:
            self._curve(progress.what, progress.metrics, progress.done, progress.time)

    def on_event(self, event: Event) -> None:
        """Journal an event."""
        self._counter.on_event(event)
        match event:
            case Ingested(report, profile):
                self.params = {**self.params, "profile": profile}
                self._ingested(report)
            case Programmed(_, program):
                number = self._count("program")
                path = self._file(f"program-{number}.txt", program_bytes(program))
                self._note(PARENT, "artifact", f"programs/{number}", str(path), folder="programs")
            case Trained(_, reports, metrics):
                self._trained(reports, metrics)
            case RolledOut(goal, counts, _):
                self._last = event
                self._metrics(PARENT, _tried(goal, counts), self.env_steps)
            case Decision():
                self._decided(event)
            case Evaluated(figures, table):
                self._evaluated(figures, table)
            case Packaged() | Filmed() | Failed():
                self._ending(event)
            case _:
                assert_never(event)

    def _decided(self, event: Refined | Abandoned | Retrained | Loosened | Removed) -> None:
        match event:
            case Refined():
                self._refined(event)
            case Abandoned(reason):
                number = self._count("abandoned")
                self._note(PARENT, "tag", f"abandoned_{number}", reason, self.attempt)
            case Retrained(success):
                number = self._count("retrained")
                self._note(PARENT, "tag", f"retrained_{number}", f"a promising program, at {success:.3f}", self.attempt)
            case Loosened(subgoal, predicate, success, helps):
                tried = f"{subgoal} with {text(predicate)}: {success:.3f}{', better' if helps else ''}"
                self._note(PARENT, "tag", f"loosened_{self._count('loosened')}", tried, self.attempt)
            case Removed(subgoal, success):
                self._note(PARENT, "tag", f"removed_{subgoal}", f"{success:.3f} without it", self.attempt)
            case _:
                assert_never(event)

    def _ending(self, event: Packaged | Filmed | Failed) -> None:
        match event:
            case Packaged(_, _, directory):
                self.keep(directory)
                self._tree(PARENT, directory / TREE)
            case Filmed(video):
                self._note(PARENT, "artifact", "video", str(video), folder="")
            case Failed(reason):
                self._note(PARENT, "tag", "reason", reason, self.attempt)
            case _:
                assert_never(event)

    def _ingested(self, report: Mapping[str, Any]) -> None:
        digest = str(report["digest"])
        self._note(PARENT, "dataset", "demonstrations", str(Path(report["source"]).resolve()))
        self._params(PARENT, {"demonstrations": str(report["kept"])})
        self.tags({"roboscribe.demonstrations_sha256": digest})

    def _trained(self, reports: tuple[Mapping[str, Any], ...], metrics: Path) -> None:
        for _, row in read_records(metrics):
            figures, step, time = row["metrics"], row["step"], row["time"]
            assert isinstance(figures, Mapping)
            assert isinstance(step, int)
            assert isinstance(time, int)
            self._curve(str(row["controller"]), {k: float(str(v)) for k, v in figures.items()}, step, time)
        begun, ended = times_of(metrics.parent)
        for report in reports:
            name, about = self._training(report["controller"]), {"learner": report["learner"]}
            self._params(name, {"kind": "controller", "subject": report["controller"], **about}, begun)
            steps = report["control_steps"]
            final = {"success": report["success"], "env_steps": steps, "episodes": report["starts"]}
            self._metrics(name, {**final, "warm_success": report["warm_success"]}, steps)
            self._finished(name, ended)
            self._count(f"controller {report['controller']}")

    def _curve(self, controller: str, metrics: Mapping[str, float], step: int, time: int) -> None:
        name = self._training(controller)
        for key, value in metrics.items():
            point: Record = {"run": name, "kind": "metric", "key": f"curve/{key}", "value": value}
            self._append({**point, "step": step, "time": time})

    def _training(self, controller: str) -> str:
        """Name the run of a controller's present training; one that is trained again gets another run."""
        before = self._counts.get(f"controller {controller}", 0)
        return f"controller {controller}" if before == 0 else f"controller {controller}, training {before + 1}"

    def _refined(self, event: Refined) -> None:
        refinement, name = event.refinement, f"refinement {self._count('refinement')}"
        tried = self._last
        assert tried is not None, "a refinement follows a rollout"
        about = {"goal": refinement.psi, "subgoal": refinement.node.name, "loop": str(refinement.node.circular)}
        phi = text(refinement.node.predicate)
        own = {"kind": "refinement", "subject": refinement.node.name, "predicate": phi, **about}
        self._params(name, own, times_of(tried.table.parent)[0])
        self.subgoals += ((refinement.psi, refinement.node.name, phi),)
        counts = tried.counts
        figures = {"success": _rate(counts), "episodes": counts["episodes"], "env_steps": counts["control_steps"]}
        samples = {"negatives": refinement.negatives, "positives": refinement.positives}
        parsed = {"explained": event.explained, "demonstrations": event.demonstrations}
        self._metrics(name, {**figures, **samples, **parsed}, 0)
        self._metrics(PARENT, {"refinements": self._counts["refinement"]}, self.env_steps)
        passed: Json = {"columns": ["predicate", "why not"], "data": [list(pair) for pair in refinement.passed_over]}
        self._table(name, self._file(f"{name}/passed_over.json", _json_bytes(passed)))
        rows: list[Json] = [[_cell(getattr(c, column)) for column in _COLUMNS] for c in refinement.table]
        table: Json = {"columns": list(_COLUMNS), "data": rows}
        self._table(name, self._file(f"{name}/predicates.json", _json_bytes(table)))
        self._table(name, tried.table)
        self._note(name, "artifact", "refinement", str(event.table), folder="")
        self._tree(name, self._file(f"{name}/{TREE}", _json_bytes(tree_to_json(event.tree))))
        self._finished(name, _modified(event.table))

    def _evaluated(self, figures: Mapping[str, Any], table: Path) -> None:
        begun, ended = times_of(table.parent)
        self._params(EVALUATION, {"kind": "evaluation", "subject": "program"}, begun)
        shown = {key: figures[key] for key in ("success", "ci_low", "ci_high", "episodes", "diverged")}
        seconds = read_json(table.parent / TIMING)["wall_seconds"]
        shown |= {"env_steps": figures["control_steps"], "wall_seconds": seconds}
        self._metrics(EVALUATION, shown, int(figures["control_steps"]))
        self._table(EVALUATION, table)
        self._finished(EVALUATION, ended)

    def _finished(self, run: str, when: int) -> None:
        """Journal the end of a part, at its true time: what was found in the store was done before this attempt."""
        self._note(run, "status", "FINISHED", "FINISHED", time=when)

    def _tree(self, run: str, path: Path) -> None:
        self._note(run, "artifact", "tree", str(path), folder="")
        self._note(run, "picture", "tree", str(path))

    def _table(self, run: str, path: Path) -> None:
        self._note(run, "table", path.name, str(path))

    def _params(self, run: str, own: Mapping[str, str], when: int | None = None) -> None:
        """Journal parameters; the first record of a run says when it began."""
        time = {} if when is None else {"time": when}
        for key, value in {**self.params, **own}.items():
            self._note(run, "param", key, value, **time)

    def _metrics(self, run: str, metrics: Mapping[str, float], step: int) -> None:
        for key, value in metrics.items():
            self._append({"run": run, "kind": "metric", "key": key, "value": float(value), "step": step})

    def _note(self, run: str, kind: str, key: str, value: str, step: int = 0, **more: Json) -> None:
        self._append({"run": run, "kind": kind, "key": key, "value": value, "step": step, **more})

    def _append(self, record: Record) -> None:
        self._journal.append(record)

    def _file(self, name: str, data: bytes) -> Path:
        """Write a file of the run's own."""
        path = self.directory.resolve() / "files" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, data)
        return path

    def _count(self, what: str) -> int:
        self._counts[what] = self._counts.get(what, 0) + 1
        return self._counts[what]


def times_of(out: Path) -> tuple[int, int]:
    """Return when a stage began and ended, milliseconds since 1970, whichever attempt ran it."""
    ended = _modified(out / TIMING)
    return ended - round(1000 * float(read_json(out / TIMING)["wall_seconds"])), ended


def _modified(path: Path) -> int:
    """Return when a file was written, milliseconds since 1970."""
    return path.stat().st_mtime_ns // 1_000_000


def spent(records: Iterable[Record]) -> float:
    """Add up the seconds of a journal's attempts; one that was killed lasted until its last record."""
    total, began, last = 0.0, None, 0
    for record in records:
        time = int(str(record["time"]))
        if record["run"] == PARENT and record["kind"] == "status" and record["value"] == "RUNNING":
            total, began, last = total + _lasted(began, last), time, time
        last = max(last, time)
    return total + _lasted(began, last)


def _lasted(began: int | None, last: int) -> float:
    """Seconds of an attempt; 0 before the first."""
    return 0.0 if began is None else (last - began) / 1000


def _tried(goal: str, counts: Mapping[str, Any]) -> dict[str, float]:
    """Return the points of the curves of one program that was tried."""
    if goal != GOAL:
        return {"subgoal_success": _rate(counts)}
    low, high = wilson(int(counts["successes"]), int(counts["episodes"]))
    return {"success": _rate(counts), "ci_low": low, "ci_high": high, "episodes": counts["episodes"]}


def _rate(counts: Mapping[str, Any]) -> float:
    return float(counts["successes"]) / float(counts["episodes"])


def _cell(value: object) -> Json:
    return value if isinstance(value, bool | int | float) else str(value)


def _json_bytes(value: Json) -> bytes:
    return json.dumps(value, ensure_ascii=False, indent=1).encode()
