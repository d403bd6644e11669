"""A scripted demonstrator for scenes of several blocks, without memory as the one for a single block.

Which block is next, whether the hand still is around another one and whether it holds something are all read from the
observed state. Heights of crossing depend on the block that is served and its goal alone, since everything that stands
is lower than the goal of the block that is next: so a learner that sees one block at a time can imitate it.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from roboscribe.envs import single_block_demonstrator
from roboscribe.envs.demonstrator import Script
from roboscribe.envs.fetch import BLOCK_SIZE, view
from roboscribe.envs.single_block_demonstrator import HOVER, NEAR, PINCH, ramp
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

GAIN = 16.0
"""Commanded displacement per metre of error, in actions."""
GRIP = 0.054
"""The fingers have closed on a block when they are nearer than this, m."""
HELD, LOOSENED = 0.0485, 0.0505
"""A block is held by fingers that are nearer than the first, and free between fingers wider than the second, m."""
OPEN = 0.09
"""Fingers wider than this pass a block on both sides, m."""
EXACT, LOOSE, BURIED = 0.012, 0.028, 0.045
"""A block this close to its goal is let go; it counts as placed this long; and this long below another one, m."""
SLACK = 0.012
"""Fingers that have begun to close stay around the block this much longer, m."""
CLEAR = 0.08
"""Height above the block and its goal at which the hand crosses, m."""
HIGH = 0.16
"""The same for a hand that comes from well above, m."""
TIP, RIM = 0.01, 0.03
"""Hand and block come down within the tip's distance of the axis; from the rim on they keep the crossing height, m."""
RISE = 0.05
"""The hand is still around a block up to this height above it, m."""
REST = 0.16
"""Height above the highest goal to which the hand leaves at the end, m."""
CALM = 0.4
"""Share of the noise close to a block."""
SPREAD = np.array([0.15, 0.15, 0.15, 0.1])
"""Standard deviation of the noise."""


def placed(hand: FloatArray, opening: FloatArray, blocks: FloatArray, goals: FloatArray) -> BoolArray:
    """Tell which blocks (R, N) are where they belong.

    The one in the closed hand must be there more exactly; one that carries another may be a little farther off.
    """
    around = np.linalg.norm(blocks - hand[:, None], axis=2) < NEAR
    exact = np.where(around, ramp(-opening, -LOOSENED, -HELD)[:, None], 0.0)
    loose = np.where(_covered(blocks), BURIED, LOOSE)
    settled: BoolArray = np.linalg.norm(blocks - goals, axis=2) < loose - (loose - EXACT) * exact
    return settled


def _covered(blocks: FloatArray) -> BoolArray:
    """Tell on which blocks (R, N) another one lies."""
    gap = blocks[:, None] - blocks[:, :, None]
    above = (np.abs(gap[..., 2] - BLOCK_SIZE) < BLOCK_SIZE / 2) & (np.abs(gap[..., :2]).max(axis=3) < BLOCK_SIZE)
    covered: BoolArray = above.any(axis=2)
    return covered


def due(done: BoolArray, goals: FloatArray, keep_last: bool) -> IntArray:
    """Index (R,) of the block to serve: the lowest goal first, equal heights in order; to keep the last: in order."""
    order = np.arange(goals.shape[1]) if keep_last else np.round(goals[..., 2], 2) * 1e3 + np.arange(goals.shape[1])
    late = np.where(done, np.inf, order)
    if keep_last:
        late[:, -1] = goals.shape[1]
    first: IntArray = late.argmin(axis=1).astype(np.int64)
    return first


