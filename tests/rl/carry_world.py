"""A kinematic toy in which skills are learned in seconds: a hand in the plane that drags blocks it is close to."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from roboscribe.dsl.syntax import Const, Diff, Get, Goal, Less, Norm, Program, Proj, Robot, Run, Seq, Truth, Var
from roboscribe.world import Attribute, Layout, ObjectType, Trajectory
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import Task

PLANE = Attribute("position", ("x", "y"))
STEP, REACH, NEAR, THERE = 0.05, 0.04, 0.04, 0.05
b, mu = Var("b"), Robot()


def distance(left: Robot | Var | Goal, right: Robot | Var | Goal) -> Norm:
    return Norm(Diff(Proj(left, "xy"), Proj(right, "xy")))


HOLD = Less(distance(mu, b), Const(NEAR))
AT = Less(distance(b, Goal(b)), Const(0.08))
PROGRAM = Program("Carry", Seq((Get(b, "block", Truth()), Run("hold", (mu, b), HOLD), Run("at", (mu, b, Goal(b)), AT))))


def layout(blocks: int = 1) -> Layout:
    block = ObjectType("block", (PLANE,), (PLANE,))
    return Layout(ObjectType("EE", (PLANE,)), (block,) * blocks)


@dataclass
class CarryWorld:
    batch: int
    blocks: int = 1
    control_steps: int = 0
    states: FloatArray = field(init=False)
    broken: BoolArray = field(init=False)

    def __post_init__(self) -> None:
        self.states = np.zeros((self.batch, 2 + 4 * self.blocks))
        self.broken = np.zeros(self.batch, np.bool_)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        for row, seed in zip(rows, seeds, strict=True):
            self.states[row] = np.random.default_rng(int(seed)).uniform(-0.3, 0.3, self.states.shape[1])
        self.broken[rows] = False
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        self.control_steps += len(rows)
        move = STEP * np.clip(actions, -1, 1)
        for first in range(2, self.states.shape[1], 4):
            block = self.states[rows, first : first + 2]
            near = np.linalg.norm(block - self.states[rows, :2], axis=1) < REACH
            self.states[rows, first : first + 2] = block + near[:, None] * move
        self.states[rows, :2] += move
        self.broken[rows] |= np.abs(self.states[rows, :2]).max(axis=1) > 1
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        return self.states[rows].copy()

    def diverged(self, rows: IntArray) -> BoolArray:
        return self.broken[rows].copy()

    def save(self, rows: IntArray) -> FloatArray:
        return np.concatenate([self.states[rows], self.broken[rows, None]], axis=1)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        self.states[rows] = snapshots[:, :-1]
        self.broken[rows] = snapshots[:, -1] > 0
        return self.observe(rows)


@dataclass(frozen=True)
class Carry(Task):
    blocks: int = 1
    name: str = "carry"
    action_size: int = 2
    horizon: int = 60
    frequency: float = 25.0

    @property
    def layout(self) -> Layout:
        return layout(self.blocks)

    def solved(self, states: FloatArray) -> BoolArray:
        gaps = [states[..., i : i + 2] - states[..., i + 2 : i + 4] for i in range(2, states.shape[-1], 4)]
        return np.asarray(np.all([np.linalg.norm(gap, axis=-1) < THERE for gap in gaps], axis=0))

    def world(self, batch: int) -> CarryWorld:
        return CarryWorld(batch, self.blocks)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        return [self._episode(np.random.default_rng([seed, rank])) for rank in range(episodes)]

    def _episode(self, rng: np.random.Generator) -> Trajectory:
        world, row = self.world(1), np.zeros(1, np.int64)
        states, actions = [world.reset(row, rng.integers(2**31, size=1))[0]], list[FloatArray]()
        while not self.solved(states[-1]) and len(actions) < self.horizon:
            hand, block, goal = states[-1][:2], states[-1][2:4], states[-1][4:6]
            way = goal - block if np.linalg.norm(block - hand) < NEAR else block - hand
            actions.append(np.clip(way / STEP + rng.normal(0, 0.2, 2), -1, 1))
            states.append(world.step(row, actions[-1][None])[0])
        return Trajectory(self.layout, np.array(states), np.array(actions).reshape(-1, 2))


class Direct:
    """Acts by formula: towards the entity, or carrying it to its goal."""

    def __init__(self, carry: bool) -> None:
        self.carry = carry

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        first = 2 + 4 * entities[:, 0]
        at = first[:, None] + np.arange(4)
        found = np.take_along_axis(states, at, axis=1)
        way = found[:, 2:] - found[:, :2] if self.carry else found[:, :2] - states[:, :2]
        return np.clip(way / STEP, -1, 1)
