"""B copies of a kinematic task, and the initial states that a seed decides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, IntArray
from tests.quality.bench.data import Kind
from tests.quality.bench.kinematics import RADIUS, TRAVEL, advance

if TYPE_CHECKING:
    from tests.quality.bench.task import KinematicTask

CLEARANCE = 0.12
"""Least distance between objects, and between an object and a goal, at the start, metres."""
SCALES = {"weight": (0.0, 2.0), "size": (0.02, 0.08)}
"""Least and greatest value of constants that differ between objects."""
APART = 0.15
"""Distance between the levels of a stack, and between places of a row, metres."""


class KinematicWorld:
    """B copies of a task; a snapshot is the state itself."""

    def __init__(self, task: KinematicTask, batch: int) -> None:
        """Make room; rows hold nothing until reset or loaded."""
        self.task = task
        self.batch = batch
        self.control_steps = 0
        self._states = np.full((batch, task.layout.size), np.nan)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes from seeds."""
        self._states[rows] = np.stack([initial(self.task, int(seed)) for seed in seeds])
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
        """Which rows are no longer finite: none ever."""
        return np.asarray(~np.isfinite(self._states[rows]).all(axis=-1))

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots."""
        return self._states[rows].copy()

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Restore snapshots."""
        self._states[rows] = snapshots
        return self._states[rows].copy()


def initial(task: KinematicTask, seed: int) -> FloatArray:
    """Sample an initial state (F,) in which something is left to do."""
    rng = np.random.default_rng(seed)
    state = _drawn(task, rng)
    while all(task.done(state, phase) for phase in task.phases):
        state = _drawn(task, rng)
    return state


def _drawn(task: KinematicTask, rng: np.random.Generator) -> FloatArray:
    state = np.zeros(task.layout.size)
    _place(task, state, rng)
    for kind in task.kinds:
        for name in kind.constants:
            _constants(task, state, kind, name, rng)
        for name in kind.turned:
            _angles(task, state, kind, name, rng)
    _put_at_goals(task, state, rng)
    return state


def _place(task: KinematicTask, state: FloatArray, rng: np.random.Generator) -> None:
    """Scatter what is loose, with its free goals and the hand; put joints, buttons and bins where they belong."""
    loose = [i for i, kind in enumerate(task.entities) if kind.loose]
    free = [i for i in loose if task.entities[i].goals == "free" and "position" in task.entities[i].goal]
    places = scattered(rng, len(loose) + len(free) + 1, task.width)
    while not task.fingers and _behind(places, len(loose), loose, free):
        places = scattered(rng, len(loose) + len(free) + 1, task.width)
    state[task.hand] = places[-1]
    if task.fingers:
        state[task.place(ROBOT, "opening")] = 1.0
    for i, place in zip(loose, places, strict=False):
        state[task.place(i)] = place
    for i, place in zip(free, places[len(loose) :], strict=False):
        state[task.place(i, goal=True)] = place
    _fix(task, state, rng)
    _line_up(task, state, rng)
    _stacks_and_rows(task, state, rng)
    _riding_goals(task, state, rng)


def scattered(rng: np.random.Generator, count: int, width: int) -> FloatArray:
    """Points in the unit square or cube, CLEARANCE apart, (count, width)."""
    points: list[FloatArray] = []
    tries = 0
    while len(points) < count:
        point = rng.uniform(0.0, 1.0, width)
        if all(np.linalg.norm(point - other) > CLEARANCE for other in points):
            points.append(point)
        tries += 1
        if tries > 2000:
            points, tries = [], 0
    return np.stack(points)


def _behind(places: FloatArray, count: int, loose: list[int], free: list[int]) -> bool:
    """Whether the hand (last) starts behind an object that it is to push, as seen from the goal."""
    things = places[[loose.index(i) for i in free]]
    to_goal, to_hand = places[count:-1] - things, places[-1] - things
    return bool((np.einsum("ni,ni->n", to_goal, to_hand) < 0.0).any())


def _fix(task: KinematicTask, state: FloatArray, rng: np.random.Generator) -> None:
    """Put handles and buttons in a row beyond the objects, bins in another on this side of them."""
    joints = [i for i, kind in enumerate(task.entities) if kind.scalar]
    bins = [i for i, kind in enumerate(task.entities) if kind.moves == "fixed"]
    for far, members in ((1.3, joints), (-0.25, bins)):
        for rank, i in enumerate(members):
            place = np.full(task.width, 0.4)
            place[0], place[-1] = 0.05 + 0.45 * rank, far
            state[task.place(i)] = place + rng.uniform(-0.05, 0.05, task.width)
    for i in joints:
        _joint(task, state, i, rng)


