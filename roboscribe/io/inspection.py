"""What a demonstration file holds, and everything that is wrong with it, found at once.

Reading a file stops at the first problem, as it must: nothing partial is used. Whoever writes a file wants to know all
of them, and what would be right.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from roboscribe.errors import DemonstrationError, Fail
from roboscribe.io.atomic import Json, sha256_of
from roboscribe.io.checksum import Checksum
from roboscribe.io.columns import Column, columns_of
from roboscribe.io.demonstrations import read_demonstrations
from roboscribe.io.episodes import (
    UNREADABLE,
    damage_of,
    damaged,
    groups_of,
    open_episodes,
    open_parquet,
    tables_by_episode,
)
from roboscribe.io.frames import Index, action_values, attribute_values, index_of, snapshot_values
from roboscribe.io.schema import (
    ACTION,
    EPISODE,
    FRAME,
    SNAPSHOT,
    TIMESTAMP,
    column_problems,
    metadata_for,
    metadata_of,
    metadata_problems,
)
from roboscribe.io.validation import check_actions, check_column, screen
from roboscribe.world import Layout, Task
from roboscribe.world.layout import FloatArray

_PLACE = re.compile(r"episode (?P<episode>\d+)(, frame \d+)?, (?P<column>column [^:\[]+)")
_LEAST = 2
"""Demonstrations that learning needs."""


@dataclass(frozen=True)
class Inspection:
    """What was found wrong with a file.

    Args:
        problems: what keeps it from being read, one line each.
        remarks: what is odd, or left out when programs are learned, but no error.
        metadata: key-value metadata that the file should have; empty where its own is right.
    """

    problems: tuple[str, ...]
    remarks: tuple[str, ...]
    metadata: dict[str, str]

    def recipe(self, path: Path) -> str:
        """Spell as Python what gives a file the right metadata; empty where it has them."""
        if not self.metadata:
            return ""
        entries = "".join(f"    {key!r}: {text!r},\n" for key, text in self.metadata.items())
        return (
            "import pyarrow.parquet as pq\n\n"
            f"metadata = {{\n{entries}}}\n"
            f"table = pq.read_table({str(path)!r})\n"
            "table = table.replace_schema_metadata({**(table.schema.metadata or {}), **metadata})\n"
            f"pq.write_table(table, {str(path)!r}, write_page_checksum=True)\n"
        )


def inspect(path: Path, task: Task) -> Inspection:
    """Find everything that is wrong with a demonstration file.

    Numbers are looked at one episode at a time. The same problem of the same column in several episodes is one line.

    Args:
        path: the file.
        task: what it is to show.
    """
    try:
        with open_parquet(path) as (_, file, checksum):
            if checksum is Checksum.BODY_DAMAGED:
                return Inspection((damage_of(file, str(path)),), (), {})
            metadata = metadata_of(file.metadata.metadata)
            wrong = [*metadata_problems(metadata, task)]
            others = [*column_problems(file.schema_arrow, task.layout, metadata)]
            others += _grouped(_number_problems(file, task, str(path)))
            stored = SNAPSHOT.name in file.schema_arrow.names
    except UNREADABLE as error:
        return Inspection((str(damaged(str(path), error)),), (), {})
    except DemonstrationError as error:
        return Inspection((str(error),), (), {})
    right = metadata_for(task, snapshots=stored) if wrong else {}
    problems = tuple(f"{path}: {problem}" for problem in (*wrong, *others))
    return Inspection(problems, (), right) if problems else _screened(path, task)


def describe_file(path: Path, task: Task) -> dict[str, Json]:
    """Describe a demonstration file that can be read.

    Returns:
        File, task, generator, seed, frequency, counts of episodes and frames, lengths, objects, range of every column,
        episodes with actions, with snapshots and that reach the goal, SHA-256 and remarks.

    Raises:
        DemonstrationError: the file cannot be read.
    """
    lengths, solved, acting, stored = [], 0, 0, 0
    low, high = np.full(task.layout.size, np.inf), np.full(task.layout.size, -np.inf)
    with open_episodes(path, task) as file:
        header, remarks = file.header, file.remarks
        for _, trajectory in file.trajectories():
            lengths.append(len(trajectory))
            solved += bool(np.any(task.solved(trajectory.states)))
            acting += trajectory.actions is not None
            stored += trajectory.snapshots is not None
            low, high = np.fmin(low, trajectory.states.min(axis=0)), np.fmax(high, trajectory.states.max(axis=0))
    frames = sum(lengths)
    return {
        "file": str(path), "task": task.name, "generator": header.generator, "seed": header.seed,
        "frequency": task.frequency, "episodes": max(len(header.lengths), len(lengths)), "frames": frames,
        "seconds": round(frames / task.frequency, 3),
        "shortest": min(lengths, default=0), "median": median(lengths or [0]), "longest": max(lengths, default=0),
        "objects": ", ".join(("mu", *task.layout.names)), "reach_the_goal": solved, "with_actions": acting,
        "with_snapshots": stored, "sha256": sha256_of(path), "remarks": list(remarks),
        "columns": {c.name: _range(c, low, high) for c in columns_of(task.layout)},
    }  # fmt: skip


def _range(column: Column, low: FloatArray, high: FloatArray) -> Json:
    """Describe the values of a column: unit, least and greatest value of each number; None where none is given."""
    least, most = ([float(v) if np.isfinite(v) else None for v in bound[column.place]] for bound in (low, high))
    return {"unit": column.attribute.unit, "components": list(column.attribute.components), "min": least, "max": most}


def _screened(path: Path, task: Task) -> Inspection:
    """Read a file without problems, and say what of it learning would leave out."""
    try:
        found = read_demonstrations(path, task)
        chosen = screen(task, found.trajectories, least=_LEAST)
    except DemonstrationError as error:
        return Inspection((f"{path}: {str(error).removeprefix(f'{path}: ')}",), (), {})
    if isinstance(chosen, Fail):
        return Inspection((f"{path}: {chosen.reason}",), found.report, {})
    return Inspection((), (*found.report, *(f"{path}: {line}" for line in chosen.report)), {})


def _number_problems(file: pq.ParquetFile, task: Task, source: str) -> Iterator[str]:
    """Look for problems in the numbers, as far as the columns are there."""
    names = file.schema_arrow.names
    needed = (EPISODE.name, FRAME.name, TIMESTAMP.name)
    if any(names.count(name) != 1 for name in needed):
        return
    wanted = [column.name for column in columns_of(task.layout)] + [ACTION.name, SNAPSHOT.name]
    present = [name for name in wanted if names.count(name) == 1]
    try:
        for number, table in tables_by_episode(groups_of(file, [*needed, *present]), EPISODE.name, source):
            for problem in _episode_problems(table, number, task, source):
                yield problem.removeprefix(f"{source}: ")
    except DemonstrationError as error:
        yield str(error).removeprefix(f"{source}: ")


def _episode_problems(table: pa.Table, number: int, task: Task, source: str) -> Iterator[str]:
    """Look for problems of one episode, the first of each column."""
    try:
        whole = index_of(table, task.frequency, source)
    except DemonstrationError as error:
        yield str(error)
        return
    index = Index(source, whole.episode, whole.frame, whole.slices[-1:])
    where = f"{source}: episode {number}"
    for column in columns_of(task.layout):
        if column.name in table.column_names:
            yield from _column_problem(table, column, index, task.layout, where)
    if ACTION.name in table.column_names:
        yield from _action_problem(table, index, task, where)
    if SNAPSHOT.name in table.column_names:
        yield from _snapshot_problem(table, index)


def _column_problem(table: pa.Table, column: Column, index: Index, layout: Layout, where: str) -> Iterator[str]:
    """Look for the first problem of one column."""
    try:
        states = np.full((len(table), layout.size), np.nan)
        states[:, column.place] = attribute_values(table, column, index)
        check_column(states, column, where)
    except DemonstrationError as error:
        yield str(error)


def _action_problem(table: pa.Table, index: Index, task: Task, where: str) -> Iterator[str]:
    """Look for the first problem of the actions."""
    try:
        for actions in action_values(table, index, task.action_size):
            if actions is not None:
                check_actions(actions, where)
    except DemonstrationError as error:
        yield str(error)


def _snapshot_problem(table: pa.Table, index: Index) -> Iterator[str]:
    """Look for the first problem of the simulator states."""
    try:
        snapshot_values(table, index)
    except DemonstrationError as error:
        yield str(error)


def _grouped(problems: Iterator[str]) -> list[str]:
    """Make one line of what several episodes have in common: the same column, whatever the frame."""
    first: dict[str, str] = {}
    count: Counter[str] = Counter()
    for problem in problems:
        place = _PLACE.match(problem)
        key = place["column"] if place else problem
        first.setdefault(key, problem)
        count[key] += place is not None
    more = {key: f" (and {n - 1} more episode{'s' * (n > 2)})" if n > 1 else "" for key, n in count.items()}
    return [problem + more[key] for key, problem in first.items()]
