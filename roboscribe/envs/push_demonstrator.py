"""What to do next in a Fetch scene whose fingers stay closed: push one block after the other to its goal.

The command is a function of the observed state, and of an order of the blocks that the first state decides. The hand
crosses above the blocks, comes down behind the block that is due, as seen from its goal, and pushes; where the block
has slipped off the line to its goal, the hand goes around it at the table, or rises and begins again where it is far
behind.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from roboscribe.envs.demonstrator import Script
from roboscribe.envs.fetch import view
from roboscribe.envs.single_block_demonstrator import ramp
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

GAIN, PUSH_GAIN = 20.0, 12.0
"""Commanded displacement per metre of error, in actions: of the free hand, and of one that pushes."""
CLOSE = 0.025
"""A block this close to its goal is left alone, m."""
BEHIND = 0.065
"""The hand comes down this far from the block's centre, on the side away from the goal, m."""
REACH = 0.095
"""Farther behind the block than this the hand does not push but goes to where it can, m."""
OFF = 0.02
"""Sideways distance from the line through block and goal beyond which the hand is no longer behind the block, m."""
LOW = 0.03
"""Up to this height above a block's centre the hand pushes, m."""
AHEAD = 0.06
"""Pushing aims this far ahead at most, m."""
STEER = 1.5
"""How sharply a push is steered against the hand's sideways error."""
TIP, RIM = 0.01, 0.03
"""The hand comes down within the tip's distance of its place; from the rim on it keeps the crossing height, m."""
CLEAR, HIGH = 0.07, 0.14
"""Height above a block's centre at which the hand crosses; the same for a hand that comes from well above, m."""
STYLES = ("default", "brisk", "slow", "topdown", "pauses", "detours", "stop", "linger")
"""Styles that need no fingers."""
SPREAD = np.array([0.12, 0.12, 0.12, 0.1])
"""Standard deviation of the noise."""


Order: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]
"""Ranks (R, N) blocks (R, N, 3) with goals (R, N, 3): the lowest is pushed first."""


def longest_first(blocks: FloatArray, goals: FloatArray) -> FloatArray:
    """Blocks with the longest way first: what is close to its goal already is out of the way of the others."""
    return np.asarray(-np.linalg.norm(goals - blocks, axis=2), np.float64)


def farthest_first(blocks: FloatArray, goals: FloatArray) -> FloatArray:
    """Blocks with the farthest goal, seen from the robot, first."""
    del blocks
    return -goals[..., 0]


def due(hand: FloatArray, blocks: FloatArray, goals: FloatArray, ranks: FloatArray) -> IntArray:
    """Index (R,) of the block to push: the late one that the hand is behind, else the one of the lowest rank (R, N)."""
    late = np.linalg.norm(goals - blocks, axis=2) > CLOSE
    rank = np.where(_behind(hand[:, None], blocks, goals), -np.inf, ranks)
    found: IntArray = np.where(late, rank, np.inf).argmin(axis=1).astype(np.int64)
    return found


def _way(blocks: FloatArray, goals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions (..., 2) from blocks to their goals, seen from above, and distances (...)."""
    gap = goals[..., :2] - blocks[..., :2]
    left = np.linalg.norm(gap, axis=-1)
    return gap / np.maximum(left, 1e-9)[..., None], left


def _beside(hand: FloatArray, blocks: FloatArray, ahead: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far the hand is along the way (...), negative behind the block, and its displacement (..., 2) off it."""
    offset = hand[..., :2] - blocks[..., :2]
    along = (offset * ahead).sum(axis=-1)
    return along, offset - along[..., None] * ahead


def _behind(hand: FloatArray, blocks: FloatArray, goals: FloatArray) -> BoolArray:
    """Tell whether the hand (..., 3) is low behind blocks (..., 3), as seen from their goals."""
    along, side = _beside(hand, blocks, _way(blocks, goals)[0])
    low = hand[..., 2] - blocks[..., 2] < LOW
    found: BoolArray = low & (along > -REACH) & (along < 0) & (np.linalg.norm(side, axis=-1) < OFF)
    return found


def command(states: FloatArray, ranks: FloatArray, clear: float = CLEAR) -> FloatArray:
    """Decide the noiseless action.

    Args:
        states: (R, F) states of a Fetch scene.
        ranks: (R, N) which blocks are pushed first: the lowest.
        clear: height above the block at which the hand crosses, m.

    Returns:
        (R, 4) actions in [-1, 1]; the fingers' command is 0.
    """
    seen = view(states)
    row, index = np.arange(len(states)), due(seen.hand, seen.blocks, seen.goals, ranks)
    hand, block, goal = seen.hand, seen.blocks[row, index], seen.goals[row, index]
    ahead, left = _way(block, goal)
    along, side = _beside(hand, block, ahead)
    height = hand[:, 2] - block[:, 2]
    push = np.column_stack([ahead * np.minimum(left, AHEAD)[:, None] - STEER * side, -height]) * (PUSH_GAIN / GAIN)
    gap = -(BEHIND + along)[:, None] * ahead - side
    move = np.where(_behind(hand, block, goal)[:, None], push, _come_behind(gap, height, clear))
    rest = np.column_stack([np.zeros((len(states), 2)), clear - height])
    move = np.where((left < CLOSE)[:, None], rest, move)
    return np.column_stack([np.clip(GAIN * move, -1.0, 1.0), np.zeros(len(states))])


def _come_behind(gap: FloatArray, height: FloatArray, clear: float) -> FloatArray:
    """Displacement (R, 3) to the table `gap` (R, 2) away: straight up, across, and down a funnel."""
    rise = clear * ramp(np.linalg.norm(gap, axis=1), TIP, RIM) - height
    return np.column_stack([gap * (1.0 - ramp(rise, 0.01, 0.04))[:, None], rise])


def calm(states: FloatArray) -> FloatArray:
    """Share (R,) of the noise that is applied: all of it."""
    return np.ones(len(states))


def script(order: Order) -> Script:
    """Return what pushes the blocks to their goals one after the other, in the order seen at the start."""

    def plan(starts: FloatArray) -> FloatArray:
        seen = view(starts)
        return order(seen.blocks, seen.goals)

    return Script(command, partial(command, clear=HIGH), SPREAD, calm, styles=STYLES, plan=plan)


PUSH, PUSH_CONFINED = script(longest_first), script(farthest_first)
"""Push the block with the longest way first; the one whose goal is the farthest off."""
