"""What to do next in PlaceCubesDrawer: a command that depends on the observed state alone.

Open the drawer by its handle, fetch the cubes one after another (the nearest first) and put each down in its slot; at
the end, where it is asked for, shut the drawer. Every way rises straight, crosses above everything and comes down.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from roboscribe.envs.drawer import geometry
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

GAIN = 30.0
"""Commanded displacement per metre of error, in actions."""
BRAKE = 1.0
"""Commanded displacement against the hand's velocity, in actions per m/s: it arrives without running past."""
CROSSING, HIGH_CROSSING = 1.05, 1.12
"""Height at which the hand crosses the cabinet, m; above everything, and well above."""
TIP, SLOPE, SLACK = 0.004, 4.0, 0.02
"""A way comes down within `TIP` of the axis above its end, `SLOPE` times as steep as wide around it; what is `SLACK`
lower than that only rises, m."""
BEFORE_BAR = 0.010
"""The hand comes down on the bar this much in front of it, for a finger to fit behind, m."""
AT_BAR = (0.035, 0.03, 0.02)
"""The fingers are around the bar when the hand is this near to it, along x, y and z, m."""
PULL = 1.0
NEARLY, FULLY = 0.150, 0.172
"""The drawer is open enough beyond the second extension where the hand is at its bar, else beyond the first, m."""
AJAR = (0.018, 0.006)
"""It is shut below these."""
AROUND = 0.014
"""The hand is around a cube within this distance, m."""
GRIP, LOOSE = (0.039, 0.041), 0.050
"""Opening at which fingers have closed on a cube, and begin to; wider than the last they do not hold it, m."""
ABOVE_SLOT, RELEASE = 0.005, 0.018
"""A cube is let go within the second distance of a place this high above its slot, m; it takes the fingers half a
second."""
GENTLE = 0.5
"""Share of the way that is still made while letting go: cubes lie up to 1.5 cm off, as the drawer has room for, and a
learner need not be more exact than that."""
SPREAD = np.array([0.15, 0.15, 0.15, 0.15])
"""Standard deviation of the demonstrator's noise, in actions."""
CALM, CLOSE = 0.5, 0.04
"""Share of the noise where the hand is this close to a cube, m."""


