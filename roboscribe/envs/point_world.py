"""A kinematic world in the plane, of any number of objects and types, that runs in milliseconds.

A point gripper moves at most 5 cm per control step and axis. With its fingers closed it drags the nearest object within
reach; without fingers (`fingers=False`) it pushes what it touches. Drawers slide along x by their handle. Nothing
else moves, nothing is hidden: the observed state decides the future. It exists so that the algorithms can be run end
to end in seconds, with the lookahead controllers below in the place of learned ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from zlib import crc32

import numpy as np

from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.dsl.syntax import Program, Run, Solved
from roboscribe.envs.point_demonstrator import demonstrate
from roboscribe.envs.point_kinematics import TRAVEL, advance
from roboscribe.reward import reward
from roboscribe.world.layout import ROBOT, Attribute, BoolArray, FloatArray, IntArray, Layout, ObjectType
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

AT = 0.03
"""Distance from its goal at which an object counts as placed, metres."""
CLEARANCE = 0.12
"""Least distance between objects, and between an object and a goal, at the start, metres."""
HEADINGS = 12
"""Directions among which a lookahead controller chooses."""
SPEEDS = (1.0, 0.3)
"""Speeds among which it chooses, in full speeds."""
PRICE = 0.002
"""What it pays for a step at full speed, in spreads of R_φ."""
DRIFT = 0.1
"""Speed at which it drifts where no action pays, in full speeds."""


@dataclass(frozen=True)
class PointTask(Task):
    """A task in the plane.

    Args:
        name: task name.
        kinds: type of each entity; the type "drawer" slides, all others are moved freely.
        plane: names of the coordinates: "xz" seen from the side, "xy" from above.
        goals: "free" anywhere; "stack" one above the other, order of the levels shuffled over the entities.
        order: how the demonstrator orders entities: "any", or "height" for lowest goal first; drawers always first.
        fingers: whether the gripper can grasp; else it pushes.
        horizon: control steps of an episode.
    """

    name: str
    kinds: tuple[str, ...]
    plane: str = "xz"
    goals: str = "free"
    order: str = "any"
    fingers: bool = True
    horizon: int = 100
    frequency: float = 10.0
    action_size: int = field(init=False)
    """Displacement along both axes, and fingers (closed above 0) where there are any."""

    def __post_init__(self) -> None:
        """Count the actions."""
        object.__setattr__(self, "action_size", 3 if self.fingers else 2)

    @cached_property
    def layout(self) -> Layout:
        """Gripper with position and opening; objects with position; drawers with handle and opening."""
        position = Attribute("position", tuple(self.plane), "m", -1.0, 2.0)
        opening = Attribute("opening", ("opening",), "m", -0.1, 1.0)
        robot = ObjectType("EE", (position, Attribute("opening", ("opening",), "1", 0.0, 1.0)))
        kinds = {k: ObjectType(k, (position,), (position,)) for k in self.kinds if k != "drawer"}
        kinds["drawer"] = ObjectType("drawer", (position, opening), (opening,))
        return Layout(robot, tuple(kinds[k] for k in self.kinds))

    def solved(self, states: FloatArray) -> BoolArray:
        """Every entity is at its goal; a drawer within AT of its opening."""
        layout = self.layout
        answer = np.ones(states.shape[:-1], dtype=np.bool_)
        for i, kind in enumerate(layout.entities):
            name = kind.goal[0].name
            away = states[..., layout.columns[i, name, False]] - states[..., layout.columns[i, name, True]]
            answer &= np.einsum("...i,...i->...", away, away) < AT**2
        return answer

    def world(self, batch: int) -> PointWorld:
        """Build a world of `batch` rows."""
        return PointWorld(self, batch)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect successful noisy demonstrations."""
        return demonstrate(self, episodes, seed)

    def controller(self, run: Run, scales: Mapping[str, float], seed: int) -> Lookahead:
        """Return the task's own controller for a statement."""
        return Lookahead(self, run, scales, seed)

    def initial(self, seed: int) -> FloatArray:
        """Sample an initial state (F,) that `seed` alone decides."""
        rng = np.random.default_rng(seed)
        layout = self.layout
        state = np.zeros(layout.size)
        free = [i for i, k in enumerate(self.kinds) if k != "drawer"]
        places = _scattered(rng, 2 * len(free) + 1)
        while not self.fingers and _behind(places, len(free)):
            places = _scattered(rng, 2 * len(free) + 1)
        state[layout.columns[ROBOT, "position", False]] = places[-1]
        state[layout.columns[ROBOT, "opening", False]] = 1.0
        goals = self._stack(rng, len(free)) if self.goals == "stack" else places[len(free) : -1]
        for place, (i, goal) in zip(places, zip(free, goals, strict=True), strict=False):
            state[layout.columns[i, "position", False]] = place
            state[layout.columns[i, "position", True]] = goal
        for i in layout.of_type("drawer"):
            state[layout.columns[i, "position", False]] = (0.1, 1.1)
            state[layout.columns[i, "opening", True]] = TRAVEL
        return state

    @staticmethod
    def _stack(rng: np.random.Generator, count: int) -> FloatArray:
        """One column of goals right of where objects start, levels dealt out at random."""
        base = np.array([rng.uniform(1.2, 1.4), 0.05])
        levels = rng.permutation(count)
        return np.asarray(base + np.outer(levels, [0.0, 0.15]))


