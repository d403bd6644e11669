"""Tower tasks: stack every block at its goal and take the hand away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from roboscribe.envs import block_layouts, fetch, multi_block_demonstrator
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script
from roboscribe.envs.fetch_world import FetchTask, at_goals
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray

AWAY = 0.10
"""The hand has left when it is farther than this from every goal, m."""
HIGHEST = 10
"""Levels that the arm reaches."""
SHAPES: dict[str, block_layouts.Goals] = {
    "tower": block_layouts.tower,
    "multitower": block_layouts.multitower,
    "pyramid": block_layouts.pyramid,
}
FEWEST = {"tower": 2, "multitower": 4, "pyramid": 3}
STEPS_PER_BLOCK = 50
"""Control steps of an episode for each block."""


def left(states: FloatArray) -> BoolArray:
    """Tell whether the hand is farther than `AWAY` from all goals; states (..., F), returns (...)."""
    seen = fetch.view(states)
    gaps = np.linalg.norm(seen.goals - seen.hand[..., None, :], axis=-1)
    found: BoolArray = (gaps > AWAY).all(axis=-1)
    return found


@dataclass(frozen=True)
class Tower(FetchTask):
    """The task of building one of the `SHAPES` from N blocks.

    Args:
        shape: "tower", "multitower" or "pyramid".
    """

    shape: str = "tower"

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            TaskError: too few blocks for the shape, or more than the arm reaches.
        """
        fewest, most = FEWEST[self.shape], HIGHEST
        if not fewest <= self.blocks <= most:
            msg = f"{self.name}: {self.blocks} blocks, expected {fewest} to {most} for a {self.shape}"
            raise TaskError(msg)

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: every block at its goal, the hand away from all goals."""
        return left(states) & at_goals(states)

    def sample(self, rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
        """Draw an episode: places (N, 2) and goals (N, 3) of the shape."""
        origin = np.array([*start.grip[:2], start.heights[0]])
        room = block_layouts.CROWDED if self.crowded else block_layouts.STACK
        return block_layouts.draw(rng, origin, self.blocks, SHAPES[self.shape], room)

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return multi_block_demonstrator.BUILD


@register(
    *(f"{shape}-N{crowded}" for shape in SHAPES for crowded in ("", "-crowded")),
    examples=("tower-5", "multitower-6", "pyramid-6"),
)
def tower(request: Request) -> Tower:
    """Make the task of N blocks in a shape."""
    shape, blocks, crowded = request.name.split("-")[0], request.number, request.name.endswith("-crowded")
    horizon = STEPS_PER_BLOCK * blocks
    return Tower(request.name, blocks, request.contact, request.timing, horizon, crowded=crowded, shape=shape)