def ramp(values: FloatArray, low: float, high: float) -> FloatArray:
    """Rise linearly from 0 at `low` to 1 at `high`."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def way(start: FloatArray, end: FloatArray, crossing: float) -> FloatArray:
    """Displacement (R, 3) from `start` towards `end`: up, across at `crossing`, and down a funnel above the end."""
    gap = end - start
    radius = np.linalg.norm(gap[:, :2], axis=1)
    height = end[:, 2] + np.clip(SLOPE * (radius - TIP), 0.0, np.maximum(crossing - end[:, 2], 0.0))
    gap[:, 2] = height - start[:, 2]
    gap[:, :2] *= ramp(-gap[:, 2:], -2 * SLACK, -SLACK)
    return gap


def nearest(hand: FloatArray, cubes: FloatArray, wanted: BoolArray) -> IntArray:
    """Choose the nearest (R,) of the wanted cubes (R, N), by what the hand crosses and then by height."""
    gaps = np.linalg.norm(cubes - hand[:, None], axis=2)
    return np.asarray(np.where(wanted, gaps, np.inf).argmin(axis=1))


def command(states: FloatArray, crossing: float = CROSSING) -> FloatArray:
    """Decide the noiseless action.

    Args:
        states: (R, F) states of the scene.
        crossing: height at which the hand crosses the cabinet, m.

    Returns:
        (R, 4) actions in [-1, 1].
    """
    hand, opening, bar, extension, goal = (
        states[:, :3],
        states[:, 3],
        states[:, 7:10],
        states[:, 10],
        states[:, 11],
    )
    objects = states[:, geometry.BEFORE_CUBES :].reshape(len(states), -1, 6)
    cubes, slots = objects[..., :3], objects[..., 3:]
    held = (np.linalg.norm(cubes - hand[:, None], axis=2) < 1.5 * AROUND) & (opening < LOOSE)[:, None]
    left = held | ~geometry.inside(cubes, bar)
    busy = left.any(axis=1)
    drawer = _operate(hand, bar, np.where(busy, extension - geometry.TRAVEL, extension - goal), crossing)
    chosen = np.arange(len(states)), nearest(hand, cubes, left)
    serve = _serve(hand, opening, cubes[chosen], slots[chosen], crossing)
    idle = np.concatenate([way(hand, hand * (1, 1, 0) + (0, 0, crossing), crossing), np.ones((len(hand), 1))], axis=1)
    opened = _done(hand, bar, extension, geometry.TRAVEL)
    finished = np.where(goal > 0, True, _done(hand, bar, extension, 0.0))
    move = np.where(busy[:, None], np.where(opened[:, None] | held.any(axis=1)[:, None], serve, drawer), drawer)
    move = np.where((~busy & finished)[:, None], idle, move)
    displacement = np.clip(GAIN * move[:, :3] - BRAKE * states[:, 4:7], -1.0, 1.0)
    return np.concatenate([displacement, np.sign(move[:, 3:])], axis=1)


def _at_bar(hand: FloatArray, bar: FloatArray) -> BoolArray:
    """Tell whether the fingers are around the bar."""
    return np.asarray((np.abs(hand - bar) < AT_BAR).all(axis=1))


def _done(hand: FloatArray, bar: FloatArray, extension: FloatArray, wanted: float) -> BoolArray:
    """Tell whether the drawer is where it is wanted: with the margin of the hand that is at it, or with less."""
    at = _at_bar(hand, bar)
    if wanted > 0:
        return np.asarray(extension > np.where(at, FULLY, NEARLY))
    return np.asarray(extension < np.where(at, AJAR[1], AJAR[0]))


def _operate(hand: FloatArray, bar: FloatArray, excess: FloatArray, crossing: float) -> FloatArray:
    """Displacement and fingers (R, 4) that move the drawer: come down around its bar, pull or push."""
    at = _at_bar(hand, bar)
    move = way(hand, bar - (BEFORE_BAR, 0.0, 0.0), crossing)
    pull = np.stack([PULL / GAIN * np.sign(excess), (bar - hand)[:, 1], (bar - hand)[:, 2]], axis=1)
    return np.concatenate([np.where(at[:, None], pull, move), np.ones((len(hand), 1))], axis=1)


def _serve(hand: FloatArray, opening: FloatArray, cube: FloatArray, slot: FloatArray, crossing: float) -> FloatArray:
    """Displacement and fingers (R, 4) that bring one cube to its slot."""
    near = np.linalg.norm(cube - hand, axis=1)
    around = near < np.where(opening < LOOSE, 1.5 * AROUND, AROUND)
    above = slot + np.array([0.0, 0.0, ABOVE_SLOT])
    release = np.linalg.norm(cube - above, axis=1) < RELEASE
    closed = ramp(-opening, -GRIP[1], -GRIP[0])[:, None]
    carry = np.where(release[:, None], GENTLE * (above - cube), closed * way(cube, above, crossing))
    move = np.where(
        around[:, None], np.where((closed > 0) | release[:, None], carry, cube - hand), way(hand, cube, crossing)
    )
    return np.concatenate([move, np.where(around & ~release, -1.0, 1.0)[:, None]], axis=1)


def calm(states: FloatArray) -> FloatArray:
    """Share (R,) of the noise that is applied: less where the hand is close to a cube."""
    cubes = states[:, geometry.BEFORE_CUBES :].reshape(len(states), -1, 6)[..., :3]
    near = np.linalg.norm(cubes - states[:, None, :3], axis=2).min(axis=1) < CLOSE
    return np.where(near, CALM, 1.0)


high = partial(command, crossing=HIGH_CROSSING)
"""The same, crossing well above everything."""
