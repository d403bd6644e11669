"""A scripted demonstrator for the Fetch scene with one block, and demonstrations with correlated noise.

Its command is a smooth function of the observed state alone (hand, finger opening, block, goal), so that a learner
without memory can imitate it. Hand and block move in funnels: the farther from the axis above the target, the higher.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.protocols import Task, World
from roboscribe.world.trajectory import Trajectory

GAIN = 16.0
"""Commanded displacement per metre of error, in actions."""
GRIP = 0.053
"""The fingers have closed on a block when they are nearer than this, m."""
OPEN = 0.085
"""Fingers wider than this pass a block on both sides, m."""
NEAR = 0.02
"""The hand is around a block when their centres are closer than this, m."""
TIP_BLOCK, TIP_GOAL = 0.012, 0.02
"""Hand and block come down within this distance of the axis, m."""
LOW_FETCH, LOW_CARRY = 0.06, 0.04
"""Height of approach to a block, and to its goal, m."""
HOVER = 0.06
"""Fingers that are not open yet keep this high above the block, m."""
PINCH = 0.6
"""Finger command, well beyond what saturates the fingers and well within what noise can reverse."""
STAY = 10
"""An episode ends when the task has been solved for this many states in a row."""
SPREAD = np.array([0.15, 0.15, 0.15, 0.1])
"""Standard deviation of the noise."""
MEMORY = 0.7
"""Correlation of the noise from one step to the next."""
BATCH = 64
"""Episodes run at once."""
LEAST = 0.5
"""Share of episodes that must succeed for a demonstrator to be one."""


def ramp(values: FloatArray, low: float, high: float) -> FloatArray:
    """Rise linearly from 0 at `low` to 1 at `high`."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def funnel(radius: FloatArray, tip: float, top: float) -> FloatArray:
    """Height to keep at a horizontal distance: 0 within `tip`, then three times as steep as wide, up to `top`."""
    return np.clip(3.0 * (radius - tip), 0.0, top)


def command(states: FloatArray) -> FloatArray:
    """Decide the noiseless action for one block: open, come down on it, close, carry it to its goal from above.

    Args:
        states: (R, 19) states of a Fetch scene.

    Returns:
        (R, 4) actions in [-1, 1].
    """
    hand, opening, block, goal = states[:, :3], states[:, 3], states[:, 7:10], states[:, 16:19]
    around = np.linalg.norm(block - hand, axis=1) < NEAR
    closed = ramp(-opening, -GRIP - 0.003, -GRIP)[:, None]
    carry = closed * _route(block, goal, TIP_GOAL, LOW_CARRY)
    move = GAIN * np.where(around[:, None] & (closed > 0), carry, _fetch(hand, opening, block, around))
    return np.concatenate([np.clip(move, -1.0, 1.0), np.where(around, -PINCH, PINCH)[:, None]], axis=1)


def _fetch(hand: FloatArray, opening: FloatArray, block: FloatArray, around: BoolArray) -> FloatArray:
    """Displacement (R, 3) towards the block through a funnel above it, and down only with open fingers."""
    gap = _route(hand, block, TIP_BLOCK, LOW_FETCH)
    narrow = np.where(around, 0.0, HOVER * ramp(-opening, -OPEN, -OPEN + 0.03))
    gap[:, 2] = np.maximum(gap[:, 2], block[:, 2] - hand[:, 2] + narrow)
    return gap


def _route(start: FloatArray, end: FloatArray, tip: float, low: float) -> FloatArray:
    """Displacement (R, 3) from `start` towards `end`, coming down a funnel within `tip` of the axis above `end`."""
    gap = end - start
    gap[:, 2] += funnel(np.linalg.norm(gap[:, :2], axis=1), tip, low)
    return gap


@dataclass(frozen=True)
class Style:
    """How demonstrations are given.

    Args:
        command: the noiseless action (R, 4) in states (R, F).
        spread: (4,) standard deviation of the noise.
        share: the share (R,) of the noise that is applied in states (R, F).
    """

    command: Callable[[FloatArray], FloatArray]
    spread: FloatArray
    share: Callable[[FloatArray], FloatArray]


