"""Whether demonstrations can be learned from: their numbers, their goals, and how many are left.

`check_trajectory` raises on what no demonstration may contain; `screen` leaves out what is legal but useless, and
answers `Fail` when the demonstrations as a whole cannot show the task. A goal that was not given is NaN throughout
its episode; every other NaN is an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from roboscribe.errors import DemonstrationError, Fail
from roboscribe.io.columns import Column, columns_of, missing
from roboscribe.world import Attribute, Task, Trajectory
from roboscribe.world.layout import BoolArray, FloatArray

_NORM_TOLERANCE = 1e-3
"""Room for quaternions that passed through single precision."""
_LISTED = 5
"""Episodes that one message lists before it says how many more there are."""


@dataclass(frozen=True)
class Screened:
    """Demonstrations to learn from.

    Args:
        kept: the demonstrations, in their order.
        report: one line for each that was left out, or was kept although flawed.
    """

    kept: tuple[Trajectory, ...]
    report: tuple[str, ...]


def screen(
    task: Task, trajectories: Sequence[Trajectory], *, least: int = 2, leave_out: bool = True
) -> Screened | Fail:
    """Choose the demonstrations that show the task being solved.

    Args:
        task: asked whether a demonstration ever reaches the goal.
        trajectories: what was read or collected; their positions are the episode numbers of the report.
        least: count of demonstrations that must be left.
        leave_out: False keeps failed and duplicate ones, and only reports them; those without a step always go.

    Returns:
        What is kept, with a report; Fail when objects or goals disagree, or when none reaches the goal.

    Raises:
        DemonstrationError: fewer than `least` are left.
    """
    disagreement = consistent(trajectories)
    if disagreement:
        return disagreement
    stepless = {i: "one frame only" if len(t) else "empty" for i, t in enumerate(trajectories) if len(t) < 2}
    usable = [i for i in range(len(trajectories)) if i not in stepless]
    failed = {i: "never reaches the goal" for i in usable if not np.any(task.solved(trajectories[i].states))}
    if usable and len(failed) == len(usable):
        return Fail(f"none of the {len(usable)} demonstrations of {task.name} ever reaches the goal")
    flaws = stepless | _duplicates(trajectories, usable) | failed
    kept = [i for i in usable if not (leave_out and i in flaws)]
    report = tuple(f"episode {i}: {flaws[i]}; {'kept' if i in kept else 'left out'}" for i in sorted(flaws))
    if len(kept) < least:
        msg = f"{len(kept)} usable demonstrations of {task.name} found, expected at least {least}"
        raise DemonstrationError("; ".join((msg, *_shortened(report))))
    return Screened(tuple(trajectories[i] for i in kept), report)


def consistent(trajectories: Sequence[Trajectory]) -> Fail | None:
    """Compare objects and goals between demonstrations; the predicates of one program need the same in all.

    Returns:
        None when they agree; Fail with the first disagreement otherwise.
    """
    filled = [(i, trajectory) for i, trajectory in enumerate(trajectories) if len(trajectory)]
    if not filled:
        return None
    first, model = filled[0]
    goals = _goals(model)
    for index, trajectory in filled:
        if trajectory.layout != model.layout:
            found, expected = ", ".join(trajectory.layout.names), ", ".join(model.layout.names)
            return Fail(f"object counts disagree: episode {index} has {found}, episode {first} has {expected}")
        absent = _absent(trajectory)
        if absent:
            return Fail(f"object counts disagree: episode {index} has no {', '.join(absent)}, the task has")
        if _goals(trajectory) != goals:
            odd = ", ".join(sorted(goals ^ _goals(trajectory)))
            return Fail(f"goals disagree: {odd} is given in only one of episodes {first} and {index}")
    return None


def check_trajectory(trajectory: Trajectory, *, episode: int, source: str, action_size: int | None = None) -> None:
    """Refuse numbers that cannot be right.

    Args:
        trajectory: the demonstration.
        episode: its number, for messages.
        source: file or origin, for messages.
        action_size: A that the task expects; None accepts any.

    Raises:
        DemonstrationError: a shape, a NaN or infinity, a value outside its attribute's range, a quaternion that is not
            of unit norm, an action outside [-1, 1]; the message names episode, frame and column.
    """
    where = f"{source}: episode {episode}"
    _check_shapes(trajectory, where, action_size)
    for column in columns_of(trajectory.layout):
        check_column(trajectory.states, column, where)
    if trajectory.actions is not None:
        check_actions(trajectory.actions, where)


def check_column(states: FloatArray, column: Column, where: str) -> None:
    """Refuse numbers of one column of an episode's states (T + 1, F) that cannot be right; `where` is for messages.

    Raises:
        DemonstrationError: as `check_trajectory` has it.
    """
    if column.of_entity and missing(states, column).all():
        return
    values = states[:, column.place]
    _refuse(~np.isfinite(values), values, column, where, "a finite number")
    _check_range(values, column, where)
    if column.attribute.unit == "quaternion":
        _check_norm(values, column, where)


def _duplicates(trajectories: Sequence[Trajectory], usable: Sequence[int]) -> dict[int, str]:
    """Find demonstrations whose states and actions equal those of an earlier one."""
    seen: dict[tuple[bytes, bytes], int] = {}
    found: dict[int, str] = {}
    for index in usable:
        actions = trajectories[index].actions
        key = trajectories[index].states.tobytes(), b"" if actions is None else actions.tobytes()
        if seen.setdefault(key, index) != index:
            found[index] = f"duplicate of episode {seen[key]}"
    return found


def _shortened(report: Sequence[str]) -> Iterator[str]:
    """Give the first lines of a report and the count of the others."""
    yield from report[:_LISTED]
    if len(report) > _LISTED:
        yield f"and {len(report) - _LISTED} more"


def _goals(trajectory: Trajectory) -> frozenset[str]:
    """Name the goal columns that are given."""
    goals = (column for column in columns_of(trajectory.layout) if column.goal)
    return frozenset(column.name for column in goals if not missing(trajectory.states, column).all())


def _absent(trajectory: Trajectory) -> tuple[str, ...]:
    """Name the entities whose own attributes have no value."""
    own = (column for column in columns_of(trajectory.layout) if column.of_entity and not column.goal)
    gone = (column.owner for column in own if missing(trajectory.states, column).all())
    return tuple(dict.fromkeys(gone))


def _check_shapes(trajectory: Trajectory, where: str, action_size: int | None) -> None:
    """Refuse arrays whose shapes or types do not fit together."""
    length, states, actions = len(trajectory), trajectory.states, trajectory.actions
    wanted = (length, trajectory.layout.size)
    if states.shape != wanted or states.dtype != np.float64:
        _complain(where, f"states: found {states.dtype}{states.shape}, expected float64{wanted}")
    if actions is not None:
        width = actions.shape[-1:] if action_size is None else (action_size,)
        fitting = (max(length - 1, 0), *width)
        if actions.shape != fitting or actions.ndim != 2 or actions.dtype != np.float64:
            _complain(where, f"actions: found {actions.dtype}{actions.shape}, expected float64{fitting}")
    snapshots = trajectory.snapshots
    if snapshots is not None and (snapshots.ndim != 2 or len(snapshots) != length or snapshots.dtype != np.float64):
        _complain(where, f"snapshots: found {snapshots.dtype}{snapshots.shape}, expected float64({length}, S)")


def _check_range(values: FloatArray, column: Column, where: str) -> None:
    """Refuse values outside the attribute's range, and guess which unit they are in."""
    attribute = column.attribute
    wrong = (values < attribute.low) | (values > attribute.high)
    if wrong.any():
        expected = f"{attribute.low:g} to {attribute.high:g} {attribute.unit}"
        _refuse(wrong, values, column, where, expected + _guess(float(values[wrong][0]), attribute))


