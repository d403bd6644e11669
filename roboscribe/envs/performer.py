"""Gives an episode in a style: alters, step by step, what a memoryless script commands in a Fetch scene.

Unlike a script a performer remembers: it pauses for a while, goes to a way-point, or opens its fingers until the block
has fallen. Whatever it does, the script goes on from the state in which it leaves the scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from roboscribe.envs.fetch import view
from roboscribe.envs.single_block_demonstrator import GAIN, NEAR, OPEN, PINCH
from roboscribe.envs.styles import Style
from roboscribe.world.layout import FloatArray

GRIP = 0.054
"""Fingers nearer than this hold a block that the hand is around, m."""
LIFTED, HIGH = 0.02, 0.12
"""A held block is carried from the first height above the blocks' first places on, and slips below the second, m."""
DELIVERED = 0.1
"""A held block that is closer than this to its goal is not let go, nor taken for a detour, m."""
ALONE = 0.09
"""Fingers are clumsy where every block but one is farther off than this, seen from above, m."""
ROOM = 0.06
"""A detour begins where the hand is this much higher than every block that it does not hold, m."""
AXIS, SHORT = 0.03, (0.04, 0.07)
"""Fingers may miss a block when the hand comes down this close to the axis above it, between these heights, m."""
CRUISE = (0.1, 0.2)
"""Height of a way-point above every block that is not held, m."""
ARRIVED = 0.03
"""A way-point is reached within this distance, m."""
MARGIN = 0.05
"""Way-points lie at most this far outside the box around hand, blocks and goals, m."""
AWAY = 0.2
"""How far the hand rises from a block that it gives up, m."""
PAUSE = (5, 25)
"""Shortest and longest pause, control steps: 0.2 to 1 s."""
DROP, MISS, DETOUR, LEAVE = 6, 8, 30, 25
"""Control steps of letting go, of closing the fingers in vain, of a detour at most, and of leaving."""
SLIP, TURN = 4, 6
"""Steps at full speed within which a carried block is dropped, if it is, and a detour begins where there is room."""


@dataclass(frozen=True)
class Scene:
    """What a performer looks at.

    Args:
        hand: (3,) position, m.
        sinks: whether the hand moves downwards.
        opening: distance between the fingers, m.
        blocks: (N, 3) positions, m.
        goals: (N, 3) where they belong, m.
        held: index of the block between closed fingers; -1 for none.
    """

    hand: FloatArray
    sinks: bool
    opening: float
    blocks: FloatArray
    goals: FloatArray
    held: int

    @staticmethod
    def of(state: FloatArray) -> Scene:
        """Read a state (F,)."""
        seen = view(state)
        gaps = np.linalg.norm(seen.blocks - seen.hand, axis=1)
        held = int(gaps.argmin()) if seen.opening < GRIP and gaps.min() < NEAR else -1
        return Scene(seen.hand, bool(seen.velocity[2] < 0), float(seen.opening), seen.blocks, seen.goals, held)

    @property
    def others(self) -> FloatArray:
        """Positions (M, 3) of the blocks that are not held."""
        return self.blocks if self.held < 0 else np.delete(self.blocks, self.held, axis=0)

    @property
    def delivers(self) -> bool:
        """Whether the hand brings a block to its goal, or keeps it there."""
        return self.held >= 0 and bool(np.linalg.norm((self.blocks - self.goals)[self.held]) < DELIVERED)

    @property
    def alone(self) -> bool:
        """Whether at most one block is near the hand, seen from above."""
        return int((np.linalg.norm((self.blocks - self.hand)[:, :2], axis=1) < ALONE).sum()) <= 1

    @property
    def approaches(self) -> bool:
        """Whether the hand with open fingers comes down on a block, and is not around it yet."""
        gaps = self.hand - self.blocks
        above = (np.linalg.norm(gaps[:, :2], axis=1) < AXIS) & (SHORT[0] < gaps[:, 2]) & (gaps[:, 2] < SHORT[1])
        return self.sinks and self.opening > OPEN and bool(above.any())


@dataclass(frozen=True)
class Interlude:
    """What is done for a while in the place of the script's command.

    Args:
        steps: control steps, at most.
        target: (3,) where the hand goes; None: it stands still, without noise.
        fingers: finger command; None: the script's.
        last: nothing comes after it.
    """

    steps: int
    target: FloatArray | None = None
    fingers: float | None = None
    last: bool = False

    def reached(self, hand: FloatArray) -> bool:
        """Tell whether the hand is where it was to go."""
        return self.target is not None and bool(np.linalg.norm(self.target - hand) < ARRIVED)

    def action(self, scripted: FloatArray, hand: FloatArray) -> FloatArray:
        """Return the action (4,) instead of the scripted one."""
        move = np.zeros(3) if self.target is None else np.clip(GAIN * (self.target - hand), -1.0, 1.0)
        return np.append(move, scripted[3] if self.fingers is None else self.fingers)


