"""Tracking stores for tests."""

from __future__ import annotations

import atexit
import shutil
import sqlite3
import tempfile
from functools import cache
from pathlib import Path

from roboscribe.io.tracked import DATABASE
from roboscribe.stages.tracking.mlflow_store import ensure_store


@cache
def _template() -> Path:
    """Create an empty store, which takes seconds, once."""
    directory = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    ensure_store(directory)
    return directory / DATABASE


def empty_store(mlruns: Path) -> Path:
    """Put an empty store into a directory."""
    mlruns.mkdir(parents=True, exist_ok=True)
    shutil.copy(_template(), mlruns / DATABASE)
    return mlruns


def rows(mlruns: Path, query: str) -> list[tuple[object, ...]]:
    """Ask a store's database, past MLflow."""
    with sqlite3.connect(f"file:{mlruns / DATABASE}?mode=ro", uri=True) as database:
        return database.execute(query).fetchall()


def statuses(mlruns: Path) -> dict[object, object]:
    """Return the status of every run by its name."""
    return dict(rows(mlruns, "select name, status from runs"))  # type: ignore[arg-type]  # two columns


def points(mlruns: Path, key: str) -> list[tuple[object, ...]]:
    """Return run name, step and value of a metric, in order."""
    query = f"select r.name, m.step, m.value from metrics m join runs r using (run_uuid) where m.key = '{key}'"
    return sorted(rows(mlruns, query))
