"""Tower tasks: stack every block at its goal and take the hand away."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator

from roboscribe.envs import demonstrator, fetch, pick_place, tower_layout, tower_moves
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray

AWAY = 0.10
"""The hand has left when it is farther than this from every goal, m."""
HIGHEST = 10
"""Levels that the arm reaches."""
SHAPES: dict[str, tower_layout.Goals] = {
    "tower": tower_layout.tower,
    "multitower": tower_layout.multitower,
    "pyramid": tower_layout.pyramid,
}
FEWEST = {"tower": 2, "multitower": 4, "pyramid": 3}


def solved(states: FloatArray, blocks: int) -> BoolArray:
    """Tell whether every block is at its goal and the hand is away from all goals; states (..., F), returns (...)."""
    goals = states[..., 7:].reshape(*states.shape[:-1], blocks, 12)[..., 9:]
    gaps = np.linalg.norm(goals - states[..., None, :3], axis=-1)
    left: BoolArray = (gaps > AWAY).all(axis=-1)
    return left & pick_place.solved(states, blocks)


def sample(shape: str, crowded: bool, rng: Generator, start: fetch.Start, blocks: int) -> tuple[FloatArray, FloatArray]:
    """Draw an episode: places (N, 2) and goals (N, 3) of one of the `SHAPES`."""
    origin = np.array([*start.grip[:2], start.height])
    room = tower_layout.CROWDED if crowded else tower_layout.STACK
    return tower_layout.draw(rng, origin, blocks, SHAPES[shape], room)


@dataclass(frozen=True)
class Tower(pick_place.PickPlace):
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
        """ψ_R: every block closer than 0.05 m to its goal, the hand farther than `AWAY` from every goal."""
        return solved(states, self.blocks)

    def world(self, batch: int) -> pick_place.FetchWorld:
        """Build a world of `batch` rows."""
        return pick_place.FetchWorld(self, batch, partial(sample, self.shape, self.crowded))

    @property
    def script(self) -> demonstrator.Script:
        """What the demonstrator does."""
        return tower_moves.BUILD
