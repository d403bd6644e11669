"""What to do next in a Fetch scene whose fingers stay closed: push one block after the other to its goal.

The command is a function of the observed state alone. The hand crosses above the blocks, comes down behind the block
that is due, as seen from its goal, and pushes; where the block has slipped off the line to its goal, the hand goes
around it at the table, or rises and begins again where it is far behind.
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
PASSAGE = 0.07
"""Another block this close to the way of hand and block is in the way, m."""
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


def free_first(blocks: FloatArray, goals: FloatArray) -> FloatArray:
    """Blocks with a free way first, in their own order."""
    return np.asarray(_obstacles(blocks, goals) * blocks.shape[1] + np.arange(blocks.shape[1]), np.float64)


def farthest_first(blocks: FloatArray, goals: FloatArray) -> FloatArray:
    """Blocks with the farthest goal, seen from the robot, first."""
    del blocks
    return -goals[..., 0]


def due(hand: FloatArray, blocks: FloatArray, goals: FloatArray, order: Order = free_first) -> IntArray:
    """Index (R,) of the block to push: the late one that the hand is behind, else the first in order."""
    late = np.linalg.norm(goals - blocks, axis=2) > CLOSE
    rank = np.where(_behind(hand[:, None], blocks, goals), -np.inf, order(blocks, goals))
    found: IntArray = np.where(late, rank, np.inf).argmin(axis=1).astype(np.int64)
    return found


def _obstacles(blocks: FloatArray, goals: FloatArray) -> IntArray:
    """Count (R, N) the blocks in the way of each to its goal, and the ways of others on which its goal lies."""
    late = np.linalg.norm(goals - blocks, axis=2) > CLOSE
    in_its_way = _in_way(blocks, goals, blocks).sum(axis=2)
    in_others_way = (_in_way(blocks, goals, goals) & late[:, :, None]).sum(axis=1)
    return np.asarray(in_its_way + in_others_way, np.int64)


def _in_way(blocks: FloatArray, goals: FloatArray, points: FloatArray) -> BoolArray:
    """Tell (R, N, N) in which other blocks' way to their goals points (R, N, 3) of blocks lie."""
    ahead, left = _way(blocks, goals)
    gap = points[:, None, :, :2] - blocks[:, :, None, :2]
    along = np.clip((gap * ahead[:, :, None]).sum(axis=3), -BEHIND, left[:, :, None])
    off = np.linalg.norm(gap - along[..., None] * ahead[:, :, None], axis=3)
    found: BoolArray = (off < PASSAGE) & ~np.eye(blocks.shape[1], dtype=np.bool_)
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


def command(order: Order, states: FloatArray, clear: float = CLEAR) -> FloatArray:
    """Decide the noiseless action.

    Args:
        order: which block is pushed first.
        states: (R, F) states of a Fetch scene.
        clear: height above the block at which the hand crosses, m.

    Returns:
        (R, 4) actions in [-1, 1]; the fingers' command is 0.
    """
    seen = view(states)
    row, index = np.arange(len(states)), due(seen.hand, seen.blocks, seen.goals, order)
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
    """Return what pushes the blocks to their goals one after the other."""
    return Script(partial(command, order), partial(command, order, clear=HIGH), SPREAD, calm, styles=STYLES)


PUSH, PUSH_CONFINED = script(free_first), script(farthest_first)
"""Push blocks in any order that leaves ways free; the farthest one first."""