def _scattered(rng: np.random.Generator, count: int) -> FloatArray:
    """Points in the unit square, CLEARANCE apart, (count, 2)."""
    points: list[FloatArray] = []
    while len(points) < count:
        point = rng.uniform(0.0, 1.0, 2)
        if all(np.linalg.norm(point - other) > CLEARANCE for other in points):
            points.append(point)
    return np.stack(points)


def _behind(places: FloatArray, count: int) -> bool:
    """Whether the gripper (last) starts behind one of `count` objects, as seen from its goal: half of pushing it."""
    to_goal, to_hand = places[count:-1] - places[:count], places[-1] - places[:count]
    return bool((np.einsum("ni,ni->n", to_goal, to_hand) < 0.0).any())


class PointWorld:
    """B copies of a point task; a snapshot is the state itself."""

    def __init__(self, task: PointTask, batch: int) -> None:
        """Make room; rows hold nothing until reset or loaded."""
        self.task = task
        self.batch = batch
        self.control_steps = 0
        self._states = np.full((batch, task.layout.size), np.nan)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes from seeds."""
        self._states[rows] = np.stack([self.task.initial(int(seed)) for seed in seeds])
        return self._states[rows].copy()

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Move `rows` one control step."""
        self._states[rows] = advance(self.task.layout, self.task.fingers, self._states[rows], actions)
        self.control_steps += len(rows)
        return self._states[rows].copy()

    def observe(self, rows: IntArray) -> FloatArray:
        """Return states."""
        return self._states[rows].copy()

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which rows are no longer finite: none ever, kinematics cannot break."""
        broken: BoolArray = ~np.isfinite(self._states[rows]).all(axis=-1)
        return broken

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots."""
        return self._states[rows].copy()

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Restore snapshots."""
        self._states[rows] = snapshots
        return self._states[rows].copy()


@dataclass(frozen=True, eq=False)
class Lookahead:
    """A controller that tries a fixed set of actions in the kinematic model and takes the most rewarding.

    It stands where a learned controller would: greedy for R_φ, less a small price of motion, one step ahead, hence
    as short-sighted as a learner without subgoals, and nearly still, in random directions, where no action pays.
    """

    task: PointTask
    run: Run
    scales: Mapping[str, float]
    seed: int = 0

    @cached_property
    def _choices(self) -> FloatArray:
        """Every action on offer (C, A): open fingers first, for of equals the first is taken."""
        turns = np.linspace(0.0, 2 * np.pi, HEADINGS, endpoint=False)
        heading = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        moves: FloatArray = np.concatenate([speed * heading for speed in SPEEDS])
        if not self.task.fingers:
            return moves
        opened, closed = (np.column_stack([moves, np.full(len(moves), f)]) for f in (-1.0, 1.0))
        return np.asarray(np.vstack([opened, closed]), dtype=np.float64)

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Choose an action (R, A) for states (R, F)."""
        rng = np.random.default_rng([self.seed, crc32(states.tobytes())])  # memoryless, yet reproducible
        choices = self._choices
        drawn = choices[rng.integers(len(choices), size=len(states))]
        if isinstance(self.run.until, Solved):
            return np.asarray(drawn)
        after = advance(self.task.layout, self.task.fingers, states[:, None], choices[None])
        value = self._reward(np.concatenate([states[:, None], after], axis=1), entities)
        gain = value[:, 1:] - value[:, :1] - PRICE * np.linalg.norm(choices[:, :2], axis=1)
        best = choices[gain.argmax(axis=1)]
        drift = DRIFT * drawn[:, :2] / np.linalg.norm(drawn[:, :2], axis=1, keepdims=True)
        pays = gain.max(axis=1, keepdims=True) > 0.0
        action: FloatArray = np.concatenate([np.where(pays, best[:, :2], drift), best[:, 2:]], axis=1)
        return action

    def _reward(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """R_φ in states (R, C, F) for entities (R, n); as flat rows, which are evaluated fastest."""
        rows, choices, width = states.shape
        names = run_variables(self.run)
        binding = {name: np.repeat(entities[:, j], choices) for j, name in enumerate(names)}
        flat = states.reshape(-1, width)
        layout, solved = self.task.layout, self.task.solved
        return reward(self.run.until, flat, binding, layout, self.scales, solved).reshape(rows, choices)


def lookahead_skills(
    task: PointTask, program: Program, scales: Callable[[str], Mapping[str, float]], seed: int = 0
) -> dict[str, Lookahead]:
    """Return a lookahead controller for every controller statement of a program."""
    return {run.controller: Lookahead(task, run, scales(run.controller), seed) for run in controllers(program)}


POINT_TASKS: dict[str, PointTask] = {
    task.name: task
    for task in (
        PointTask("point-pick-place-1", ("block",)),
        PointTask("point-tower-3", ("block",) * 3, goals="stack", order="height", horizon=250),
        PointTask("point-tower-4", ("block",) * 4, goals="stack", order="height", horizon=330),
        PointTask("point-tower-5", ("block",) * 5, goals="stack", order="height", horizon=400),
        PointTask("point-place-3", ("block",) * 3, horizon=250),
        PointTask("point-drawer-3", ("drawer", "cube", "cube", "cube"), horizon=300),
        PointTask("point-peg-cube", ("peg", "cube"), goals="stack", order="height", horizon=200),
        PointTask("point-push-1", ("block",), plane="xy", fingers=False, horizon=150),
    )
}