@dataclass
class Performer:
    """Gives one episode.

    Args:
        style: how.
        rng: decides what happens when.
        gives_up: drop a block on the way, and leave it.
        look: reads a state (F,).
    """

    style: Style
    rng: Generator
    gives_up: bool = False
    look: Callable[[FloatArray], Scene] = Scene.of
    left: bool = False
    """It has given up and gone."""
    _interlude: Interlude | None = None
    _steps: int = 0
    _lying: float = np.nan
    _carried: int = 0
    """Steps for which a block has been carried, this time."""
    _carryings: int = 0
    """How often one was, this time included."""
    _slips_after: int = 0
    """Steps of this carrying after which the block slips; 0 for never."""
    _leaves: tuple[int, int] = (0, 0)
    """Carrying in which it gives up, and steps of it before."""
    _held: bool | None = None
    _turns_after: int = 0
    """Steps with room for it after which this way leads into a detour; 0 for never."""
    _approached: bool = False
    """Whether it is decided if the fingers miss the next block."""

    def act(self, state: FloatArray, scripted: FloatArray, solved: bool) -> tuple[FloatArray, float]:
        """Alter what the script commands.

        Args:
            state: (F,).
            scripted: (4,) action in it: displacement of the hand, fingers.
            solved: whether the task is; then nothing new begins.

        Returns:
            The action (4,) without noise, and the share of the noise to add.
        """
        scene = self.look(state)
        self._watch(scene)
        if self._interlude is not None and (self._steps == 0 or self._interlude.reached(scene.hand)):
            self.left, self._interlude = self._interlude.last, None
        if self._interlude is None and not solved:
            self._interlude = self._begin(scene)
            self._steps = self._interlude.steps if self._interlude is not None else 0
        if self._interlude is None:
            return self._paced(scripted), self.style.noise
        self._steps -= 1
        still = self._interlude.target is None
        return self._paced(self._interlude.action(scripted, scene.hand)), 0.0 if still else self.style.noise

    def _paced(self, action: FloatArray) -> FloatArray:
        """Apply the style's speed to the displacement, not to the fingers."""
        return np.append(np.clip(self.style.speed * action[:3], -1.0, 1.0), action[3])

    def _watch(self, scene: Scene) -> None:
        """Keep account of what is carried, and decide what happens to it."""
        if np.isnan(self._lying):
            self._lying = float(scene.blocks[:, 2].max())
            if self.gives_up:
                self._leaves = 1 + int(self.rng.integers(len(scene.blocks))), self._within(SLIP)
        carries = scene.held >= 0 and bool(scene.blocks[scene.held, 2] > self._lying + LIFTED)
        self._carried = self._carried + 1 if carries else 0
        if self._carried == 1:
            self._carryings += 1
            self._slips_after = self._within(SLIP) if self.rng.random() < self.style.drops else 0
        if self._held != (scene.held >= 0):
            self._held = scene.held >= 0
            self._turns_after = self._within(TURN) if self.rng.random() < self.style.detours else 0
        self._approached &= scene.held < 0

    def _within(self, steps: int) -> int:
        """Draw from 1 to `steps`, or more where the style is slow."""
        return 1 + int(self.rng.integers(round(steps / min(self.style.speed, 1.0))))

    def _begin(self, scene: Scene) -> Interlude | None:
        """Begin what the script does not know; None to follow the script."""
        return self._leave(scene) or self._drop(scene) or self._miss(scene) or self._detour(scene) or self._pause()

    def _leave(self, scene: Scene) -> Interlude | None:
        """Drop the block for good and rise."""
        carrying, steps = self._leaves
        if not self.gives_up or self._carryings < carrying or self._carried < steps:
            return None
        return Interlude(LEAVE, scene.hand + np.array([0.0, 0.0, AWAY]), PINCH, last=True)

    def _drop(self, scene: Scene) -> Interlude | None:
        """Let go of the block, where it falls on none."""
        if self._slips_after == 0 or self._carried < self._slips_after or scene.delivers or not scene.alone:
            return None
        if scene.blocks[scene.held, 2] > self._lying + HIGH:
            return None
        self._slips_after = 0
        return Interlude(DROP, fingers=PINCH)

    def _miss(self, scene: Scene) -> Interlude | None:
        """Close the fingers above a block; decided once for every block that is fetched."""
        if self.style.misses == 0 or self._approached or not (scene.approaches and scene.alone):
            return None
        self._approached = True
        return Interlude(MISS, fingers=-PINCH) if self.rng.random() < self.style.misses else None

    def _detour(self, scene: Scene) -> Interlude | None:
        """Go to a way-point above everything, from where there is room on all sides; once on every way."""
        top = float(scene.others[:, 2].max(initial=self._lying))
        loose = self._carried > 0 or scene.held < 0
        if self._turns_after == 0 or not loose or scene.delivers or scene.hand[2] < top + ROOM:
            return None
        self._turns_after -= 1
        if self._turns_after > 0:
            return None
        seen = np.vstack([scene.hand, scene.blocks, scene.goals])[:, :2]
        place = self.rng.uniform(seen.min(axis=0) - MARGIN, seen.max(axis=0) + MARGIN)
        return Interlude(DETOUR, np.append(place, top + self.rng.uniform(*CRUISE)))

    def _pause(self) -> Interlude | None:
        """Stand still."""
        if self.style.pauses == 0 or self.rng.random() >= self.style.pauses:
            return None
        return Interlude(int(self.rng.integers(PAUSE[0], PAUSE[1] + 1)))
