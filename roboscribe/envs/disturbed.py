"""Any task under disturbances: noisy eyes, late hands, pushed and knocked-off blocks, slipping grasps, other physics.

A disturbed world is a wrapper around the task's own. What is seen may differ from what is; success is judged on what
is. Disturbances of objects and of physics know the Fetch scene; noise and delay know any world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from zlib import crc32

import numpy as np
from numpy.random import Generator

from roboscribe.envs import fetch
from roboscribe.envs.fetch_world import TOLERANCE, FetchTask, FetchWorld
from roboscribe.errors import TaskError
from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.task import Task, World

KINDS = {
    "noise": "standard deviation of seen positions, m",
    "delay": "control steps between command and motion",
    "push": "speed given to some object once a second, m/s",
    "slip": "times a second that a grasp opens",
    "knock": "blocks that are put back on the table at some moment after half of them are placed",
    "friction": "friction of everything, times its own",
    "mass": "mass of objects, times its own",
    "size": "size of objects, times its own",
}
"""What there is, and what its strength means."""
PHYSICS = ("friction", "mass", "size")
"""Kinds that change the model; their strength 1 changes nothing."""
OPEN_STEPS = 5
"""Control steps for which a grasp that slips is open."""
GRASPED, ROOM, REACH = 0.03, 0.09, 0.14
"""Distance of a block in the hand, room around a block that is put back, and how far from the middle it may lie, m."""
LONGEST_WAIT = 25
"""Control steps, at most, from half of the blocks being placed to the first of them being knocked off."""
DRAWS = 500
"""Places that are drawn for a block that is put back."""


@dataclass(frozen=True)
class Disturbance:
    """One of `KINDS` with its strength."""

    kind: str
    strength: float

    @staticmethod
    def read(text: str) -> Disturbance:
        """Read "noise=0.005".

        Raises:
            TaskError: another form, an unknown kind, or a strength that it cannot have.
        """
        kind, _, strength = text.partition("=")
        try:
            value = float(strength)
        except ValueError:
            value = -1.0
        least = 0.01 if kind in PHYSICS else 0.0
        if kind not in KINDS or not least <= value < 1e6:
            known = "; ".join(f"{name}=S ({meaning})" for name, meaning in KINDS.items())
            msg = f"disturbance {text!r}: expected one of {known}"
            raise TaskError(msg)
        return Disturbance(kind, value)


@dataclass(frozen=True)
class Disturbed(Task):
    """A task under disturbances.

    Args:
        inner: the task.
        disturbances: what disturbs it, at most one of each kind.
    """

    inner: Task
    disturbances: tuple[Disturbance, ...]

    def __post_init__(self) -> None:
        """Refuse what the task's world cannot do.

        Raises:
            TaskError: a disturbance of objects or physics of a world that is not the Fetch scene.
        """
        can = ["noise", "delay"]
        if isinstance(self.inner, FetchTask):
            can = [kind for kind in KINDS if kind != "knock" or len(self.inner.scene.shapes) > 1]
        others = [each.kind for each in self.disturbances if each.kind not in can]
        if others:
            msg = f"task {self.inner.name}: cannot be disturbed by {', '.join(others)}, expected {', '.join(can)}"
            raise TaskError(msg)
        for name in ("name", "action_size", "frequency", "most_rows"):
            object.__setattr__(self, name, getattr(self.inner, name))
        object.__setattr__(self, "horizon", self.inner.horizon + self._more_time())

    def _more_time(self) -> int:
        """Return the control steps that blocks have which must be placed again: as many as others."""
        if not isinstance(self.inner, FetchTask):
            return 0
        return round(self.strength("knock") * self.inner.horizon / len(self.inner.scene.shapes))

    @property
    def layout(self) -> Layout:
        """The task's own."""
        return self.inner.layout

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R of what is seen."""
        return self.inner.solved(states)

    def strength(self, kind: str, usual: float = 0.0) -> float:
        """Return how strong a kind is."""
        return next((each.strength for each in self.disturbances if each.kind == kind), usual)

    def world(self, batch: int) -> DisturbedWorld:
        """Build a disturbed world of `batch` rows."""
        return DisturbedWorld(self, batch)

    def calm_world(self, batch: int) -> World:
        """Build the task's world, with the other physics where asked for."""
        if not isinstance(self.inner, FetchTask):
            return self.inner.world(batch)
        return FetchWorld(self.inner, batch, scene=self._scene(self.inner.scene))

    def _scene(self, scene: fetch.Scene) -> fetch.Scene:
        size, mass = self.strength("size", 1.0), self.strength("mass", 1.0)
        shapes = tuple(
            replace(
                shape, half=(shape.half[0] * size, shape.half[1] * size, shape.half[2] * size), mass=shape.mass * mass
            )
            for shape in scene.shapes
        )
        return replace(scene, shapes=shapes, friction=self.strength("friction", 1.0))

    @cached_property
    def seen_positions(self) -> IntArray:
        """Columns of positions that are seen, those of goals excepted."""
        layout, found = self.layout, list[int]()
        for entity, kind in ((ROBOT, layout.robot), *enumerate(layout.entities)):
            for attribute in kind.attributes:
                if attribute.name == "position":
                    part = layout.columns[entity, attribute.name, False]
                    found += range(part.start, part.stop)
        return np.array(found, dtype=np.int64)


