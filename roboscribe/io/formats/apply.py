"""From recordings of another program to trajectories of a task, by a mapping."""

from __future__ import annotations

from typing import NoReturn, assert_never

import numpy as np

from roboscribe.errors import DemonstrationError
from roboscribe.io.columns import columns_of
from roboscribe.io.formats.foreign import ACTION, SNAPSHOT, Contents, Recording
from roboscribe.io.formats.mapping import Absent, ColumnMapping, Constant, Given, Origin, RateOf
from roboscribe.world import Attribute, Task, Trajectory
from roboscribe.world.layout import FloatArray
from roboscribe.world.units import is_angle, turn


def check_widths(recording: Recording, contents: Contents, *, episode: int, source: str) -> None:
    """Refuse a recording in which a column has another count of numbers than the file says.

    Raises:
        DemonstrationError: with what was found and what was expected.
    """
    for field in contents.fields:
        found = recording[field.name].shape[1] if field.name in recording else field.width
        if found != field.width:
            where = f"{source}: episode {episode}, column {field.name}"
            _complain(where, f"found {found} numbers in a row, expected {field.width} as the file says of it")


def trajectory_of(
    recording: Recording, mapping: ColumnMapping, task: Task, *, length: int, episode: int, source: str
) -> Trajectory:
    """Build one trajectory.

    A recording may have as many actions as frames; what was done at the last frame shows in none, and is left out.

    Args:
        recording: columns of the file.
        mapping: says what they hold.
        task: says which columns a state has.
        length: count of frames.
        episode: number of the episode, for messages.
        source: file, for messages.

    Raises:
        DemonstrationError: a column is missing in this episode, or has another count of rows or numbers.
    """
    where = f"{source}: episode {episode}"
    states = np.full((length, task.layout.size), np.nan)
    rates = []
    for column in columns_of(task.layout):
        origin = mapping.origins[column.name]
        if isinstance(origin, RateOf):
            rates.append((column, origin))
        else:
            values = _values(origin, recording, length, f"{where}, column {column.name}")
            if values is not None:
                states[:, column.place] = values
    places = {column.name: column for column in columns_of(task.layout)}
    for column, rate in rates:
        of = places[rate.column]
        states[:, column.place] = _rate(states[:, of.place], of.attribute, task.frequency)
    actions = _optional(mapping.origins[ACTION], recording, length, f"{where}, column {ACTION}", action=True)
    snapshots = _optional(mapping.origins[SNAPSHOT], recording, length, f"{where}, column {SNAPSHOT}", action=False)
    return Trajectory(task.layout, states, actions, snapshots)


def _values(origin: Origin, recording: Recording, length: int, where: str) -> FloatArray | None:
    """Take the values of one column (n, w); None where there are none."""
    match origin:
        case Given(pieces, scale):
            parts = []
            for piece in pieces:
                values = recording.get(piece.column)
                if values is None:
                    _complain(where, f"found no {piece.column}, expected it as in the first episode")
                if len(values) != length or values.shape[1] <= max(piece.picks):
                    expected = f"{length} rows of at least {max(piece.picks) + 1} numbers"
                    _complain(
                        where, f"found {len(values)} rows of {values.shape[1]} in {piece.column}, expected {expected}"
                    )
                parts.append(values[:, piece.picks])
            joined: FloatArray = np.concatenate(parts, axis=1)
            return joined if scale == 1.0 else joined * scale
        case Constant(numbers):
            return np.broadcast_to(np.array(numbers), (length, len(numbers)))
        case Absent():
            return None
        case RateOf():
            raise AssertionError
    assert_never(origin)


def _optional(origin: Origin, recording: Recording, length: int, where: str, *, action: bool) -> FloatArray | None:
    """Take actions (T, A) or snapshots (T + 1, S); None where the file, or this episode, has none."""
    if not isinstance(origin, Given) or any(piece.column not in recording for piece in origin.pieces):
        return None
    rows = len(recording[origin.pieces[0].column])
    values = _values(origin, recording, rows if action and rows in (length, length - 1) else length, where)
    kept = values[: length - 1] if values is not None and action else values
    return None if kept is None or np.isnan(kept).all() else kept


def _rate(values: FloatArray, attribute: Attribute, frequency: float) -> FloatArray:
    """Work out the change per second (n, w) from frame to frame; the first frame has that of the second.

    Angles take the short way round.
    """
    steps = np.diff(values, axis=0)
    if is_angle(attribute.unit):
        steps -= turn(attribute.unit) * np.round(steps / turn(attribute.unit))
    first = steps[:1] if len(steps) else np.zeros((1, values.shape[1]))
    rates: FloatArray = np.concatenate([first, steps])[: len(values)] * frequency
    return rates


def _complain(where: str, what: str) -> NoReturn:
    """Raise the one error of this module."""
    msg = f"{where}: {what}"
    raise DemonstrationError(msg)