def _guess(value: float, attribute: Attribute) -> str:
    """Name the unit in which a value would be in range, for a message."""
    guesses = {"m": ("millimetres", 1e-3), "rad": ("degrees", pi / 180)}
    name, factor = guesses.get(attribute.unit.removesuffix("/s"), ("", 0.0))
    return f" (is it in {name}?)" if name and attribute.low <= value * factor <= attribute.high else ""


def _check_norm(values: FloatArray, column: Column, where: str) -> None:
    """Refuse quaternions that are not of unit norm."""
    norms = np.linalg.norm(values, axis=1)
    wrong = np.abs(norms - 1.0) > _NORM_TOLERANCE
    if wrong.any():
        frame = int(wrong.argmax())
        _complain(f"{where}, frame {frame}, column {column.name}", f"found norm {norms[frame]:g}, expected 1")


def check_actions(actions: FloatArray, where: str) -> None:
    """Refuse actions (T, A) that are no numbers in [-1, 1]; `where` is for messages.

    Raises:
        DemonstrationError: as `check_trajectory` has it.
    """
    wrong = ~(np.abs(actions) <= 1.0)
    if wrong.any():
        frame, index = np.argwhere(wrong)[0]
        place = f"{where}, frame {frame}, column action[{index}]"
        _complain(place, f"found {actions[frame, index]:g}, expected a number from -1 to 1")


def _refuse(wrong: BoolArray, values: FloatArray, column: Column, where: str, expected: str) -> None:
    """Raise at the first wrong number of a column (T + 1, w), if there is one."""
    if wrong.any():
        frame, index = np.argwhere(wrong)[0]
        place = f"{where}, frame {frame}, column {column.component(index)}"
        _complain(place, f"found {values[frame, index]:g}, expected {expected}")


def _complain(place: str, what: str) -> None:
    """Raise the one error of this module."""
    msg = f"{place}: {what}"
    raise DemonstrationError(msg)
