"""A small task, its demonstrations, and the ways in which tests damage files."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from roboscribe.io import atomic, write_demonstrations
from roboscribe.world import Attribute, Layout, ObjectType, Trajectory, World
from roboscribe.world.layout import BoolArray, FloatArray
from roboscribe.world.task import Task

POSITION = Attribute("position", ("x", "y", "z"), "m", -2.0, 2.0)
ROBOT = ObjectType("robot", (POSITION, Attribute("opening", ("opening",), "m", 0.0, 0.08)))
BOX = ObjectType(
    "box",
    (
        POSITION,
        Attribute("orientation", ("w", "x", "y", "z"), "quaternion"),
        Attribute("tilt", ("tilt",), "rad", -4, 4),
    ),
    goal=(POSITION,),
)
LAYOUT = Layout(ROBOT, (BOX, BOX))
B1, B2 = (LAYOUT.columns[i, "position", False] for i in (0, 1))
G1, G2 = (LAYOUT.columns[i, "position", True] for i in (0, 1))


@dataclass(frozen=True)
class Carry(Task):
    """Bring both boxes within 5 cm of their goals."""

    name: str = "carry-2"
    layout: Layout = LAYOUT
    action_size: int = 4
    horizon: int = 50
    frequency: float = 25.0

    def solved(self, states: FloatArray) -> BoolArray:
        """Both boxes are near; a goal that is not given is never reached."""
        near = [np.linalg.norm(states[..., b] - states[..., g], axis=-1) < 0.05 for b, g in ((B1, G1), (B2, G2))]
        return np.asarray(near[0] & near[1])

    def world(self, batch: int) -> World:
        """Not simulated."""
        raise NotImplementedError

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Carry the boxes on straight lines."""
        return [carried(seed + i) for i in range(episodes)]


TASK = Carry()


def carried(seed: int, length: int = 12, *, reach: float = 1.0, actions: bool = True) -> Trajectory:
    """One episode of `length` frames in which both boxes go the part `reach` of their way to the goal."""
    rng = np.random.default_rng(seed)
    states = np.zeros((length, LAYOUT.size))
    states[:, LAYOUT.columns[-2, "position", False]] = rng.uniform(-1, 1, (length, 3))
    part = np.linspace(0.0, reach, length)[:, None]
    for box, goal in ((B1, G1), (B2, G2)):
        start, end = rng.uniform(-1.0, 0.0, 3), rng.uniform(0.5, 1.0, 3)
        states[:, box], states[:, goal] = start + part * (end - start), end
    for index in (0, 1):
        states[:, LAYOUT.columns[index, "orientation", False].start] = 1.0
    snapshots = rng.normal(size=(length, 7))
    return Trajectory(LAYOUT, states, rng.uniform(-1, 1, (length - 1, 4)) if actions else None, snapshots)


def write(path: Path, trajectories: Sequence[Trajectory]) -> Path:
    """Write demonstrations of the task."""
    write_demonstrations(path, TASK.name, LAYOUT, TASK.frequency, trajectories, generator="examples", seed=1)
    return path


def rewrite(path: Path, change: Callable[[pa.Table], pa.Table]) -> Path:
    """Pass a file through another program, which keeps the metadata and drops the seal."""
    table = change(pq.read_table(path))
    pq.write_table(table, path, write_page_checksum=True)
    return path


def replaced(table: pa.Table, column: str, values: Sequence[object], kind: pa.DataType | None = None) -> pa.Table:
    """Replace a whole column."""
    place = table.column_names.index(column)
    field = table.schema.field(column)
    field = field if kind is None else field.with_type(kind)
    return table.set_column(place, field, pa.array(values, field.type))


def mapped(table: pa.Table, column: str, change: Callable[[int, Any], object]) -> pa.Table:
    """Replace each value of a column by a function of its row and itself."""
    values = [change(row, value) for row, value in enumerate(table.column(column).to_pylist())]
    return replaced(table, column, values)


def same(left: Sequence[Trajectory], right: Sequence[Trajectory]) -> bool:
    """Whether two lists of trajectories hold the same bits."""
    return [_bits(t) for t in left] == [_bits(t) for t in right]


def _bits(trajectory: Trajectory) -> tuple[object, ...]:
    """All bits of a trajectory."""
    arrays = (trajectory.states, trajectory.actions, trajectory.snapshots)
    return trajectory.layout, *(None if a is None else (a.shape, a.tobytes()) for a in arrays)


def interrupted(
    step: int, action: Callable[[], object], sent: int = signal.SIGKILL, *, within: str | None = None
) -> int:
    """Run an action in a child process that signals itself before the `step`-th line of `io/atomic.py`.

    Args:
        step: line events to wait for, from 1; 0 never signals.
        action: what the child does.
        sent: signal.
        within: count only lines of this function.

    Returns:
        The child's process number; the caller waits for it.
    """
    child = os.fork()
    if child:
        return child
    lines = iter(range(1, sys.maxsize))

    def trace(frame: FrameType, event: str, _: object) -> Any:  # noqa: ANN401 - typeshed wants itself
        if frame.f_code.co_filename != atomic.__file__ or frame.f_code.co_name != (within or frame.f_code.co_name):
            return None
        if event == "line" and next(lines) == step:
            os.kill(os.getpid(), sent)
        return trace

    try:
        sys.settrace(trace)
        action()
        sys.settrace(None)
        os._exit(0)
    finally:
        os._exit(1)


def survived(child: int) -> bool:
    """Wait for a child process; True when it ended by itself and without an error."""
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0
    return not os.WIFSIGNALED(status)


def kill_everywhere(action: Callable[[], object], check: Callable[[], None], *, within: str | None = None) -> int:
    """Kill an action before each line of `io/atomic.py` that it runs, and check after each death.

    Returns:
        How often it was killed before it came through.
    """
    for step in range(1, 10_000):
        done = survived(interrupted(step, action, within=within))
        check()
        if done:
            return step - 1
    raise AssertionError
