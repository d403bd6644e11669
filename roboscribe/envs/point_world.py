"""A kinematic world in the plane, of any number of objects and types, that runs in milliseconds.

A point gripper moves at most `STEP` per control step. With its fingers closed it drags the nearest object within
`REACH`; without fingers (`fingers=False`) it pushes what it touches. Drawers slide along x by their handle. Nothing
else moves, nothing is hidden: the observed state decides the future. It exists so that the algorithms can be run end
to end in seconds, with the lookahead controllers below in the place of learned ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from zlib import crc32

import numpy as np

from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.dsl.syntax import Program, Run, Solved
from roboscribe.envs.point_demonstrator import demonstrate
from roboscribe.reward import reward
from roboscribe.world.layout import ROBOT, Attribute, BoolArray, FloatArray, IntArray, Layout, ObjectType
from roboscribe.world.trajectory import Trajectory

STEP = 0.05
"""Greatest displacement of the gripper in one control step, metres per axis."""
REACH = 0.03
"""Distance within which closed fingers drag an object, and within which a finger-less gripper pushes, metres."""
GRASP = 0.01
"""Distance to which a dragged object settles in the fingers, metres."""
AT = 0.03
"""Distance from its goal at which an object counts as placed, metres."""
CLEARANCE = 0.12
"""Least distance between objects, and between an object and a goal, at the start, metres."""
SUBSTEPS = 5
"""Parts of a step in which pushing is resolved, so that the gripper cannot jump over what it touches."""
TRAVEL = 0.2
"""Opening of a drawer, metres."""


@dataclass(frozen=True)
class PointTask:
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

    @property
    def action_size(self) -> int:
        """Displacement along both axes, and fingers (closed above 0) where there are any."""
        return 3 if self.fingers else 2

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
            answer &= np.linalg.norm(away, axis=-1) < AT
        return answer

    def world(self, batch: int) -> PointWorld:
        """Build a world of `batch` rows."""
        return PointWorld(self, batch)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect successful noisy demonstrations."""
        return demonstrate(self, episodes, seed)

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
        self._states[rows] = advance(self.task, self._states[rows], actions)
        self.control_steps += len(rows)
        return self._states[rows].copy()

    def observe(self, rows: IntArray) -> FloatArray:
        """Return states."""
        return self._states[rows].copy()

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which rows are no longer finite: none ever, kinematics cannot break."""
        return ~np.isfinite(self._states[rows]).all(axis=-1)

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots."""
        return self._states[rows].copy()

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Restore snapshots."""
        self._states[rows] = snapshots
        return self._states[rows].copy()


def advance(task: PointTask, states: FloatArray, actions: FloatArray) -> FloatArray:
    """Apply actions (..., A) to states (..., F); returns the next states."""
    layout = task.layout
    after = np.array(np.broadcast_to(states, (*np.broadcast_shapes(states.shape[:-1], actions.shape[:-1]), layout.size)))
    actions = np.clip(actions, -1.0, 1.0)
    hand = layout.columns[ROBOT, "position", False]
    before = after[..., hand].copy()
    moved = np.clip(before + STEP * actions[..., :2], -0.2, 2.0)
    after[..., hand] = moved
    if task.fingers:
        closed = actions[..., 2] > 0.0
        after[..., layout.columns[ROBOT, "opening", False]] = np.where(closed, 0.0, 1.0)[..., None]
        _drag(layout, after, before, moved, closed)
    else:
        for part in range(1, SUBSTEPS + 1):
            _push(layout, after, before + (moved - before) * part / SUBSTEPS)
    return after


def _drag(layout: Layout, after: FloatArray, before: FloatArray, moved: FloatArray, closed: BoolArray) -> None:
    places = np.stack([after[..., layout.columns[i, "position", False]] for i in range(len(layout.entities))], axis=-2)
    offsets = places - before[..., None, :]
    away = np.sqrt(np.einsum("...i,...i->...", offsets, offsets))
    nearest = away.argmin(axis=-1)
    held = closed & (away.min(axis=-1) < REACH)
    for i, kind in enumerate(layout.entities):
        mine = held & (nearest == i)
        place = layout.columns[i, "position", False]
        if kind.name == "drawer":
            opening = after[..., layout.columns[i, "opening", False]][..., 0]
            slid = np.clip(opening + moved[..., 0] - before[..., 0], 0.0, TRAVEL)
            change = np.where(mine, slid - opening, 0.0)
            after[..., layout.columns[i, "opening", False]] += change[..., None]
            after[..., place.start] += change
        else:
            settled = offsets[..., i, :] * np.minimum(1.0, GRASP / np.maximum(away[..., i, None], 1e-12))
            after[..., place] = np.where(mine[..., None], moved + settled, after[..., place])


def _push(layout: Layout, after: FloatArray, moved: FloatArray) -> None:
    for i in range(len(layout.entities)):
        place = layout.columns[i, "position", False]
        offset = after[..., place] - moved
        length = np.linalg.norm(offset, axis=-1, keepdims=True)
        pushed = moved + offset / np.maximum(length, 1e-12) * REACH
        after[..., place] = np.where(length < REACH, pushed, after[..., place])


@dataclass(frozen=True, eq=False)
class Lookahead:
    """A controller that tries a fixed set of actions in the kinematic model and takes the most rewarding.

    It stands where a learned controller would: greedy for R_φ one step ahead, hence as short-sighted as a learner
    without subgoals, and nearly still, in random directions, where no action pays.
    """

    task: PointTask
    run: Run
    scales: Mapping[str, float]
    seed: int = 0

    @property
    def _moves(self) -> int:
        return len(self._choices) // (2 if self.task.fingers else 1)

    @cached_property
    def _choices(self) -> FloatArray:
        turns = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
        heading = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        moves = np.concatenate([speed * heading for speed in (1.0, 0.4, 0.1)])
        if not self.task.fingers:
            return moves
        return np.concatenate([np.column_stack([moves, np.full(len(moves), f)]) for f in (-1.0, 1.0)])

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Choose an action (R, A) for states (R, F)."""
        choices = self._choices
        rng = np.random.default_rng([self.seed, crc32(states.tobytes())])  # memoryless, yet reproducible
        turned = rng.permutation(self._moves)
        order = np.concatenate([turned, turned + self._moves])[: len(choices)]  # of equals, open fingers
        if isinstance(self.run.until, Solved):
            return choices[rng.integers(len(choices), size=len(states))]
        after = advance(self.task, states[:, None, :], choices[order][None, :, :])
        value = self._reward(after, entities[:, None, :])
        best = np.asarray(choices[order][value.argmax(axis=1)])
        idle = value.max(axis=1) <= self._reward(states, entities) + 1e-9
        return np.where(idle[:, None], 0.2 * best, best)

    def _reward(self, states: FloatArray, entities: IntArray) -> FloatArray:
        binding = {name: entities[..., j] for j, name in enumerate(run_variables(self.run))}
        return reward(self.run.until, states, binding, self.task.layout, self.scales, self.task.solved)


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
