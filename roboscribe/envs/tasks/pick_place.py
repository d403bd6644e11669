"""Pick&Place: carry every block to its goal; the last block's goal may be in the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from roboscribe.envs import block_layouts, fetch, multi_block_demonstrator
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script
from roboscribe.envs.fetch_world import FetchTask
from roboscribe.world.layout import FloatArray

LIFT = 0.45
"""Greatest height of a goal above a resting block, m."""
STEPS, STEPS_PER_BLOCK = 100, 50
"""Control steps of an episode with one block, and for each of several."""


@dataclass(frozen=True)
class PickPlace(FetchTask):
    """The task of carrying N blocks to their goals."""

    def sample(self, rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
        """Draw an episode: blocks 0.10 m or more from the hand, goals apart, the last one in the air in half of all.

        Source: FetchPickAndPlace-v4 for one block; Sec. 6 for several.
        """
        if self.blocks > 1:
            origin = np.array([*start.grip[:2], start.heights[0]])
            room = block_layouts.CROWDED if self.crowded else block_layouts.TABLE
            return block_layouts.draw(rng, origin, self.blocks, block_layouts.on_table, room)
        place, goal = single(rng, start)
        if rng.uniform() < 0.5:
            goal[0, 2] += rng.uniform(0.0, LIFT)
        return place, goal

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return multi_block_demonstrator.SINGLE if self.blocks == 1 else multi_block_demonstrator.SERVE


def single(rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
    """Draw place (1, 2) and goal (1, 3) of one block on the table, as the environments of gymnasium-robotics do."""
    reach = block_layouts.RANGE
    place = start.grip[:2] + rng.uniform(-reach, reach, size=(1, 2))
    while np.linalg.norm(place - start.grip[:2]) < block_layouts.HAND_GAP:
        place = start.grip[:2] + rng.uniform(-reach, reach, size=(1, 2))
    goal = np.append(start.grip[:2] + rng.uniform(-reach, reach, size=2), start.heights[0])
    return place, goal[None]


@register("pick-place-N", "pick-place-N-crowded", examples=("pick-place-1", "pick-place-4"))
def pick_place(request: Request) -> PickPlace:
    """Make the task of N blocks."""
    blocks, crowded = request.number, request.name.endswith("-crowded")
    horizon = STEPS if blocks == 1 else STEPS_PER_BLOCK * blocks
    return PickPlace(request.name, blocks, request.contact, request.timing, horizon, crowded=crowded)