def command(keep_last: bool, states: FloatArray, clear: float = CLEAR) -> FloatArray:
    """Decide the noiseless action.

    Args:
        keep_last: serve the blocks in order and hold the last one; else build from below and leave.
        states: (R, F) states of a Fetch scene.
        clear: height above the block and its goal at which the hand crosses, m.

    Returns:
        (R, 4) actions in [-1, 1].
    """
    hand, opening, _, blocks, goals = view(states)
    done = placed(hand, opening, blocks, goals)
    index, row = due(done, goals, keep_last), np.arange(len(states))
    block, goal = blocks[row, index], goals[row, index]
    over = np.all(done, axis=1) & (not keep_last)
    grasp = NEAR + SLACK * ramp(-opening, -OPEN, -OPEN + 0.01)
    around = (np.linalg.norm(block - hand, axis=1) < grasp) & ~over
    move = GAIN * _serve(hand, opening, block, goal, around, clear=clear)
    move = np.where(over[:, None], _rest(hand, goals), move)
    mine = (np.arange(goals.shape[1]) == index[:, None]) & ~over[:, None]
    move = _leave(move, hand, opening, np.where(mine[..., None], np.inf, blocks), goals)
    return np.concatenate([np.clip(move, -1.0, 1.0), np.where(around, -PINCH, PINCH)[:, None]], axis=1)


def calm(states: FloatArray) -> FloatArray:
    """Share (R,) of the noise that is applied: less around a block, where it would drag it along."""
    seen = view(states)
    nearest = np.linalg.norm(seen.blocks - seen.hand[:, None], axis=2).min(axis=1)
    return CALM + (1 - CALM) * ramp(nearest, 0.04, 0.08)


def _serve(
    hand: FloatArray, opening: FloatArray, block: FloatArray, goal: FloatArray, around: BoolArray, *, clear: float
) -> FloatArray:
    """Displacement (R, 3): fetch the block with open fingers, or carry it to its goal."""
    fetch = _route(hand, block, np.maximum(block[:, 2], goal[:, 2]) + clear)
    narrow = np.where(around, 0.0, HOVER * ramp(-opening, -OPEN, -OPEN + 0.03))
    fetch[:, 2] = np.maximum(fetch[:, 2], block[:, 2] - hand[:, 2] + narrow)
    closed = ramp(-opening, -GRIP - 0.003, -GRIP)[:, None]
    carry = closed * _route(block, goal, goal[:, 2] + clear)
    return np.where(around[:, None] & (closed > 0), carry, fetch)


def _route(start: FloatArray, end: FloatArray, height: FloatArray) -> FloatArray:
    """Displacement (R, 3) from `start` to `end`: straight up, across at `height` (R,), down a funnel around the end."""
    gap = end - start
    radius = np.linalg.norm(gap[:, :2], axis=1)
    gap[:, 2] += (height - end[:, 2]) * ramp(radius, TIP, RIM)
    gap[:, :2] *= 1.0 - ramp(gap[:, 2:], 0.01, 0.04)
    return gap


def _rest(hand: FloatArray, goals: FloatArray) -> FloatArray:
    """Rise straight above everything and stay there: action (R, 3)."""
    rise = goals[..., 2].max(axis=1) + REST - hand[:, 2]
    return np.stack([np.zeros_like(rise), np.zeros_like(rise), GAIN * rise], axis=1)


def _leave(
    move: FloatArray, hand: FloatArray, opening: FloatArray, others: FloatArray, goals: FloatArray
) -> FloatArray:
    """Where the hand is around one of the `others` (R, N, 3): wait until the fingers are open, then rise straight.

    Above the block's goal the hand keeps to the axis, lest noise drags the block.
    """
    gap = others - hand[:, None]
    inside = (np.linalg.norm(gap[..., :2], axis=2) < 1.5 * NEAR) & (np.abs(gap[..., 2]) < RISE)
    axis = (goals - hand[:, None])[np.arange(len(hand)), inside.argmax(axis=1), :2]
    axis = GAIN * np.where(np.linalg.norm(axis, axis=1, keepdims=True) < LOOSE, axis, 0.0)
    straight = np.column_stack([axis, ramp(opening, OPEN - 0.02, OPEN)])
    return np.where(inside.any(axis=1)[:, None], straight, move)


SINGLE = Script(
    single_block_demonstrator.command, partial(command, True, clear=HIGH), SPREAD, lambda states: np.ones(len(states))
)
"""Carry a single block to its goal and hold it."""
SERVE = Script(partial(command, True), partial(command, True, clear=HIGH), SPREAD, calm)
"""Carry the blocks to their goals one after the other and hold the last."""
BUILD = Script(partial(command, False), partial(command, False, clear=HIGH), SPREAD, calm)
"""Build from below and leave."""