class DisturbedWorld(World):
    """B rows of a task under disturbances; what disturbs a row, its seed decides.

    Snapshots are those of the undisturbed world: a row that is loaded is disturbed anew.

    Args:
        task: what is disturbed, and how.
        batch: B.
    """

    def __init__(self, task: Disturbed, batch: int) -> None:
        """Build the undisturbed world; no row holds a state yet."""
        self.task = task
        self.batch = batch
        self.inner = task.calm_world(batch)
        self._late = round(task.strength("delay"))
        self._rngs = [np.random.default_rng(row) for row in range(batch)]
        self._true = np.full((batch, task.layout.size), np.nan)
        self._seen = self._true.copy()
        self._waiting = np.zeros((batch, self._late + 1, task.action_size))
        self._open = np.zeros(batch, dtype=np.int64)
        self._knocks = np.zeros(batch, dtype=np.int64)
        self._wait = np.zeros(batch, dtype=np.int64)

    @property
    def control_steps(self) -> int:
        """Control steps simulated so far."""
        return self.inner.control_steps

    @control_steps.setter
    def control_steps(self, value: int) -> None:
        self.inner.control_steps = value

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes from seeds."""
        for row, seed in zip(rows, seeds, strict=True):
            self._rngs[row] = np.random.default_rng([int(seed), crc32(b"disturbances")])
        self._begin(rows)
        self._true[rows] = self.inner.reset(rows, seeds)
        return self._look(rows)

    def _begin(self, rows: IntArray) -> None:
        self._waiting[rows], self._open[rows] = 0.0, 0
        self._knocks[rows] = round(self.task.strength("knock"))
        self._wait[rows] = [int(self._rngs[row].integers(LONGEST_WAIT)) for row in rows]

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Move `rows` by what was commanded some steps ago, and disturb them."""
        self._waiting[rows] = np.roll(self._waiting[rows], -1, axis=1)
        self._waiting[rows, -1] = actions
        late = self._waiting[rows, 0]
        if isinstance(self.inner, FetchWorld):
            for row, action in zip(rows, late, strict=True):
                self._meddle(self.inner, int(row), action)
        self._true[rows] = self.inner.step(rows, late)
        return self._look(rows)

    def _look(self, rows: IntArray) -> FloatArray:
        """Return what is seen of the present states."""
        self._seen[rows] = self._true[rows]
        noise, columns = self.task.strength("noise"), self.task.seen_positions
        for row in rows if noise else ():
            self._seen[row, columns] += noise * self._rngs[row].standard_normal(len(columns))
        return self._seen[rows].copy()

    def _meddle(self, world: FetchWorld, row: int, action: FloatArray) -> None:
        """Let a grasp slip, give a push, put a block back; changes `action` and the world's row."""
        seen = fetch.view(self._true[row])
        near = np.linalg.norm(seen.blocks - seen.hand, axis=-1)
        self._slip(row, action, held=near.min() < GRASPED)
        self._push(world, row, len(seen.blocks))
        if self._knocks[row]:
            self._knock(world, row, seen, near)

    def _slip(self, row: int, action: FloatArray, *, held: bool) -> None:
        chance = self.task.strength("slip") / self.task.frequency
        if chance and held and action[3] < 0 and self._rngs[row].random() < chance:
            self._open[row] = OPEN_STEPS
        if self._open[row]:
            self._open[row] -= 1
            action[3] = 1.0

    def _push(self, world: FetchWorld, row: int, blocks: int) -> None:
        rng, speed = self._rngs[row], self.task.strength("push")
        if speed and rng.random() < 1 / self.task.frequency:
            turn = rng.uniform(0, 2 * np.pi)
            world.push(row, int(rng.integers(blocks)), speed * np.array([np.cos(turn), np.sin(turn)]))

    def _knock(self, world: FetchWorld, row: int, seen: fetch.View, near: FloatArray) -> None:
        placed = np.linalg.norm(seen.blocks - seen.goals, axis=-1) < TOLERANCE
        if not 2 * placed.sum() >= len(placed) > placed.sum():
            return
        self._wait[row] -= 1
        if self._wait[row] < 0 and not (near[placed] < ROOM).any():
            self._knocks[row] -= 1
            top = int(np.flatnonzero(placed)[seen.blocks[placed, 2].argmax()])
            world.put_back(row, top, free_place(self._rngs[row], seen, world.middle))

    def observe(self, rows: IntArray) -> FloatArray:
        """Return what was last seen."""
        return self._seen[rows].copy()

    def solved(self, rows: IntArray) -> BoolArray:
        """ψ_R of what is."""
        return self.task.inner.solved(self._true[rows])

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        return self.inner.diverged(rows)

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots of the undisturbed world."""
        return self.inner.save(rows)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states."""
        self._begin(rows)
        self._true[rows] = self.inner.load(rows, snapshots)
        return self._look(rows)


def free_place(rng: Generator, seen: fetch.View, middle: FloatArray) -> FloatArray:
    """Draw a place (2,) on the table with room around it, the roomiest of many where none has enough."""
    taken = np.concatenate([seen.blocks[:, :2], seen.goals[:, :2], seen.hand[None, :2]])
    places = middle + rng.uniform(-REACH, REACH, (DRAWS, 2))
    room = np.linalg.norm(places[:, None] - taken[None], axis=-1).min(axis=1)
    enough = np.flatnonzero(room > ROOM)
    place: FloatArray = places[enough[0] if len(enough) else int(room.argmax())]
    return place


def disturbed(task: Task, texts: Sequence[str]) -> Task:
    """Return a task under the disturbances that are named, the task itself without any.

    Raises:
        TaskError: one that there is not, that is named twice, or that the task cannot have.
    """
    found = [Disturbance.read(text) for text in texts]
    kinds = [each.kind for each in found]
    if len(set(kinds)) < len(kinds):
        msg = f"disturbances {', '.join(texts)}: expected each kind once"
        raise TaskError(msg)
    return Disturbed(task, tuple(found)) if found else task
