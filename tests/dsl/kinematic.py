"""A kinematic toy for interpreter tests: a point gripper, blocks that it carries, and controllers written by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.dsl.interpreter import Controller
from roboscribe.dsl.syntax import (
    And,
    Const,
    Diff,
    Exists,
    Get,
    Goal,
    Less,
    Norm,
    Not,
    Object,
    Predicate,
    Program,
    Proj,
    Robot,
    Run,
    Seq,
    Var,
    While,
)
from roboscribe.world import Attribute, Layout, ObjectType, Trajectory
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import Task

XYZ = ("x", "y", "z")
POSITION = Attribute("position", XYZ)
GRIPPER = ObjectType("gripper", (POSITION, Attribute("opening", ("opening",))))
BLOCK = ObjectType("block", (POSITION,), (POSITION,))
FAUCET = ObjectType(
    "faucet", (POSITION, Attribute("angle", ("angle",), "rad")), (Attribute("angle", ("angle",), "rad"),)
)

MU = Robot()
B = Var("b")
OTHER = Var("b'")


def blocks(count: int) -> Layout:
    """Layout of a gripper and `count` blocks."""
    return Layout(GRIPPER, (BLOCK,) * count)


def near(left: Object, right: Object, distance: float) -> Predicate:
    """‖left↓xyz − right↓xyz‖ < distance."""
    return Less(Norm(Diff(Proj(left, "xyz"), Proj(right, "xyz"))), Const(distance))


HOLD = near(MU, B, 0.021)
AT = near(B, Goal(B), 0.05)
LOWER_FIRST = And(
    Not(AT),
    Not(
        Exists(
            OTHER, "block", And(Less(Proj(Goal(OTHER), "z"), Proj(Goal(B), "z")), Not(near(OTHER, Goal(OTHER), 0.05)))
        )
    ),
)
PICK = Run("hold", (MU, B), HOLD)
PLACE = Run("at", (MU, B, Goal(B)), AT)
TOWER = Program("Tower", While(Get(B, "block", LOWER_FIRST), Seq((PICK, PLACE))))


class Reach:
    """Moves to the bound block with open fingers, and closes them there."""

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Act as a `Controller`."""
        away = _block(states, entities[:, 0]) - states[:, :3]
        there = np.linalg.norm(away, axis=1) < 0.02
        return np.hstack((np.clip(away / 0.05, -1, 1), np.where(there, 1.0, -1.0)[:, None]))


class Carry:
    """Moves to the bound block's goal with closed fingers."""

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Act as a `Controller`."""
        away = _block(states, entities[:, 0], goal=True) - states[:, :3]
        return np.hstack((np.clip(away / 0.05, -1, 1), np.ones((len(states), 1))))


CONTROLLERS: dict[str, Controller] = {"hold": Reach(), "at": Carry()}


def _block(states: FloatArray, entity: IntArray, goal: bool = False) -> FloatArray:
    start = 4 + 6 * entity + 3 * goal
    return np.take_along_axis(states, start[:, None] + np.arange(3), axis=1)


@dataclass
class Kinematic:
    """A `World`: the gripper moves 0.05 m per step; closed within 0.03 m of a block it takes the block along."""

    layout: Layout
    batch: int
    broken: int | None = None
    control_steps: int = 0

    def __post_init__(self) -> None:
        """Forget everything."""
        self._states = np.full((self.batch, self.layout.size), np.nan)
        self._diverged = np.zeros(self.batch, dtype=np.bool_)
        self._seeds = np.zeros(self.batch, dtype=np.int64)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Scatter blocks around the place where the goals form a tower."""
        count = len(self.layout.entities)
        for row, seed in zip(rows, seeds, strict=True):
            rng = np.random.default_rng(seed)
            levels = rng.permutation(count)
            angles = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.3, count)) / count
            radii = rng.uniform(0.3, 0.5, count)
            state = [0.0, 0.0, 0.3, 0.0]
            for angle, radius, level in zip(angles, radii, levels, strict=True):
                state += [radius * np.cos(angle), radius * np.sin(angle), 0.0, 0.0, 0.0, 0.06 * level]
            self._states[row] = state
        self._diverged[rows] = False
        self._seeds[rows] = seeds
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Move."""
        self.control_steps += len(rows)
        assert np.isfinite(actions).all()
        for row, action in zip(rows, np.clip(actions, -1, 1), strict=True):
            state = self._states[row]
            bodies = state[4:].reshape(-1, 6)
            away = np.linalg.norm(bodies[:, :3] - state[:3], axis=1)
            state[:3] += 0.05 * action[:3]
            if action[3] > 0 and away.min() < 0.03:
                bodies[away.argmin(), :3] += 0.05 * action[:3]
        self._diverged[rows] = self._seeds[rows] == self.broken
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        """Copy the states."""
        return self._states[rows].copy()

    def diverged(self, rows: IntArray) -> BoolArray:
        """Rows whose seed is `broken`, once they have moved."""
        return self._diverged[rows]

    def save(self, rows: IntArray) -> FloatArray:
        """States are everything there is."""
        return self.observe(rows)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put states back."""
        self._states[rows] = snapshots
        return self.observe(rows)


@dataclass
class Stacking(Task):
    """A `Task`: every block within 0.05 m of its goal."""

    count: int
    broken: int | None = None
    name: str = "stacking"
    action_size: int = 4
    horizon: int = 80
    frequency: float = 25.0

    @property
    def layout(self) -> Layout:
        """Gripper and blocks."""
        return blocks(self.count)

    def solved(self, states: FloatArray) -> BoolArray:
        """Tell whether every block is at its goal."""
        bodies = states[..., 4:].reshape(*states.shape[:-1], self.count, 2, 3)
        answer: BoolArray = (np.linalg.norm(bodies[..., 0, :] - bodies[..., 1, :], axis=-1) < 0.05).all(axis=-1)
        return answer

    def world(self, batch: int) -> Kinematic:
        """Build a world."""
        return Kinematic(self.layout, batch, self.broken)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """No demonstrations here."""
        raise NotImplementedError
