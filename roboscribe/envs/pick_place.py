"""Pick&Place: carry every block to its goal; the last block's goal may be in the air."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.random import Generator

from roboscribe.envs import demonstrator, fetch, tower_layout, tower_moves
from roboscribe.envs.engine import Engine
from roboscribe.envs.tower_layout import HAND_GAP, RANGE
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.protocols import World
from roboscribe.world.trajectory import Trajectory

LIFT = 0.45
"""Greatest height of a goal above a resting block, m."""
TOLERANCE = 0.05
"""A block is at its goal when their centres are closer than this, m."""

Sampler = Callable[[Generator, fetch.Start, int], tuple[FloatArray, FloatArray]]
"""Draws the blocks' places (N, 2) and their goals (N, 3)."""


def sample(crowded: bool, rng: Generator, start: fetch.Start, blocks: int) -> tuple[FloatArray, FloatArray]:
    """Draw an episode: blocks 0.10 m or more from the hand, goals apart, the last one in the air half of the time.

    Source: FetchPickAndPlace-v4 for one block; Sec. 6 for several.
    """
    if blocks > 1:
        origin = np.array([*start.grip[:2], start.height])
        room = tower_layout.CROWDED if crowded else tower_layout.TABLE
        return tower_layout.draw(rng, origin, blocks, tower_layout.on_table, room)
    place = start.grip[:2] + rng.uniform(-RANGE, RANGE, size=(1, 2))
    while np.linalg.norm(place - start.grip[:2]) < HAND_GAP:
        place = start.grip[:2] + rng.uniform(-RANGE, RANGE, size=(1, 2))
    goal = np.append(start.grip[:2] + rng.uniform(-RANGE, RANGE, size=2), start.height)
    if rng.uniform() < 0.5:
        goal[2] += rng.uniform(0.0, LIFT)
    return place, goal[None]


def solved(states: FloatArray, blocks: int) -> BoolArray:
    """Tell whether every block is closer than `TOLERANCE` to its goal; states (..., F), returns (...)."""
    objects = states[..., 7:].reshape(*states.shape[:-1], blocks, 12)
    gaps = np.linalg.norm(objects[..., :3] - objects[..., 9:], axis=-1)
    reached: BoolArray = (gaps < TOLERANCE).all(axis=-1)
    return reached


def checked(rows: IntArray, actions: FloatArray) -> FloatArray:
    """Clip actions (R, A) to [-1, 1].

    Raises:
        ValueError: an action is not finite.
    """
    bad = ~np.isfinite(actions).all(axis=1)
    if bad.any():
        msg = f"actions of rows {np.asarray(rows)[bad].tolist()} are not finite: {actions[bad][0].tolist()}"
        raise ValueError(msg)
    return np.clip(actions, -1.0, 1.0)


@dataclass(frozen=True)
class PickPlace:
    """The task of carrying N blocks to their goals.

    Args:
        name: name in the catalogue.
        blocks: N.
        contact: "stable" or "paper".
        timing: "faithful" (20 x 2 ms) or "fast" (10 x 4 ms).
        horizon: control steps of an episode.
        crowded: blocks may start where fingers find no room beside them.
    """

    name: str
    blocks: int = 1
    contact: str = "stable"
    timing: str = "fast"
    horizon: int = 100
    action_size: int = 4
    frequency: float = fetch.FREQUENCY
    crowded: bool = False

    @cached_property
    def layout(self) -> Layout:
        """Meaning of a state's columns."""
        return fetch.layout(self.blocks)

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: every block closer than `TOLERANCE` to its goal; states (..., F), returns (...)."""
        return solved(states, self.blocks)

    def world(self, batch: int) -> FetchWorld:
        """Build a world of `batch` rows."""
        return FetchWorld(self, batch, partial(sample, self.crowded))

    @property
    def script(self) -> demonstrator.Script:
        """What the demonstrator does."""
        return tower_moves.SINGLE if self.blocks == 1 else tower_moves.SERVE

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect `episodes` successful noisy demonstrations; episode i of a seed does not depend on `episodes`."""
        return demonstrator.collect(self, episodes, seed)


class FetchWorld(World):
    """B rows of a Fetch scene with goals.

    Args:
        task: scene and options.
        batch: B.
        sampler: draws starts and goals.
        threads: simulation threads.
    """

    def __init__(self, task: PickPlace, batch: int, sampler: Sampler, threads: int = 2) -> None:
        """Build the engine; no row holds a state yet."""
        model = fetch.fetch_model(task.blocks, task.contact, task.timing)
        self.batch = batch
        self.control_steps = 0
        self.engine = Engine(model, batch, fetch.TIMINGS[task.timing], threads)
        self._blocks = task.blocks
        self._sampler = sampler
        self._places = fetch.Places(model, task.blocks)
        self._start = fetch.settled(task.blocks)
        self._goals = np.full((batch, task.blocks, 3), np.nan)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes: row `rows[i]` gets the initial state that `seeds[i]` alone decides. Returns (R, F)."""
        states = np.repeat(self._start.state[None], len(rows), axis=0)
        sensors = np.repeat(self._start.sensors[None], len(rows), axis=0)
        for i, (row, seed) in enumerate(zip(rows, seeds, strict=True)):
            places, self._goals[row] = self._sampler(np.random.default_rng(int(seed)), self._start, self._blocks)
            states[i, self._places.block_xy] = places
            sensors[i, self._places.block_site[:, :2]] = places
        self.engine.put(rows, states, sensors)
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, 4), clipped to [-1, 1], for one control step. Returns (R, F).

        Raises:
            ValueError: an action is not finite, or a row was never reset.
        """
        actions = checked(rows, actions)
        self.control_steps += int((~self.engine.failed[rows]).sum())
        states, sensors = self.engine.states[rows], self.engine.sensors[rows]
        self.engine.step(rows, fetch.control(self._places, states, sensors, actions))
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""
        return fetch.observe(self._places, self.engine.states[rows], self.engine.sensors[rows], self._goals[rows])

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        failed: BoolArray = self.engine.failed[rows]
        return failed

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S): integration state, sensor values, goals."""
        return np.concatenate([self.engine.save(rows), self._goals[rows].reshape(len(rows), -1)], axis=1)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S). Returns (R, F).

        Raises:
            TaskError: the snapshots are of another scene.
        """
        width = self.engine.snapshot_size + self._goals[0].size
        if snapshots.shape != (len(rows), width):
            msg = f"snapshots of shape {snapshots.shape}: expected {(len(rows), width)} for {self._blocks} blocks"
            raise TaskError(msg)
        split = self.engine.snapshot_size
        self.engine.load(rows, snapshots[:, :split])
        self._goals[rows] = snapshots[:, split:].reshape(len(rows), -1, 3)
        return self.observe(rows)
