"""Where several blocks start and where they shall go: on the table, in towers, in a pyramid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator

from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray

RANGE = 0.15
"""Blocks and goals lie within this distance of the hand along x and y, m."""
HAND_GAP = 0.10
"""Blocks start at least this far from the hand, m."""
BLOCK_GAP = 0.06
"""Blocks start farther than this from each other, m."""
GOAL_GAP = 0.071
"""Goals on the table are farther than this from each other, and all goals from every block's start, m."""
TOWER_GAP = 0.10
"""Axes of towers are farther than this from each other, m."""
SHIFT = (-0.05, 0.0)
"""Stacks are built this far from the middle of the blocks' area, m."""
PITCH, LEVEL = 0.06, 0.05
"""Distance of neighbours in a pyramid's row, and of levels, m."""
LINE_END, LINE_SIDE = 0.10, 0.10
"""A line of goals ends this far from the middle, and lies at most this far to the side, m."""
TRIES, RESTARTS = 50, 2000


@dataclass(frozen=True)
class Clearance:
    """Space that is kept free, so that a hand whose fingers open along y comes down on one block alone.

    Args:
        side: nothing stands within both of these distances along x and y of a block's start or a goal on the table, m.
        stack: no block starts within both of these distances of a goal, m.
        gap: no block starts within this distance of a goal, m.
        apart: blocks start farther than this from each other, m.
        goals: goals on the table are farther than this from each other, m.
        reach: goals on the table lie within this distance of the hand along x and y, m.
    """

    side: tuple[float, float]
    stack: tuple[float, float]
    gap: float = GOAL_GAP
    apart: float = BLOCK_GAP
    goals: float = GOAL_GAP
    reach: float = RANGE


FINGERS = (0.042, 0.095)
"""Half a block and half a finger; half a block and the reach of open fingers, m."""
TABLE = Clearance(FINGERS, FINGERS)
"""Fingers find room beside other blocks."""
STACK = Clearance(FINGERS, (0.078, 0.102), 0.09)
"""Palm and wrist find room beside a stack, too."""
CROWDED = Clearance((0.0, 0.0), (0.0, 0.0))
"""Distances alone; some blocks cannot be picked where they are."""
PUSH = Clearance((0.0, 0.0), (0.0, 0.0), 0.08, 0.10, 0.10, 0.12)
"""A block at its goal touches none that has not been pushed yet, and does not lie right at the table's edge."""
PUSH_CROWDED = Clearance((0.0, 0.0), (0.0, 0.0), 0.05, 0.10, 0.10)
"""Distances of the pushing task of the paper."""
LINE = Clearance((0.0, 0.0), (0.12, 0.08), 0.08, 0.10)
"""No block starts beside a line of goals."""
Goals = Callable[[Generator, int, Clearance], FloatArray | None]
"""Draws N goals (N, 3) relative to the hand's place at the height of a resting block; None: no room, try again."""


def crowded(points: FloatArray, others: FloatArray, gap: float, side: tuple[float, float]) -> BoolArray:
    """Tell which points (K, 2) lie within `gap` or within both distances of `side` of one of the `others` (M, 2)."""
    apart = np.abs(points[:, None] - others)
    found: BoolArray = ((apart < side).all(axis=2) | (np.linalg.norm(apart, axis=2) <= gap)).any(axis=1)
    return found


def scatter(
    rng: Generator,
    count: int,
    gap: float,
    side: tuple[float, float],
    barred: Callable[[FloatArray], BoolArray] | None = None,
    reach: float = RANGE,
) -> FloatArray | None:
    """Draw `count` points (n, 2) around the hand, one after the other, that do not crowd each other.

    Args:
        rng: source of randomness.
        count: how many.
        gap: distance from each other, m.
        side: see `Clearance`.
        barred: tells which points (K, 2) may not be.
        reach: greatest distance along x and y, m.

    Returns:
        The points, or None where a point found no room.
    """
    points = np.empty((0, 2))
    for _ in range(count):
        found = rng.uniform(-reach, reach, size=(TRIES, 2))
        found = found[~crowded(found, points, gap, side)]
        found = found if barred is None else found[~barred(found)]
        if len(found) == 0:
            return None
        points = np.vstack([points, found[:1]])
    return points


