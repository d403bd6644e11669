"""What to do next in robosuite's Lift and Stack with a Panda: commands that depend on the observed state alone."""

from __future__ import annotations

from functools import partial

import numpy as np

from roboscribe.envs.demonstrator import Script
from roboscribe.envs.drawer.moves import way
from roboscribe.envs.performer import Scene
from roboscribe.world.layout import BoolArray, FloatArray

HAND, OPENING, SPEED, BLOCK, YAW, GOAL = slice(0, 3), 3, slice(4, 7), slice(8, 11), 13, slice(14, 17)
"""Columns of a state: the hand, the block that is moved, how it is turned and, in Stack, where it belongs."""
GAIN, BRAKE = 60.0, 2.0
"""Commanded displacement per metre of error, and against the hand's velocity per m/s, in actions."""
AROUND, LEAVING = 0.012, 0.024
"""The hand is around the block within the first distance; a grip is given up beyond the second, m."""
SIDE = 0.042
"""Of the block, give or take 2 mm; fingers that close on its edges stay further apart than on its sides."""
GRIP, LOOSE = 0.008, 0.017
"""Fingers have closed on the block, or begin to, when they are this much wider than it is; beyond the second they hold
nothing, m."""
APPROACH, LIFTED, ABOVE = 0.06, 0.10, 0.004
"""Heights of approach, to which a block is lifted, and above its place at which it is let go, m."""
RELEASE, GENTLE = 0.016, 0.3
"""A block is let go within this distance of above its place, m; that share of the way is still made meanwhile, so that
blocks lie up to 1 cm off: the larger one has room for it, and a learner need not be more exact than that."""
SPREAD = np.full(4, 0.15)
"""Standard deviation of the noise, in actions."""
CALM, CLOSE = 0.5, 0.04
"""Share of the noise where the hand is this close to the block, m."""
STYLES = ("default", "brisk", "slow", "topdown", "pauses", "stop", "linger")
"""Styles that make sense where a block need not be carried anywhere, or only beside another."""
TABLE = 0.8
"""Height of the table, m."""


def lift(states: FloatArray, approach: float = APPROACH) -> FloatArray:
    """Pick the block up and keep it up: actions (R, 4) in states (R, F)."""
    block = states[:, BLOCK]
    above = np.concatenate([block[:, :2], np.full((len(block), 1), TABLE + LIFTED)], axis=1)
    return _command(states, above - block, np.zeros(len(block), dtype=np.bool_), approach)


def stack(states: FloatArray, approach: float = APPROACH) -> FloatArray:
    """Put the block down on the other and rise: actions (R, 4) in states (R, F)."""
    block, place = states[:, BLOCK], states[:, GOAL] + (0.0, 0.0, ABOVE)
    release: BoolArray = np.linalg.norm(place - block, axis=1) < RELEASE
    carry = np.where(release[:, None], GENTLE * (place - block), way(block, place, float(place[:, 2].max()) + approach))
    return _command(states, carry, release, approach)


def _command(states: FloatArray, carry: FloatArray, release: BoolArray, approach: float) -> FloatArray:
    """Fetch the block, move it by `carry` (R, 3) once the fingers have closed, and let it go where told (R,)."""
    hand, opening, block = states[:, HAND], states[:, OPENING], states[:, BLOCK]
    room = opening - width(states[:, YAW])
    around = np.linalg.norm(block - hand, axis=1) < np.where(room < LOOSE, LEAVING, AROUND)
    closed = (room < GRIP)[:, None]
    fetch = way(hand, block, float(block[:, 2].max()) + approach)
    rise = hand * (1, 1, 0) + (0, 0, TABLE + 2 * LIFTED) - hand
    let_go = release & (room > LOOSE)
    move = np.where(around[:, None], np.where(closed | release[:, None], carry, block - hand), fetch)
    move = np.where(let_go[:, None], rise, move)
    displacement = np.clip(GAIN * move - BRAKE * states[:, SPEED], -1.0, 1.0)
    return np.concatenate([displacement, np.where(around & ~release, -1.0, 1.0)[:, None]], axis=1)


def width(yaw: FloatArray) -> FloatArray:
    """Return how wide the block is between the fingers (R,) when it is turned by `yaw` (R,)."""
    return np.asarray(SIDE * (np.abs(np.cos(yaw)) + np.abs(np.sin(yaw))))


def calm(states: FloatArray) -> FloatArray:
    """Share (R,) of the noise that is applied: less where the hand is close to the block."""
    near = np.linalg.norm(states[:, BLOCK] - states[:, HAND], axis=1) < CLOSE
    return np.where(near, CALM, 1.0)


def look(state: FloatArray) -> Scene:
    """Read a state (F,) as a performer does; a block that belongs nowhere is where it belongs."""
    hand, opening, block = state[HAND], float(state[OPENING]), state[BLOCK]
    goal = state[GOAL] if len(state) > GOAL.stop else block
    held = 0 if opening < width(state[YAW]) + GRIP and np.linalg.norm(block - hand) < LEAVING else -1
    return Scene(hand, bool(state[6] < 0), opening, block[None], goal[None], held)


HIGH = 2 * APPROACH
SCRIPTS = {
    "Lift": Script(lift, partial(lift, approach=HIGH), SPREAD, calm, look, STYLES),
    "Stack": Script(stack, partial(stack, approach=HIGH), SPREAD, calm, look, STYLES),
}
"""Scripts by environment."""
