"""What changed since the last run of another commit."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from roboscribe.errors import ArtifactError
from roboscribe.stages.runtime.journal import Record, read_records
from roboscribe.stages.tracking.mlflow_store import JOURNAL, PARENT

COMMIT, QUICK, FINISHED = "mlflow.source.git.commit", "quick", "FINISHED"
FILES = "files"
"""Directory of a run's own files."""


@dataclass(frozen=True)
class Earlier:
    """A finished run of an experiment.

    Args:
        commit: of its sources.
        time: when it finished, milliseconds since 1970.
        table: its CSV.
    """

    commit: str
    time: int
    table: Path


def newest(runs: Path, title: str, name: str, commit: str, *, quick: bool) -> Earlier | None:
    """Find the newest finished run of an experiment under another commit, by the journals of the runs.

    Args:
        runs: directory of all runs.
        title: of the experiment.
        name: of its CSV, without the ending.
        commit: of the present sources.
        quick: whether runs that are no results are looked for, or the others.

    Returns:
        The run; None where there is none.
    """
    journals = sorted(runs.glob(f"*/{JOURNAL}"))
    found = (_finished(path, title, name, quick=quick) for path in journals)
    others = [run for run in found if run is not None and run.commit != commit and run.table.is_file()]
    return max(others, key=lambda run: run.time, default=None)


def _finished(path: Path, title: str, name: str, *, quick: bool) -> Earlier | None:
    own = [record for _, record in read_records(path) if record["run"] == PARENT]
    if _value(own, "run", "experiment") != title or _value(own, "param", QUICK) != str(quick):
        return None
    ended = [record for record in own if record["kind"] == "status" and record["value"] == FINISHED]
    if not ended:
        return None
    return Earlier(_value(own, "tag", COMMIT), int(str(ended[-1]["time"])), path.parent / FILES / f"{name}.csv")


def _value(records: Sequence[Record], kind: str, key: str) -> str:
    found = (record["value"] for record in records if record["kind"] == kind and record["key"] == key)
    return str(next(found, ""))


def changes(table: pd.DataFrame, earlier: Earlier | None, keys: Sequence[str]) -> tuple[str, ...]:
    """Name the cells whose Wilson intervals do not overlap with those of an earlier run.

    Args:
        table: final evaluations of this run; `success`, `ci_low` and `ci_high` beside the keys.
        earlier: the run to compare with.
        keys: columns that tell one cell from another.

    Returns:
        Lines of Markdown.

    Raises:
        ArtifactError: the earlier table cannot be read.
    """
    if earlier is None:
        return ("There is no earlier run of another commit.",)
    before = _read(earlier.table)
    absent = [key for key in (*keys, "success", "ci_low", "ci_high") if key not in before]
    if absent:
        return (f"The run of commit {earlier.commit} cannot be compared: its table has no {', '.join(absent)}.",)
    old = {_key(row, keys): row for _, row in _last(before).iterrows()}
    pairs = [(key, old[key], row) for _, row in _last(table).iterrows() if (key := _key(row, keys)) in old]
    moved = [_moved(key, was, row) for key, was, row in pairs if not _overlap(was, row)]
    head = f"{len(pairs)} cells are in the run of commit {earlier.commit or 'unknown'} too; "
    said = f"{len(moved)} of them differ by more than their intervals" if moved else "none differs by more than chance"
    return (f"{head}{said}.", *(f"- {line}" for line in moved))


def _last(table: pd.DataFrame) -> pd.DataFrame:
    return table[table["kind"] == "final"] if "kind" in table else table


def _key(row: pd.Series, keys: Sequence[str]) -> tuple[str, ...]:
    """Spell what tells a cell from others, the same before and after a CSV."""
    return tuple("" if pd.isna(row[key]) else str(row[key]).removesuffix(".0") for key in keys)


def _overlap(was: pd.Series, row: pd.Series) -> bool:
    return bool(was["ci_low"] <= row["ci_high"] and row["ci_low"] <= was["ci_high"])


def _moved(key: tuple[str, ...], was: pd.Series, row: pd.Series) -> str:
    name = ", ".join(part for part in key if part)
    return f"{name}: {100 * was['success']:.1f} % before, {100 * row['success']:.1f} % now"


def _read(path: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(io.BytesIO(path.read_bytes()))
    except (OSError, ValueError) as error:
        msg = f"{path}: cannot be read as a table ({error})"
        raise ArtifactError(msg) from error
