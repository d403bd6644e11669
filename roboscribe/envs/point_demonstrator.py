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
RADIUS = 0.06
"""Distance at which a pushing gripper goes round an object, metres."""
NEAR = 0.075
"""Distance from an object at which a pushing gripper begins to go round it, metres."""
TURN = 0.6
"""Most that it goes round in one step, radians."""
ASIDE = 0.006
"""How far beside the line through object and goal it may be and still push, metres."""
PRESS = 0.02
"""Distance behind the object's centre at which a pushing gripper aims, metres; less than where they touch."""


def demonstrate(task: PointTask, episodes: int, seed: int) -> list[Trajectory]:
    """Collect `episodes` successful demonstrations, reproducible by `seed`; unsuccessful ones are dropped."""
    kept: list[Trajectory] = []
    attempt = 0
    while len(kept) < episodes:
        if attempt > 4 * episodes + 20:
            msg = f"the demonstrator of {task.name} solved only {len(kept)} of {attempt} episodes"
            raise RuntimeError(msg)
        wanted = episodes - len(kept)
        found = _episodes(task, [np.random.default_rng([seed, attempt + i]) for i in range(wanted)])
        kept += [t for t in found if task.solved(t.states[-1])]
        attempt += wanted
    return kept


def _episodes(task: PointTask, rngs: list[np.random.Generator]) -> list[Trajectory]:
    """Run one episode per generator, side by side; each ends STAY steps after it is solved or at the horizon."""
    world = task.world(len(rngs))
    seeds = np.concatenate([rng.integers(2**31, size=1) for rng in rngs])
    states = [world.reset(np.arange(len(rngs)), seeds)]
    actions: list[FloatArray] = []
    queues = [_order(task, state, rng) for state, rng in zip(states[0], rngs, strict=True)]
    left = np.full(len(rngs), STAY)
    lengths = np.zeros(len(rngs), dtype=np.int64)
    while len(actions) < task.horizon and (left > 0).any():
        rows = np.flatnonzero(left > 0)
        command = np.zeros((len(rngs), task.action_size))
        command[rows] = [_noisy(_act(task, states[-1][row], queues[row]), rngs[row]) for row in rows]
        actions.append(command)
        states.append(states[-1].copy())
        states[-1][rows] = world.step(rows, command[rows])
        lengths[rows] += 1
        left[rows] -= task.solved(states[-1][rows])
    return [_cut(task, states, actions, row, int(length)) for row, length in enumerate(lengths)]


def _noisy(action: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Disturb the displacement, not the fingers."""
    noise = NOISE * np.append(rng.standard_normal(2), np.zeros(len(action) - 2))
    return np.clip(action + noise, -1.0, 1.0)


def _cut(task: PointTask, states: list[FloatArray], actions: list[FloatArray], row: int, length: int) -> Trajectory:
    history = np.stack([state[row] for state in states[: length + 1]])
    return Trajectory(task.layout, history, np.stack([action[row] for action in actions[:length]]), history)


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
    """Return what is missing to the goal, as a displacement of the gripper (2,)."""
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
    """Come near the object, go round it to the side away from its goal, then push."""
    hand = state[layout.columns[ROBOT, "position", False]]
    thing = state[layout.columns[entity, "position", False]]
    missing = _error(layout, state, entity)
    along = missing / max(1e-9, float(np.linalg.norm(missing)))
    offset = hand - thing
    behind = float(-offset @ along)
    aside = float(np.linalg.norm(offset + behind * along))
    if behind > 0.0 and aside < ASIDE:
        return _towards(thing - PRESS * along - hand)
    here = np.arctan2(offset[1], offset[0])
    turn = 0.0
    if np.linalg.norm(offset) < NEAR:
        there = np.arctan2(-along[1], -along[0])
        turn = float(np.clip((there - here + np.pi) % (2 * np.pi) - np.pi, -TURN, TURN))
    target = thing + RADIUS * np.array([np.cos(here + turn), np.sin(here + turn)])
    return _towards(target - hand)


def _towards(displacement: FloatArray) -> FloatArray:
    """Build the action (2,) that moves by `displacement`, at most at full speed."""
    return np.asarray(displacement / max(0.05, float(np.abs(displacement).max())))
