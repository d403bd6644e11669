"""What to do next in a Fetch scene with one block.

The command is a smooth function of the observed state alone (hand, finger opening, block, goal), so that a learner
without memory can imitate it. Hand and block move in funnels: the farther from the axis above the target, the higher.
"""

from __future__ import annotations

import numpy as np

from roboscribe.envs.fetch import view
from roboscribe.world.layout import BoolArray, FloatArray

GAIN = 16.0
"""Commanded displacement per metre of error, in actions."""
GRIP = 0.053
"""The fingers have closed on a block when they are nearer than this, m."""
OPEN = 0.085
"""Fingers wider than this pass a block on both sides, m."""
NEAR = 0.02
"""The hand is around a block when their centres are closer than this, m."""
TIP_BLOCK, TIP_GOAL = 0.012, 0.02
"""Hand and block come down within this distance of the axis, m."""
LOW_FETCH, LOW_CARRY = 0.06, 0.04
"""Height of approach to a block, and to its goal, m."""
HOVER = 0.06
"""Fingers that are not open yet keep this high above the block, m."""
PINCH = 0.6
"""Finger command, well beyond what saturates the fingers and well within what noise can reverse."""


def ramp(values: FloatArray, low: float, high: float) -> FloatArray:
    """Rise linearly from 0 at `low` to 1 at `high`."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def funnel(radius: FloatArray, tip: float, top: float) -> FloatArray:
    """Height to keep at a horizontal distance: 0 within `tip`, then three times as steep as wide, up to `top`."""
    return np.clip(3.0 * (radius - tip), 0.0, top)


def command(states: FloatArray) -> FloatArray:
    """Decide the noiseless action for one block: open, come down on it, close, carry it to its goal from above.

    Args:
        states: (R, 19) states of a Fetch scene.

    Returns:
        (R, 4) actions in [-1, 1].
    """
    hand, opening, _, blocks, goals = view(states)
    block, goal = blocks[:, 0], goals[:, 0]
    around = np.linalg.norm(block - hand, axis=1) < NEAR
    closed = ramp(-opening, -GRIP - 0.003, -GRIP)[:, None]
    carry = closed * _route(block, goal, TIP_GOAL, LOW_CARRY)
    move = GAIN * np.where(around[:, None] & (closed > 0), carry, _fetch(hand, opening, block, around))
    return np.concatenate([np.clip(move, -1.0, 1.0), np.where(around, -PINCH, PINCH)[:, None]], axis=1)


def _fetch(hand: FloatArray, opening: FloatArray, block: FloatArray, around: BoolArray) -> FloatArray:
    """Displacement (R, 3) towards the block through a funnel above it, and down only with open fingers."""
    gap = _route(hand, block, TIP_BLOCK, LOW_FETCH)
    narrow = np.where(around, 0.0, HOVER * ramp(-opening, -OPEN, -OPEN + 0.03))
    gap[:, 2] = np.maximum(gap[:, 2], block[:, 2] - hand[:, 2] + narrow)
    return gap


def _route(start: FloatArray, end: FloatArray, tip: float, low: float) -> FloatArray:
    """Displacement (R, 3) from `start` towards `end`, coming down a funnel within `tip` of the axis above `end`."""
    gap = end - start
    gap[:, 2] += funnel(np.linalg.norm(gap[:, :2], axis=1), tip, low)
    return gap
