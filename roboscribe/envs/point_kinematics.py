"""How the plane of `point_world` moves: dragging with fingers, pushing without."""

from __future__ import annotations

import numpy as np

from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, Layout

STEP = 0.05
"""Greatest displacement of the gripper in one control step, metres per axis."""
REACH = 0.03
"""Distance within which closed fingers drag an object, and within which a finger-less gripper pushes, metres."""
GRASP = 0.01
"""Distance to which a dragged object settles in the fingers, metres."""
SUBSTEPS = 5
"""Parts of a step in which pushing is resolved, so that the gripper cannot jump over what it touches."""
TRAVEL = 0.2
"""Opening of a drawer, metres."""
LOW, HIGH = -0.2, 2.0
"""Where the gripper can be, metres."""


def advance(layout: Layout, fingers: bool, states: FloatArray, actions: FloatArray) -> FloatArray:
    """Apply one control step.

    Args:
        layout: meaning of the states; entities of type "drawer" slide, all others are free.
        fingers: whether the gripper can grasp; else it pushes.
        states: (..., F).
        actions: (..., A), leading axes broadcast with those of the states.

    Returns:
        The next states (..., F).
    """
    leading = np.broadcast_shapes(states.shape[:-1], actions.shape[:-1])
    after = np.array(np.broadcast_to(states, (*leading, layout.size)))
    actions = np.clip(actions, -1.0, 1.0)
    hand = layout.columns[ROBOT, "position", False]
    before = after[..., hand].copy()
    moved = np.clip(before + STEP * actions[..., :2], LOW, HIGH)
    after[..., hand] = moved
    if fingers:
        closed = np.broadcast_to(actions[..., 2] > 0.0, leading)
        after[..., layout.columns[ROBOT, "opening", False]] = np.where(closed, 0.0, 1.0)[..., None]
        _drag(layout, after, before, moved, closed)
    else:
        for part in range(1, SUBSTEPS + 1):
            _push(layout, after, before + (moved - before) * part / SUBSTEPS)
    return after


def _drag(layout: Layout, after: FloatArray, before: FloatArray, moved: FloatArray, closed: BoolArray) -> None:
    """Take along the nearest object within reach of closed fingers."""
    places = [after[..., layout.columns[i, "position", False]] for i in range(len(layout.entities))]
    away = np.stack([np.hypot(*np.moveaxis(place - before, -1, 0)) for place in places])
    nearest = away.argmin(axis=0)
    held = closed & (away.min(axis=0) < REACH)
    for i in np.unique(nearest[held]).tolist():
        mine = held & (nearest == i)
        if layout.entities[i].name == "drawer":
            _slide(layout, i, after, mine, (moved - before)[..., 0])
        else:
            offset = (places[i] - before)[mine]
            settled = offset * np.minimum(1.0, GRASP / np.maximum(away[i][mine], 1e-12))[:, None]
            after[mine, layout.columns[i, "position", False]] = moved[mine] + settled


def _slide(layout: Layout, drawer: int, after: FloatArray, mine: BoolArray, along: FloatArray) -> None:
    """Open or close a drawer by its handle, as far as it goes."""
    opening = layout.columns[drawer, "opening", False].start
    change = np.clip(after[mine, opening] + along[mine], 0.0, TRAVEL) - after[mine, opening]
    after[mine, opening] += change
    after[mine, layout.columns[drawer, "position", False].start] += change


def _push(layout: Layout, after: FloatArray, moved: FloatArray) -> None:
    """Move every object out of the gripper's way."""
    for i in range(len(layout.entities)):
        place = layout.columns[i, "position", False]
        offset = after[..., place] - moved
        length = np.hypot(offset[..., 0], offset[..., 1])
        touched = length < REACH
        unit = offset[touched] / np.maximum(length[touched], 1e-12)[:, None]
        after[touched, place] = moved[touched] + REACH * unit
