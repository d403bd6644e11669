"""What to do next in FetchReach: go to the target, straight."""

from __future__ import annotations

import numpy as np

from roboscribe.envs.demonstrator import Script
from roboscribe.envs.performer import Scene
from roboscribe.world.layout import FloatArray

GAIN = 12.0
"""Commanded displacement per metre of error, in actions."""
SPREAD = np.array([0.15, 0.15, 0.15, 0.1])
"""Standard deviation of the noise, in actions."""
STYLES = ("default", "brisk", "slow", "pauses", "stop", "linger")
"""Styles that need neither an object nor a crossing."""


def command(states: FloatArray) -> FloatArray:
    """Decide the noiseless action (R, 4) in states (R, 10); the fingers' command, which does nothing, is 0."""
    gap = states[:, 7:10] - states[:, :3]
    return np.column_stack([np.clip(GAIN * gap, -1.0, 1.0), np.zeros(len(states))])


def everywhere(states: FloatArray) -> FloatArray:
    """Share (R,) of the noise that is applied: all of it."""
    return np.ones(len(states))


def look(state: FloatArray) -> Scene:
    """Read a state (F,): the target stands for a block that nobody holds."""
    target = state[None, 7:10]
    return Scene(state[:3], bool(state[6] < 0), float(state[3]), target, target, -1)


REACH = Script(command, command, SPREAD, everywhere, look, STYLES)