SINGLE = Style(command, SPREAD, lambda states: np.ones(len(states)))
"""One block."""


@dataclass
class Episode:
    """One running episode: its own random numbers, its noise, and what was recorded."""

    seed: int
    rng: Generator
    states: list[FloatArray] = field(default_factory=list)
    actions: list[FloatArray] = field(default_factory=list)
    snapshots: list[FloatArray] = field(default_factory=list)
    noise: FloatArray = field(default_factory=lambda: np.zeros(4))
    solved: int = 0

    def disturb(self, action: FloatArray, spread: FloatArray, share: float) -> FloatArray:
        """Add a share of the next correlated noise (Ornstein-Uhlenbeck) to an action (4,), within its bounds."""
        fresh = self.rng.normal(size=4) * spread
        self.noise = MEMORY * self.noise + np.sqrt(1 - MEMORY**2) * fresh
        return np.clip(action + share * self.noise, -1.0, 1.0)

    def record(self, state: FloatArray, snapshot: FloatArray, solved: bool) -> None:
        """Append what was observed."""
        self.states.append(state)
        self.snapshots.append(snapshot)
        self.solved = self.solved + 1 if solved else 0


def start(seed: int, index: int) -> Episode:
    """Prepare episode `index` of a seed; it depends on nothing else."""
    rng = np.random.default_rng(np.random.SeedSequence((seed, index)))
    return Episode(int(rng.integers(2**62)), rng)


def collect(task: Task, episodes: int, seed: int, style: Style = SINGLE) -> list[Trajectory]:
    """Collect successful noisy demonstrations of a Fetch task.

    Args:
        task: its layout is that of a Fetch scene.
        episodes: how many to return.
        seed: decides everything; a longer collection starts with the shorter one.
        style: how it is done.

    Raises:
        TaskError: fewer than half of the attempts succeed.
    """
    world = task.world(min(BATCH, max(episodes, 1)))
    found: list[Trajectory] = []
    tried = 0
    while len(found) < episodes:
        if tried > 2 * BATCH and len(found) < LEAST * tried:
            msg = f"the demonstrator of {task.name} solved {len(found)} of {tried} episodes, expected at least half"
            raise TaskError(msg)
        wave = [start(seed, tried + i) for i in range(world.batch)]
        run(task, world, wave, style)
        found += [trajectory(task, episode) for episode in wave if episode.solved == STAY]
        tried += len(wave)
    return found[:episodes]


def run(task: Task, world: World, wave: list[Episode], style: Style = SINGLE) -> None:
    """Run a wave of episodes, one per row, until each has stayed solved, left physics or met the horizon."""
    rows = np.arange(len(wave))
    states = world.reset(rows, np.array([episode.seed for episode in wave], dtype=np.int64))
    _record(task, world, rows, states, wave)
    for _ in range(task.horizon):
        running = ~world.diverged(rows) & np.array([wave[row].solved < STAY for row in rows])
        rows, states = rows[running], states[running]
        if len(rows) == 0:
            return
        wanted = zip(rows, style.command(states), style.share(states), strict=True)
        actions = np.array([wave[row].disturb(action, style.spread, share) for row, action, share in wanted])
        states = world.step(rows, actions)
        for row, action in zip(rows, actions, strict=True):
            wave[row].actions.append(action)
        _record(task, world, rows, states, wave)


def _record(task: Task, world: World, rows: IntArray, states: FloatArray, wave: list[Episode]) -> None:
    """Append the present states and snapshots of `rows` to their episodes."""
    observed = zip(rows, states, world.save(rows), task.solved(states), strict=True)
    for row, state, snapshot, solved in observed:
        wave[row].record(state, snapshot, bool(solved))


def trajectory(task: Task, episode: Episode) -> Trajectory:
    """Freeze what an episode recorded."""
    return Trajectory(task.layout, np.array(episode.states), np.array(episode.actions), np.array(episode.snapshots))
