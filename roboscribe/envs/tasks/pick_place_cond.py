"""Pick&Place-Cond: stack a cube and a peg, and maybe a drum, in the order of their goals' heights."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator

from roboscribe.envs import block_layouts, fetch
from roboscribe.envs.block_layouts import Clearance
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script
from roboscribe.envs.fetch_world import FetchTask
from roboscribe.envs.multi_block_demonstrator import HIGH, SPREAD, calm, command
from roboscribe.world.layout import FloatArray

CUBE = fetch.Shape("cube")
PEG = fetch.Shape("peg", (0.02, 0.02, 0.04))
DRUM = fetch.Shape("drum", (0.025, 0.025, 0.02), round=True)
SHAPES = (CUBE, PEG, DRUM)
GRASP = {"cube": 0.0, "peg": 0.02, "drum": 0.0}
"""Height above its centre at which each shape is grasped, m: a peg is held by its upper end."""
STEPS_PER_OBJECT = 50
"""Control steps of an episode for each object."""


def as_blocks(shapes: tuple[fetch.Shape, ...], states: FloatArray) -> FloatArray:
    """Return states (R, F) in which every object is a block around the point where it is grasped, as wide as a block.

    What moves blocks then moves them all.
    """
    changed = states.copy()
    seen = fetch.view(changed)
    above = np.array([GRASP[shape.kind] for shape in shapes])
    seen.blocks[..., 2] += above
    seen.goals[..., 2] += above
    nearest = np.linalg.norm(seen.blocks - seen.hand[:, None], axis=2).argmin(axis=1)
    widths = np.array([2 * shape.half[1] for shape in shapes])
    seen.opening[:] += fetch.BLOCK_SIZE - widths[nearest]
    return changed


def script(shapes: tuple[fetch.Shape, ...]) -> Script:
    """Return what builds a stack of the shapes from below and leaves."""

    def act(clear: float, states: FloatArray) -> FloatArray:
        return command(False, as_blocks(shapes, states), clear=clear)

    def share(states: FloatArray) -> FloatArray:
        return calm(as_blocks(shapes, states))

    return Script(partial(act, CLEAR), partial(act, HIGH), SPREAD, share)


CLEAR = 0.10
"""Height above an object and its goal at which the hand crosses, m: a peg reaches further down than a block."""


@dataclass(frozen=True)
class Cond(FetchTask):
    """The task of stacking objects of different shapes; whose goal is lower decides which comes first."""

    @property
    def scene(self) -> fetch.Scene:
        """One object of each shape."""
        return fetch.Scene(SHAPES[: self.blocks])

    def sample(self, rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
        """Draw an episode: places, and goals one above the other in random order."""
        origin = np.array([*start.grip[:2], start.heights[0]])
        return block_layouts.draw(rng, origin, self.blocks, self._stack, block_layouts.STACK)

    def _stack(self, rng: Generator, count: int, room: Clearance) -> FloatArray | None:
        """Draw goals (N, 3) of a stack, relative to a block that rests in the middle."""
        base = block_layouts.scatter(rng, 1, 0.0, room.side)
        if base is None:
            return None
        goals = np.tile([*(base[0] + block_layouts.SHIFT), 0.0], (count, 1))
        top = -CUBE.half[2]
        for index in rng.permutation(count):
            half = self.scene.shapes[index].half[2]
            goals[index, 2] = top + half
            top += 2 * half
        return goals

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return script(self.scene.shapes)


@register("pick-place-cond", "pick-place-cond-3")
def pick_place_cond(request: Request) -> Cond:
    """Make the task of two objects, or of three."""
    count = 3 if request.name.endswith("-3") else 2
    return Cond(request.name, count, request.contact, request.timing, STEPS_PER_OBJECT * count)
