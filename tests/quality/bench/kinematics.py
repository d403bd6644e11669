"""How the world of the bench moves: one control step of many states at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from roboscribe.world.layout import ROBOT, BoolArray, FloatArray

if TYPE_CHECKING:
    from tests.quality.bench.task import KinematicTask

STEP = 0.05
"""Greatest displacement of the hand in one control step, metres per axis."""
REACH = 0.03
"""Distance within which closed fingers take hold, and within which a hand without fingers pushes, metres."""
GRASP = 0.01
"""Distance to which an object settles in the fingers, metres."""
TURN = 0.15
"""Greatest angle by which a held object is turned in one control step, radians."""
RADIUS = 0.15
"""Distance between a hinge and its handle, metres."""
TRAVEL = {"extension": 0.25, "depth": 0.25, "angle": 1.6}
"""How far joints go from 0."""
LYING = 0.06
"""Distance from its goal at which an object counts as lying in the container that the goal moves with, metres."""
SUBSTEPS = 5
"""Parts of a step in which pushing is resolved."""
LOW, HIGH = -0.5, 2.5
"""Where the hand can be, metres."""


def advance(task: KinematicTask, states: FloatArray, actions: FloatArray) -> FloatArray:
    """Apply one control step.

    Args:
        task: whose world it is.
        states: (..., F).
        actions: (..., A), leading axes broadcast with those of the states.

    Returns:
        The next states (..., F).
    """
    leading = np.broadcast_shapes(states.shape[:-1], actions.shape[:-1])
    after = np.array(np.broadcast_to(states, (*leading, task.layout.size))).reshape(-1, task.layout.size)
    flat = np.clip(np.broadcast_to(actions, (*leading, task.action_size)).reshape(len(after), -1), -1.0, 1.0)
    before = after[:, task.hand].copy()
    moved = np.clip(before + STEP * flat[:, : task.width], LOW, HIGH)
    after[:, task.hand] = moved
    if task.fingers:
        closed = flat[:, task.width] > 0.0
        after[:, task.place(ROBOT, "opening")] = np.where(closed, 0.0, 1.0)[:, None]
        _hold(task, after, before, flat, closed)
    else:
        for part in range(1, SUBSTEPS + 1):
            _push(task, after, before + (moved - before) * part / SUBSTEPS)
    return after.reshape(*leading, -1)


def _hold(task: KinematicTask, after: FloatArray, before: FloatArray, actions: FloatArray, closed: BoolArray) -> None:
    """Move what the closed fingers hold: the nearest object within reach."""
    held, nearest = _held(task, after, before)
    held &= closed
    for entity in np.unique(nearest[held]).tolist():
        rows = np.flatnonzero(held & (nearest == entity))
        kind = task.entities[entity]
        part, start = after[rows], before[rows]
        if kind.locked_by:
            free = task.unlocked(part, kind)
            rows, part, start = rows[free], part[free], start[free]
        match kind.moves:
            case "grasped":
                _carry(task, part, start, entity)
                _rotate(task, part, actions[rows], entity)
            case "pressed":
                part[:, task.place(entity, kind.scalar)] = 1.0
            case _:
                _move_joint(task, part, start, entity)
        after[rows] = part


def _held(task: KinematicTask, states: FloatArray, hand: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Which object is nearest to the hand (N,), and whether it is within reach."""
    movable = [kind.moves not in ("fixed", "pushed") for kind in task.entities]
    gaps = [
        np.linalg.norm(states[:, task.place(i)] - hand, axis=-1) if can else np.full(len(states), np.inf)
        for i, can in enumerate(movable)
    ]
    return np.asarray(np.min(gaps, axis=0) < REACH), np.argmin(gaps, axis=0)


def _carry(task: KinematicTask, states: FloatArray, before: FloatArray, entity: int) -> None:
    states[:, task.place(entity)] = states[:, task.hand] + _settled(states[:, task.place(entity)] - before)


def _settled(offset: FloatArray) -> FloatArray:
    away = np.linalg.norm(offset, axis=-1, keepdims=True)
    return np.asarray(offset * np.minimum(1.0, GRASP / np.maximum(away, 1e-12)))


def _rotate(task: KinematicTask, states: FloatArray, actions: FloatArray, entity: int) -> None:
    for rank, name in enumerate(task.rotations):
        if name in task.entities[entity].turned:
            column = task.place(entity, name).start
            turned = states[:, column] + TURN * actions[:, task.width + 1 + rank]
            states[:, column] = turned - 2 * np.pi * np.round(turned / (2 * np.pi))


def _move_joint(task: KinematicTask, states: FloatArray, before: FloatArray, entity: int) -> None:
    """Let a joint follow the hand as far as it goes; the hand stays at the handle."""
    along = np.einsum("ni,ni->n", states[:, task.hand] - before, _direction(task, states, entity))
    column = task.place(entity, task.entities[entity].scalar).start
    rate = RADIUS if task.entities[entity].moves == "turns" else 1.0
    offset = _settled(before - states[:, task.place(entity)])
    set_joint(task, states, entity, states[:, column] + along / rate)
    states[:, task.hand] = states[:, task.place(entity)] + offset


def _direction(task: KinematicTask, states: FloatArray, entity: int) -> FloatArray:
    """Return unit vectors (N, w) along which the handle of a joint moves."""
    kind = task.entities[entity]
    unit = np.zeros((len(states), task.width))
    if kind.moves == "slides":
        unit[:, kind.axis] = 1.0
        return unit
    angle = states[:, task.place(entity, kind.scalar).start]
    unit[:, 0], unit[:, -1] = -np.sin(angle), np.cos(angle)
    return unit


def set_joint(task: KinematicTask, states: FloatArray, entity: int, value: FloatArray | float) -> None:
    """Put a joint where it shall be, with its handle and all that lies in it, in states (N, F)."""
    kind = task.entities[entity]
    column = task.place(entity, kind.scalar).start
    before = states[:, column].copy()
    states[:, column] = np.clip(value, 0.0, TRAVEL[kind.scalar])
    change = np.zeros((len(states), task.width))
    if kind.moves == "slides":
        change[:, kind.axis] = states[:, column] - before
    else:
        change[:, 0] = RADIUS * (np.cos(states[:, column]) - np.cos(before))
        change[:, -1] = RADIUS * (np.sin(states[:, column]) - np.sin(before))
    for rider, other in enumerate(task.entities):
        if other.inside == kind.name:
            _ride(task, states, rider, entity, change)
    states[:, task.place(entity)] += change


def _ride(task: KinematicTask, states: FloatArray, rider: int, container: int, change: FloatArray) -> None:
    """Take an object along with its container if it lies there, and its goal, if it has one there."""
    rides = "position" in task.entities[rider].goal
    where = states[:, task.place(rider, goal=True) if rides else task.place(container)]
    lies = np.linalg.norm(states[:, task.place(rider)] - where, axis=-1) < LYING
    states[lies, task.place(rider)] += change[lies]
    if rides and task.entities[rider].goals == "rides":
        states[:, task.place(rider, goal=True)] += change


def _push(task: KinematicTask, after: FloatArray, moved: FloatArray) -> None:
    """Move every loose object out of the hand's way."""
    for i, kind in enumerate(task.entities):
        if kind.moves == "pushed":
            offset = after[:, task.place(i)] - moved
            length = np.linalg.norm(offset, axis=-1)
            touched = length < REACH
            unit = offset[touched] / np.maximum(length[touched], 1e-12)[:, None]
            after[touched, task.place(i)] = moved[touched] + REACH * unit
