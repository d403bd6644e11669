"""A kinematic task: the layout that its data describes, which aims are met, and who may be served next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from roboscribe.world.layout import ROBOT, Attribute, BoolArray, FloatArray, Layout, ObjectType
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory
from tests.quality.bench.data import UNITS, Aim, Kind, Phase

if TYPE_CHECKING:
    from tests.quality.bench.world import KinematicWorld

COMPARED: Mapping[str, np.ufunc] = {"<": np.less, ">": np.greater, "is": np.equal, "not": np.not_equal}
"""What `Phase.only` may say between an attribute and what it is compared with."""
HORIZON = 2000
"""Control steps of an episode; rollouts are cut at some lengths of the longest demonstration."""


@dataclass(frozen=True)
class KinematicTask(Task):
    """A task of the bench, with its demonstrators and its answer.

    Args:
        name: task name.
        family: which kind of tasks it is a variant of.
        kinds: types of objects.
        phases: the script, and with it the expected parts of the program.
        plane: coordinates of positions: "xz", "xy" or "xyz".
        phase_order: "fixed"; "random" in every demonstration, so that any order is right; by the least "goal z" of
            the phases' first objects; or by a constant such as "lamp lit": as listed where it is 1, else reversed.
        first: how many phases come first whatever `phase_order` says.
        away: least distance between the hand and every object at the end, metres; 0 for anywhere.
        style: how demonstrators move, by name, or "mixed".
        demos: how many demonstrations there are.
        failing: share of the demonstrations that end without success.
        stay: steps that a demonstration goes on after success.
        held_out: set aside: nobody looks at it while the learner is written.
    """

    name: str
    family: str
    kinds: tuple[Kind, ...]
    phases: tuple[Phase, ...]
    plane: str = "xz"
    phase_order: str = "fixed"
    first: int = 0
    away: float = 0.0
    style: str = "brisk"
    demos: int = 40
    failing: float = 0.0
    stay: int = 5
    held_out: bool = False
    horizon: int = HORIZON
    frequency: float = 10.0

    @cached_property
    def fingers(self) -> bool:
        """Whether the hand can grasp; a hand that pushes has no fingers."""
        return all(kind.moves != "pushed" for kind in self.kinds)

    @cached_property
    def rotations(self) -> tuple[str, ...]:
        """Angles with an action of their own."""
        return tuple(dict.fromkeys(name for kind in self.kinds for name in kind.turned))

    @property
    def width(self) -> int:
        """Count of coordinates."""
        return len(self.plane)

    @property
    def action_size(self) -> int:  # type: ignore[override]  # nobody sets it
        """Displacement along each axis, fingers (closed above 0) where there are any, and rotations."""
        return self.width + self.fingers + len(self.rotations)

    @cached_property
    def entities(self) -> tuple[Kind, ...]:
        """Kind of every entity."""
        return tuple(kind for kind in self.kinds for _ in range(kind.count))

    @cached_property
    def layout(self) -> Layout:
        """Hand with position and, with fingers, their opening; objects with what their kind says."""
        position = Attribute("position", tuple(self.plane), "m", -1.0, 3.0)
        opening = (Attribute("opening", ("opening",), "1", 0.0, 1.0),) if self.fingers else ()
        types = {kind.name: _type(kind, position) for kind in self.kinds}
        return Layout(ObjectType("EE", (position, *opening)), tuple(types[kind.name] for kind in self.entities))

    def place(self, entity: int, attribute: str = "position", goal: bool = False) -> slice:
        """Columns of an attribute of an entity, or of its goal."""
        return self.layout.columns[entity, attribute, goal]

    @property
    def hand(self) -> slice:
        """Columns of the hand's position."""
        return self.place(ROBOT)

    def kind(self, name: str) -> Kind:
        """Kind by name."""
        return next(kind for kind in self.kinds if kind.name == name)

    def of_kind(self, name: str) -> tuple[int, ...]:
        """Entities of a kind."""
        return tuple(i for i, kind in enumerate(self.entities) if kind.name == name)

    def meets(self, states: FloatArray, aim: Aim, entity: int, share: float = 1.0) -> BoolArray:
        """Whether an entity meets an aim in states (..., F), within a share of what is allowed."""
        value = states[..., self.place(entity, aim.attribute)]
        match aim.to:
            case "goal":
                return _length(value - self.goal(states, entity, aim.attribute), aim) < share * aim.tolerance
            case "inside":
                gaps = [_length(value - states[..., self.place(each)], aim) for each in self.of_kind(aim.of)]
                return np.asarray(np.min(gaps, axis=0) < share * aim.value)
            case "below":
                return np.asarray(value[..., 0] < aim.value - (1 - share) * aim.value / 2)
            case "right of":
                return np.asarray(value[..., 0] > aim.value + (1 - share) * 0.08)
            case _:
                start = self._start(states, aim, entity)
                return np.asarray(value[..., 0] - start > aim.value + (1 - share) * 0.04 * aim.value)

    def goal(self, states: FloatArray, entity: int, attribute: str = "position") -> FloatArray:
        """Goal of an attribute (..., w)."""
        return states[..., self.place(entity, attribute, goal=True)]

    def _start(self, states: FloatArray, aim: Aim, entity: int) -> FloatArray:
        if aim.to != "risen":
            return np.zeros(states.shape[:-1])
        return np.asarray(states[..., self.place(entity, f"initial_{aim.attribute}")][..., 0])

    def served(self, states: FloatArray, phase: Phase, entity: int, share: float = 1.0) -> BoolArray:
        """Whether an entity meets all aims of a phase, or is not among those that it is about."""
        answer = ~self.member(states, phase, entity)
        met = [self.meets(states, aim, entity, share) for aim in phase.aims]
        return np.asarray(answer | np.logical_and.reduce(met))

    def member(self, states: FloatArray, phase: Phase, entity: int) -> BoolArray:
        """Whether a phase is about an entity."""
        answer = np.ones(states.shape[:-1], dtype=np.bool_)
        for attribute, sign, value in (bound.split() for bound in phase.bounds):
            mine = states[..., self.place(entity, attribute)][..., 0]
            answer &= COMPARED[sign](mine, self._bound(states, phase.kind, attribute, value))
        return answer

    def _bound(self, states: FloatArray, kind: str, attribute: str, value: str) -> FloatArray:
        """Read a number, that of another kind's only object, such as "scale.weight", or the "greatest" of a kind."""
        if value == "greatest":
            return np.asarray(
                np.max([states[..., self.place(e, attribute)][..., 0] for e in self.of_kind(kind)], axis=0)
            )
        owner, _, theirs = value.partition(".")
        if owner.lstrip("-").isdigit():
            return np.asarray(float(value))
        (entity,) = self.of_kind(owner)
        return np.asarray(states[..., self.place(entity, theirs)][..., 0])

    def done(self, states: FloatArray, phase: Phase) -> BoolArray:
        """Whether a phase is over."""
        return np.asarray(np.logical_and.reduce([self.served(states, phase, e) for e in self.of_kind(phase.kind)]))

    def solved(self, states: FloatArray) -> BoolArray:
        """All phases are over whose effect must last, and the hand is as far away as is asked."""
        lasting = [self.done(states, phase) for phase in self.phases if not phase.passing]
        return np.asarray(np.logical_and.reduce([*lasting, self.clear(states)]))

    def clear(self, states: FloatArray) -> BoolArray:
        """Whether the hand is as far from every object as is asked."""
        if not self.away:
            return np.ones(states.shape[:-1], dtype=np.bool_)
        gaps = [self.reach(states, entity) for entity in range(len(self.entities))]
        return np.asarray(np.min(gaps, axis=0) > self.away)

    def reach(self, states: FloatArray, entity: int) -> FloatArray:
        """Distance between hand and object (...)."""
        return np.asarray(np.linalg.norm(states[..., self.place(entity)] - states[..., self.hand], axis=-1))

    def unlocked(self, states: FloatArray, kind: Kind) -> BoolArray:
        """Whether objects of a kind can be moved."""
        keys = [self.done(states, phase) for phase in self.phases if phase.kind == kind.locked_by]
        return np.asarray(np.logical_and.reduce([np.ones(states.shape[:-1], dtype=np.bool_), *keys[:1]]))

    def rank(self, states: FloatArray, order: str, entity: int) -> FloatArray:
        """Return what an order goes by (...): the entity with the least comes first."""
        sign, order = (-1.0, order[1:]) if order.startswith("-") else (1.0, order)
        match order.split():
            case ["any"]:
                return np.zeros(states.shape[:-1])
            case ["hand"]:
                return sign * self.reach(states, entity)
            case ["goal", letter]:
                return np.asarray(sign * self.goal(states, entity)[..., self.plane.index(letter)])
            case [letter] if letter in self.plane:
                return np.asarray(sign * states[..., self.place(entity)][..., self.plane.index(letter)])
            case _:
                return np.asarray(sign * states[..., self.place(entity, order)][..., 0])

    def may_come(self, state: FloatArray, phase: Phase) -> tuple[int, ...]:
        """Entities that the order of a phase allows to be served next in one state (F,)."""
        waiting = [e for e in self.of_kind(phase.kind) if not self.served(state, phase, e)]
        ranks = [float(self.rank(state, phase.order, e)) for e in waiting]
        return tuple(e for e, rank in zip(waiting, ranks, strict=True) if rank <= min(ranks) + 1e-9)

    def sequence(self, state: FloatArray, rng: np.random.Generator | None = None) -> tuple[Phase, ...]:
        """Phases in the order that an initial state (F,) asks for; at random, where any will do and `rng` is given."""
        start, rest = self.phases[: self.first], list(self.phases[self.first :])
        if self.phase_order == "random" and rng is not None:
            rest = [rest[i] for i in rng.permutation(len(rest))]
        elif self.phase_order.startswith(("goal", "-goal")):
            rest.sort(key=lambda phase: float(self.rank(state, self.phase_order, self.of_kind(phase.kind)[0])))
        elif self.phase_order not in ("fixed", "random"):
            owner, attribute = self.phase_order.split()
            lit = state[self.place(self.of_kind(owner)[0], attribute)][0] > 0.5
            rest = rest if lit else rest[::-1]
        return (*start, *rest)

    def world(self, batch: int) -> KinematicWorld:
        """Build a world of `batch` rows."""
        from tests.quality.bench.world import KinematicWorld

        return KinematicWorld(self, batch)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect noisy scripted demonstrations."""
        from tests.quality.bench.demonstrator import demonstrate

        return demonstrate(self, episodes, seed)


def _length(value: FloatArray, aim: Aim) -> FloatArray:
    """Length of a difference (..., w); angles the short way round."""
    if UNITS.get(aim.attribute) == "rad":
        return np.asarray(np.abs(wrapped(value[..., 0])))
    return np.asarray(np.linalg.norm(value, axis=-1))


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles in [−π, π]."""
    return np.asarray(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))


def _type(kind: Kind, position: Attribute) -> ObjectType:
    scalars = [*([kind.scalar] if kind.scalar else []), *kind.turned]
    initial = [f"initial_{kind.scalar}"] if kind.initial else []
    found = {name: Attribute(name, (name,), _unit(name)) for name in (*scalars, *initial, *kind.constants)}
    goals = tuple(position if name == "position" else found[name] for name in kind.goal)
    return ObjectType(kind.name, (position, *found.values()), goals)


def _unit(name: str) -> str:
    return UNITS.get(name.removeprefix("initial_"), "1")