def draw(
    rng: Generator, origin: FloatArray, count: int, goals: Goals, room: Clearance
) -> tuple[FloatArray, FloatArray]:
    """Draw an episode of `count` blocks.

    Args:
        rng: source of randomness.
        origin: (3,) the hand's place at the height of a resting block.
        count: N.
        goals: draws the goals.
        room: space that is kept free.

    Returns:
        Places (N, 2) and goals (N, 3); which block goes where is random.

    Raises:
        TaskError: so many blocks find no room.

    Source: Sec. 6: blocks 0.06 m from each other, 0.10 m from the hand and 0.071 m from goals.
    Departs: by `room`, unless it is `CROWDED`. The fingers are 14 mm thick and open 65 mm to either side, the palm is
        wider than a block; a block too near to a neighbour or a stack could be picked only after pushing it away.
    """
    for _ in range(RESTARTS):
        wanted = goals(rng, count, room)
        if wanted is not None:
            barred = partial(_barred, wanted[:, :2], room)
            places = scatter(rng, count, room.apart, room.side, barred)
            if places is not None:
                return origin[:2] + places, origin + wanted
    msg = f"{count} blocks and their goals find no room on the table: ask for fewer"
    raise TaskError(msg)


def _barred(goals: FloatArray, room: Clearance, points: FloatArray) -> BoolArray:
    """Tell at which points (K, 2) no block may start: under the hand or close to a goal (N, 2)."""
    below: BoolArray = np.linalg.norm(points, axis=1) < HAND_GAP
    return below | crowded(points, goals, room.gap, room.stack)


def on_table(rng: Generator, count: int, room: Clearance) -> FloatArray | None:
    """Goals on the table; the last one in the air half of the time, 0.1 m to 0.45 m up."""
    goals = flat(rng, count, room)
    if goals is not None and rng.uniform() < 0.5:
        goals[-1, 2] = rng.uniform(0.1, 0.45)
    return goals


def flat(rng: Generator, count: int, room: Clearance) -> FloatArray | None:
    """Goals on the table."""
    places = scatter(rng, count, room.goals, room.side, reach=room.reach)
    return None if places is None else np.hstack([places, np.zeros((count, 1))])


def line(rng: Generator, count: int, room: Clearance) -> FloatArray | None:
    """Goals side by side on a line away from the robot, the last one near the table's far edge; the order is random."""
    del room
    far = np.array([LINE_END, rng.uniform(-LINE_SIDE, LINE_SIDE), 0.0])
    return rng.permutation(far - np.outer(LEVEL * np.arange(count), [1.0, 0.0, 0.0]))


def tower(rng: Generator, count: int, room: Clearance) -> FloatArray | None:
    """One stack."""
    del room
    return _towers(rng, count, 1)


def multitower(rng: Generator, count: int, room: Clearance) -> FloatArray | None:
    """Two stacks, three from six blocks on; they differ by one block at most."""
    del room
    return _towers(rng, count, 2 if count < 6 else 3)


def _towers(rng: Generator, count: int, towers: int) -> FloatArray | None:
    """Stack `count` goals in `towers` towers; which block goes where is random."""
    bases = scatter(rng, towers, TOWER_GAP, FINGERS)
    if bases is None:
        return None
    slot = np.arange(count)
    goals = np.column_stack([bases[slot % towers] + SHIFT, LEVEL * (slot // towers)])
    return rng.permutation(goals)


def pyramid(rng: Generator, count: int, room: Clearance) -> FloatArray | None:
    """Rows along x, across the way fingers open, each row over the gaps of the one below and shorter by one."""
    del room
    base = int(np.ceil((np.sqrt(8 * count + 1) - 1) / 2))
    slots = [((i - (base - 1 - row) / 2) * PITCH, 0.0, row * LEVEL) for row in range(base) for i in range(base - row)]
    half = (base - 1) * PITCH / 2
    middle = rng.uniform((half - RANGE, -RANGE), (RANGE - half, RANGE)) + SHIFT
    return rng.permutation(np.array(slots[:count]) + np.array([*middle, 0.0]))
