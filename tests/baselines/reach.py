"""The simplest task of all: a hand in the plane whose tip has to come to a goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.world import Attribute, Layout, ObjectType, Task, Trajectory
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

PLANE = Attribute("position", ("x", "y"))
STEP, THERE = 0.05, 0.05


class ReachWorld:
    """Rows of hand (2), tip (2) and goal (2)."""

    def __init__(self, batch: int) -> None:
        self.batch, self.control_steps = batch, 0
        self.states = np.zeros((batch, 6))

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        drawn = np.array([np.random.default_rng(int(seed)).uniform(-0.5, 0.5, 4) for seed in seeds])
        self.states[rows] = np.concatenate([drawn[:, :2], drawn], axis=1)
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        self.control_steps += len(rows)
        self.states[rows, :4] += STEP * np.tile(np.clip(actions, -1, 1), 2)
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        return self.states[rows].copy()

    def diverged(self, rows: IntArray) -> BoolArray:
        return np.zeros(len(rows), np.bool_)

    def save(self, rows: IntArray) -> FloatArray:
        return self.observe(rows)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        self.states[rows] = snapshots
        return self.observe(rows)


@dataclass(frozen=True)
class Reach(Task):
    name: str = "reach"
    action_size: int = 2
    horizon: int = 30
    frequency: float = 25.0

    @property
    def layout(self) -> Layout:
        return Layout(ObjectType("EE", (PLANE,)), (ObjectType("tip", (PLANE,), (PLANE,)),))

    def solved(self, states: FloatArray) -> BoolArray:
        solved: BoolArray = np.linalg.norm(states[..., 2:4] - states[..., 4:6], axis=-1) < THERE
        return solved

    def world(self, batch: int) -> ReachWorld:
        return ReachWorld(batch)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        return [self._episode(np.random.default_rng([seed, rank])) for rank in range(episodes)]

    def _episode(self, rng: np.random.Generator) -> Trajectory:
        world, row = self.world(1), np.zeros(1, np.int64)
        states, actions = [world.reset(row, rng.integers(2**31, size=1))[0]], []
        while not self.solved(states[-1]):
            way = (states[-1][4:] - states[-1][2:4]) / STEP
            actions.append(np.clip(way + rng.normal(0, 0.1, 2), -1, 1))
            states.append(world.step(row, actions[-1][None])[0])
        return Trajectory(self.layout, np.array(states), np.array(actions).reshape(-1, 2))
