"""Scripted, noisy demonstrations of point tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from roboscribe.world.layout import ROBOT, FloatArray, Layout
from roboscribe.world.trajectory import Trajectory

if TYPE_CHECKING:
    from roboscribe.envs.point_world import PointTask

NOISE = 0.08
"""Standard deviation of the noise on each axis of an action."""
STAY = 5
"""Control steps shown after success."""


def demonstrate(task: PointTask, episodes: int, seed: int) -> list[Trajectory]:
    """Collect `episodes` successful demonstrations, reproducible by `seed`; unsuccessful ones are dropped."""
    kept: list[Trajectory] = []
    attempt = 0
    while len(kept) < episodes:
        rng = np.random.default_rng([seed, attempt])
        trajectory = _episode(task, rng)
        if task.solved(trajectory.states[-1]):
            kept.append(trajectory)
        attempt += 1
        if attempt > 4 * episodes + 20:
            msg = f"the demonstrator of {task.name} solved only {len(kept)} of {attempt} episodes"
            raise RuntimeError(msg)
    return kept


def _episode(task: PointTask, rng: np.random.Generator) -> Trajectory:
    world = task.world(1)
    row = np.array([0])
    states = [world.reset(row, rng.integers(2**31, size=1))[0]]
    actions: list[FloatArray] = []
    queue = _order(task, states[0], rng)
    left = STAY
    while len(actions) < task.horizon and left > 0:
        action = _act(task, states[-1], queue)
        noisy = action + NOISE * np.append(rng.standard_normal(2), np.zeros(task.action_size - 2))
        actions.append(np.clip(noisy, -1.0, 1.0))
        states.append(world.step(row, actions[-1][None])[0])
        left -= bool(task.solved(states[-1]))
    history = np.stack(states)
    return Trajectory(task.layout, history, np.stack(actions), history)


def _order(task: PointTask, state: FloatArray, rng: np.random.Generator) -> list[int]:
    layout = task.layout
    drawers = list(layout.of_type("drawer"))
    rest = [int(i) for i in rng.permutation(len(layout.entities)) if i not in drawers]
    if task.order == "height":
        rest.sort(key=lambda i: float(state[layout.columns[i, "position", True]][1]))
    return drawers + rest


def _act(task: PointTask, state: FloatArray, queue: list[int]) -> FloatArray:
    """Serve the first entity of the queue that is not at its goal; stay open where nothing is left to do."""
    while queue and _served(task.layout, state, queue[0]):
        queue.pop(0)
    if not queue:
        return np.append(np.zeros(2), -np.ones(task.action_size - 2))
    return _grasp_and_carry(task.layout, state, queue[0]) if task.fingers else _push(task.layout, state, queue[0])


def _served(layout: Layout, state: FloatArray, entity: int) -> bool:
    return bool(np.linalg.norm(_error(layout, state, entity)) < 0.015)


def _error(layout: Layout, state: FloatArray, entity: int) -> FloatArray:
    """What is missing to the goal, as a displacement of the gripper (2,)."""
    name = layout.entities[entity].goal[0].name
    missing = state[layout.columns[entity, name, True]] - state[layout.columns[entity, name, False]]
    return missing if name == "position" else np.array([missing[0], 0.0])


def _grasp_and_carry(layout: Layout, state: FloatArray, entity: int) -> FloatArray:
    hand = state[layout.columns[ROBOT, "position", False]]
    thing = state[layout.columns[entity, "position", False]]
    if np.linalg.norm(hand - thing) > 0.011:
        return np.append(_towards(thing - hand), 1.0 if np.linalg.norm(hand - thing) < 0.025 else -1.0)
    return np.append(_towards(_error(layout, state, entity)), 1.0)


def _push(layout: Layout, state: FloatArray, entity: int) -> FloatArray:
    """Go round the object to the side away from its goal, then push."""
    hand = state[layout.columns[ROBOT, "position", False]]
    thing = state[layout.columns[entity, "position", False]]
    missing = _error(layout, state, entity)
    along = missing / max(1e-9, float(np.linalg.norm(missing)))
    offset = hand - thing
    behind = float(-offset @ along)
    aside = offset + behind * along
    if behind > 0.0 and np.linalg.norm(aside) < 0.008:
        return _towards(thing - 0.02 * along - hand)
    target = thing - 0.07 * along
    if behind < 0.05 and np.linalg.norm(aside) < 0.06:
        side = aside / max(1e-9, float(np.linalg.norm(aside))) if np.linalg.norm(aside) > 1e-6 else along[::-1]
        target = thing + 0.08 * side - 0.07 * along
    return _towards(target - hand)


def _towards(displacement: FloatArray) -> FloatArray:
    """Action (2,) that moves by `displacement`, at most at full speed."""
    return np.asarray(displacement / max(0.05, float(np.abs(displacement).max())))
