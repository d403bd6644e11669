"""Tracking an experiment of many evaluations as one run of MLflow, by way of a journal as syntheses do."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from roboscribe.io.atomic import write_files
from roboscribe.stages.runtime.journal import Journal
from roboscribe.stages.tracking.mlflow_store import JOURNAL, PARENT, open_sync, run_id_of, unreachable
from roboscribe.stages.tracking.tracker import IDENTITY

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ChildRun:
    """One part of an experiment, tracked as a child run.

    Args:
        name: of the run.
        params: by name.
        metrics: figures of its end, by name.
        curve: success by control steps.
        demonstrations: SHA-256 of what it learned from; "" where there was nothing.
        tags: by name.
    """

    name: str
    params: Mapping[str, str]
    metrics: Mapping[str, float]
    curve: tuple[tuple[int, float], ...] = ()
    demonstrations: str = ""
    tags: Mapping[str, str] = field(default_factory=dict)


def track_experiment(
    directory: Path,
    mlruns: Path,
    title: str,
    experiment: str,
    params: Mapping[str, str],
    metrics: Mapping[str, float],
    files: Mapping[str, bytes],
    tags: Mapping[str, str] | None = None,
    children: Sequence[ChildRun] = (),
) -> str | None:
    """Journal a finished experiment and copy it into MLflow; doing so again changes nothing.

    Args:
        directory: of the run; keeps the journal and the files.
        mlruns: directory of the tracking store.
        title: how the run is called.
        experiment: group of runs.
        params: by name.
        metrics: by name.
        files: content of the artifacts by name.
        tags: by name.
        children: its parts, each a run of its own.

    Returns:
        MLflow's run id; None where the store could not be reached, `roboscribe ui` copies the journal then.
    """
    kept = directory.resolve() / "files"
    kept.mkdir(parents=True, exist_ok=True)
    write_files({kept / name: data for name, data in files.items()})
    journal = Journal(directory / JOURNAL, IDENTITY)
    note = _JournalWriter(journal, PARENT)
    note("run", "title", title)
    note("run", "experiment", experiment)
    note.all("param", params)
    note.all("metric", metrics)
    note.all("tag", tags or {})
    for name in files:
        note("artifact", name, str(kept / name))
    for child in children:
        _tell(_JournalWriter(journal, child.name), child)
    note("status", "FINISHED", "FINISHED")
    try:
        open_sync(directory, mlruns).copy()
    except unreachable() as error:
        line = str(error).splitlines()[0]
        log.warning("the tracking store %s is behind (%s); the journal %s is kept", mlruns, line, journal.path)
    return run_id_of(directory)


@dataclass(frozen=True)
class _JournalWriter:
    """Appends the records of one run to the journal."""

    journal: Journal
    run: str

    def __call__(self, kind: str, key: str, value: str | float, step: int = 0) -> None:
        self.journal.append({"run": self.run, "kind": kind, "key": key, "value": value, "step": step, "folder": ""})

    def all(self, kind: str, values: Mapping[str, str] | Mapping[str, float]) -> None:
        for key, value in values.items():
            self(kind, key, value)


def _tell(note: _JournalWriter, child: ChildRun) -> None:
    """Journal a part of an experiment."""
    note.all("param", child.params)
    note.all("metric", child.metrics)
    for steps, success in child.curve:
        note("metric", "curve/success", success, steps)
    if child.demonstrations:
        note("input", "demonstrations", child.demonstrations)
    note.all("tag", child.tags)
    note("status", "FINISHED", "FINISHED")
