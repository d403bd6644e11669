"""Tracking an experiment of many evaluations as one run of MLflow, by way of a journal as syntheses do."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

from roboscribe.io.atomic import write_files
from stages.journal import Journal
from stages.mlflow_store import JOURNAL, PARENT, open_copier, run_id_of, unreachable
from stages.tracking import IDENTITY

log = logging.getLogger(__name__)


def track_experiment(
    directory: Path,
    mlruns: Path,
    title: str,
    experiment: str,
    params: Mapping[str, str],
    metrics: Mapping[str, float],
    files: Mapping[str, bytes],
) -> str | None:
    """Journal a finished experiment and copy it into MLflow; telling the same again changes nothing.

    Args:
        directory: of the run; keeps the journal and the files.
        mlruns: directory of the tracking store.
        title: how the run is called.
        experiment: group of runs.
        params: by name.
        metrics: by name.
        files: content of the artifacts by name.

    Returns:
        MLflow's run id; None where the store could not be reached, `roboscribe ui` copies the journal then.
    """
    kept = directory.resolve() / "files"
    kept.mkdir(parents=True, exist_ok=True)
    write_files({kept / name: data for name, data in files.items()})
    journal = Journal(directory / JOURNAL, IDENTITY)

    def note(kind: str, key: str, value: str | float, folder: str = "") -> None:
        journal.append({"run": PARENT, "kind": kind, "key": key, "value": value, "step": 0, "folder": folder})

    note("run", "title", title)
    note("run", "experiment", experiment)
    for name, text in params.items():
        note("param", name, text)
    for name, value in metrics.items():
        note("metric", name, value)
    for name in files:
        note("artifact", name, str(kept / name))
    note("status", "FINISHED", "FINISHED")
    try:
        open_copier(directory, mlruns).copy()
    except unreachable() as error:
        line = str(error).splitlines()[0]
        log.warning("the tracking store %s is behind (%s); the journal %s is kept", mlruns, line, journal.path)
    return run_id_of(directory)
