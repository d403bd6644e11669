"""Push: move every block to its goal on the table with closed fingers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from roboscribe.envs import block_layouts, fetch, push_demonstrator
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script
from roboscribe.envs.fetch_world import FetchTask
from roboscribe.envs.tasks.pick_place import single
from roboscribe.world.layout import FloatArray

STEPS, STEPS_PER_BLOCK = 100, 50
"""Control steps of an episode with one block, and for each of several."""


@dataclass(frozen=True)
class Push(FetchTask):
    """The task of pushing N blocks to their goals."""

    @property
    def scene(self) -> fetch.Scene:
        """Blocks, closed fingers."""
        return fetch.Scene.of_blocks(self.blocks, pushing=True)

    def sample(self, rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
        """Draw an episode: blocks 0.10 m or more from the hand, from each other and from the goals.

        Source: FetchPush-v4 for one block; Sec. 6 for several.
        """
        if self.blocks == 1:
            return single(rng, start)
        origin = np.array([*start.grip[:2], start.heights[0]])
        room = block_layouts.PUSH_CROWDED if self.crowded else block_layouts.PUSH
        return block_layouts.draw(rng, origin, self.blocks, block_layouts.flat, room)

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return push_demonstrator.PUSH


@dataclass(frozen=True)
class Confined(Push):
    """Goals side by side on a line near the table's far edge, where only pushing the farthest block first works."""

    def sample(self, rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
        """Draw an episode: goals on a line, blocks away from it."""
        origin = np.array([*start.grip[:2], start.heights[0]])
        return block_layouts.draw(rng, origin, self.blocks, block_layouts.line, block_layouts.LINE)

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return push_demonstrator.PUSH_CONFINED


@register("push-confined-N", examples=("push-confined-3",))
def confined(request: Request) -> Confined:
    """Make the task of N blocks with their goals on a line."""
    blocks = request.number
    return Confined(request.name, blocks, request.contact, request.timing, STEPS_PER_BLOCK * blocks)


@register("push-N", "push-N-crowded", examples=("push-1", "push-3"))
def push(request: Request) -> Push:
    """Make the task of N blocks."""
    blocks, crowded = request.number, request.name.endswith("-crowded")
    horizon = STEPS if blocks == 1 else STEPS_PER_BLOCK * blocks
    return Push(request.name, blocks, request.contact, request.timing, horizon, crowded=crowded)