def _joint(task: KinematicTask, state: FloatArray, entity: int, rng: np.random.Generator) -> None:
    kind = task.entities[entity]
    if kind.moves == "pressed":
        return
    travel = TRAVEL[kind.scalar]
    start = rng.uniform(0.0, 0.2) * travel
    state[task.place(entity, kind.scalar)] = start
    if kind.moves == "turns":
        state[task.place(entity)] += np.eye(task.width)[0] * RADIUS * np.cos(start)
        state[task.place(entity)] += np.eye(task.width)[-1] * RADIUS * np.sin(start)
    if kind.initial:
        state[task.place(entity, f"initial_{kind.scalar}")] = start
    if kind.scalar in kind.goal:
        state[task.place(entity, kind.scalar, goal=True)] = rng.uniform(0.5, 0.95) * travel


def _line_up(task: KinematicTask, state: FloatArray, rng: np.random.Generator) -> None:
    members = [i for i, kind in enumerate(task.entities) if kind.start == "line"]
    for rank, i in zip(rng.permutation(len(members)), members, strict=True):
        place = np.full(task.width, 0.1)
        place[0] = 0.05 + APART * rank
        state[task.place(i)] = place + rng.uniform(-0.01, 0.01, task.width)


def _stacks_and_rows(task: KinematicTask, state: FloatArray, rng: np.random.Generator) -> None:
    base = np.full(task.width, rng.uniform(0.3, 0.6))
    base[0], base[-1] = rng.uniform(1.2, 1.3), 0.05
    stack = [int(i) for i in rng.permutation([i for i, kind in enumerate(task.entities) if kind.goals == "stack"])]
    for level, i in enumerate(sorted(stack, key=lambda i: task.entities[i].level)):
        state[task.place(i, goal=True)] = base + level * APART * np.eye(task.width)[-1]
    row = [i for i, kind in enumerate(task.entities) if kind.goals == "row"]
    for rank, i in zip(rng.permutation(len(row)), row, strict=True):
        place = np.full(task.width, 0.5)
        place[0], place[-1] = 0.05 + APART * rank, -0.3
        state[task.place(i, goal=True)] = place


def _riding_goals(task: KinematicTask, state: FloatArray, rng: np.random.Generator) -> None:
    riders = [i for i, kind in enumerate(task.entities) if kind.goals == "rides"]
    for rank, i in zip(rng.permutation(len(riders)), riders, strict=True):
        (container,) = task.of_kind(task.entities[i].inside)
        offset = np.zeros(task.width)
        offset[0], offset[-1] = -0.12 * rank, -0.12
        state[task.place(i, goal=True)] = state[task.place(container)] + offset


def _constants(task: KinematicTask, state: FloatArray, kind: Kind, name: str, rng: np.random.Generator) -> None:
    """Draw constants: sizes and weights apart, masses anywhere, or 0 and 1, not all alike where there are several."""
    if name in SCALES:
        low, high = SCALES[name]
        values = rng.permutation(kind.count) + rng.uniform(0.2, 0.8, kind.count)
        values = low + (high - low) * values / kind.count
    elif name == "mass":
        values = rng.uniform(0.0, 2.0, kind.count)
    else:
        values = rng.permutation([0.0, 1.0, *rng.integers(0, 2, max(0, kind.count - 2))][: max(2, kind.count)])
    for i, value in zip(task.of_kind(kind.name), values, strict=False):
        state[task.place(i, name)] = value


def _angles(task: KinematicTask, state: FloatArray, kind: Kind, name: str, rng: np.random.Generator) -> None:
    for i in task.of_kind(kind.name):
        start = rng.uniform(-1.5, 1.5)
        state[task.place(i, name)] = start
        if name in kind.goal:
            state[task.place(i, name, goal=True)] = start + rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)


def _put_at_goals(task: KinematicTask, state: FloatArray, rng: np.random.Generator) -> None:
    """Let some objects lie at their goals from the start."""
    for kind in task.kinds:
        members = rng.permutation(task.of_kind(kind.name))
        chosen = (np.arange(len(members)) < kind.served) | (rng.random(len(members)) < kind.placed)
        for i in members[chosen].tolist():
            for name in kind.goal:
                state[task.place(i, name)] = state[task.place(i, name, goal=True)]
