"""What is run in an experiment, and one row for every evaluation of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from roboscribe.defaults import EVALUATION_EPISODES, N_DEMONSTRATIONS, ROLLOUT_EPISODES
from roboscribe.io.atomic import Json
from roboscribe.stages.runtime.files import read_json, write_json
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.success_rate import wilson

OURS = "roboscribe"
CELL = "cell.json"
"""File in which a cell keeps its record."""
ON_THE_WAY, FINAL = "on the way", "final"
NO_PROGRAM, GIVEN_UP = "no program", "given up"
COLUMNS = (
    "task", "method", "profile", "seed", "control_steps", "successes", "episodes", "success", "ci_low", "ci_high",
    "wall_seconds", "demonstrations", "contact", "timing", "budget", "quick", "commit",
    "kind", "ended", "refinements", "n_demonstrations", "style", "failing",
)  # fmt: skip
"""Columns of a report; those of the second line of names say what was used, those of the third what it was for."""
CELL_COLUMNS = (
    "task",
    "method",
    "profile",
    "seed",
    "contact",
    "timing",
    "budget",
    "n_demonstrations",
    "style",
    "failing",
)
"""What tells one cell from another in every report."""
Row: TypeAlias = dict[str, object]


@dataclass(frozen=True)
class Trial:
    """One method on one task from one seed.

    Args:
        task: where.
        method: "roboscribe" or the name of a baseline.
        profile: what programs may be learned from; "" for baselines, whose method says it.
        seed: decides everything.
        budget: steps of learning: control steps per skill of a program or of a whole baseline, gradient steps of a
            clone; None is what is usual.
        n_demonstrations: how many are given.
        style: in which they are given.
        failing: share of them that fails.
        evaluation_episodes: of the final evaluation.
        rollout_episodes: of each evaluation on the way.
        quick: whether it is no result.
    """

    task: TaskConfig
    method: str = OURS
    profile: str = "actions"
    seed: int = 0
    budget: int | None = None
    n_demonstrations: int = N_DEMONSTRATIONS
    style: str = "default"
    failing: float = 0.0
    evaluation_episodes: int = EVALUATION_EPISODES
    rollout_episodes: int = ROLLOUT_EPISODES
    quick: bool = False

    def __str__(self) -> str:
        """Name the cell as its task run and its child run are named."""
        own = () if self.profile in ("", "actions") else (self.profile,)
        few = () if self.n_demonstrations == N_DEMONSTRATIONS else (f"{self.n_demonstrations} demonstrations",)
        how = () if self.style == "default" else (self.style,)
        bad = () if not self.failing else (f"{self.failing:.0%} failing",)
        return " ".join((self.method, self.task.name, *own, *few, *how, *bad, f"seed {self.seed}"))


@dataclass(frozen=True)
class EvaluationPoint:
    """One evaluation.

    Args:
        control_steps: that the method had used.
        successes: of the evaluation.
        episodes: of the evaluation.
        seconds: that the method had taken; None where that is not known.
        final: whether it is the last one.
    """

    control_steps: int
    successes: int
    episodes: int
    seconds: float | None
    final: bool = False


@dataclass(frozen=True)
class Record:
    """What a cell found.

    Args:
        points: evaluations, in the order of their control steps; the last one is final.
        profile: what was learned from.
        demonstrations: SHA-256 of the demonstrations; "" where there are none.
        commit: of the sources that computed it.
        refinements: executions of Algorithm 2, line 9; None for baselines.
        ended: "", "no program" or "given up".
        reason: of an end before the time.
    """

    points: tuple[EvaluationPoint, ...]
    profile: str
    demonstrations: str
    commit: str
    refinements: int | None = None
    ended: str = ""
    reason: str = ""


def write_record(out: Path, record: Record) -> None:
    """Write `cell.json`."""
    value: Json = {**asdict(record), "points": [asdict(point) for point in record.points]}
    write_json(out / CELL, value)


def read_record(out: Path) -> Record:
    """Read `cell.json`.

    Raises:
        ArtifactError: it cannot be read.
    """
    value: Mapping[str, Any] = read_json(out / CELL)
    return Record(**{**value, "points": tuple(EvaluationPoint(**point) for point in value["points"])})


def rows_of(trial: Trial, record: Record) -> list[Row]:
    """Make one row of every evaluation of a cell."""
    return [_row(trial, record, point) for point in record.points]


def _row(trial: Trial, record: Record, point: EvaluationPoint) -> Row:
    low, high = wilson(point.successes, point.episodes)
    values: Row = {
        "task": trial.task.name,
        "method": trial.method,
        "profile": record.profile,
        "seed": trial.seed,
        "control_steps": point.control_steps,
        "successes": point.successes,
        "episodes": point.episodes,
        "success": point.successes / point.episodes,
        "ci_low": round(low, 6),
        "ci_high": round(high, 6),
        "wall_seconds": None if point.seconds is None else round(point.seconds, 1),
        "demonstrations": record.demonstrations,
        "contact": trial.task.contact,
        "timing": trial.task.timing,
        "budget": "default" if trial.budget is None else str(trial.budget),
        "quick": trial.quick,
        "commit": record.commit,
        "kind": FINAL if point.final else ON_THE_WAY,
        "ended": record.ended if point.final else "",
        "refinements": record.refinements if point.final else None,
        "n_demonstrations": trial.n_demonstrations,
        "style": trial.style,
        "failing": trial.failing,
    }
    return {name: values[name] for name in COLUMNS}


def tabulate(rows: Iterable[Row]) -> pd.DataFrame:
    """Make a table of rows; refinements are whole numbers or missing."""
    return pd.DataFrame(list(rows), columns=list(COLUMNS)).astype({"refinements": "Int64"})


def finals(table: pd.DataFrame) -> pd.DataFrame:
    """Return the last evaluation of every cell."""
    return table[table["kind"] == FINAL]


def line_name(method: str, profile: str) -> str:
    """Name a method in a report: programs by what they were learned from."""
    return f"{method}, {profile}" if method == OURS else method


def named_lines(table: pd.DataFrame) -> pd.DataFrame:
    """Add a column with the name of each row's method in a report."""
    names = [line_name(method, profile) for method, profile in zip(table["method"], table["profile"], strict=True)]
    return table.assign(line=names)


def in_order(names: Iterable[str], order: Sequence[str]) -> list[str]:
    """Sort names: the known ones in their order, then the others as they come."""
    distinct = list(dict.fromkeys(names))
    return [name for name in order if name in distinct] + [name for name in distinct if name not in order]
