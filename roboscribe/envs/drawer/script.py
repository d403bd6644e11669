"""The demonstrator of PlaceCubesDrawer: what is done, and what performers look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.envs.demonstrator import Script
from roboscribe.envs.drawer import geometry, moves
from roboscribe.envs.drawer.moves import AROUND, LOOSE
from roboscribe.envs.performer import Scene
from roboscribe.world.layout import FloatArray

WIDE = 0.055
"""Fingers wider than this pass a cube on both sides, m."""
AXIS, SHORT = 0.02, (0.03, 0.06)
"""Fingers may miss a cube when the hand comes down this close to the axis above it, between these heights, m."""


@dataclass(frozen=True)
class CubeScene(Scene):
    """A scene whose fingers open less than Fetch's."""

    @property
    def approaches(self) -> bool:
        """Whether the hand with open fingers comes down on a cube, and is not around it yet."""
        gaps = self.hand - self.blocks
        above = (np.linalg.norm(gaps[:, :2], axis=1) < AXIS) & (SHORT[0] < gaps[:, 2]) & (gaps[:, 2] < SHORT[1])
        return self.sinks and self.opening > WIDE and bool(above.any())


def look(state: FloatArray) -> CubeScene:
    """Read a state (F,)."""
    hand, opening = state[:3], float(state[3])
    objects = state[geometry.BEFORE_CUBES :].reshape(-1, 6)
    gaps = np.linalg.norm(objects[:, :3] - hand, axis=1)
    held = int(gaps.argmin()) if opening < LOOSE and gaps.min() < 1.5 * AROUND else -1
    return CubeScene(hand, bool(state[6] < 0), opening, objects[:, :3], objects[:, 3:], held)


SCRIPT = Script(moves.command, moves.high, moves.SPREAD, moves.calm, look)
