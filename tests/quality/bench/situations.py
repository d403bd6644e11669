"""States that matter to an answer: some objects served, others not, the hand here or there; built, not simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.world.layout import ROBOT, FloatArray
from tests.quality.bench.data import Aim, Phase
from tests.quality.bench.demonstrator import SPREAD, target
from tests.quality.bench.kinematics import set_joint
from tests.quality.bench.task import KinematicTask
from tests.quality.bench.world import initial

SEED = 700_000
"""First seed of the initial states that situations are built from."""


@dataclass(frozen=True)
class Moment:
    """A state in which somebody has to be chosen: who may be, and who is still waiting."""

    state: FloatArray
    allowed: tuple[int, ...]
    waiting: tuple[int, ...]


@dataclass(frozen=True)
class Ending:
    """States just before and just after an object's last aim is met.

    Args:
        entity: the object.
        before: (2, F) the hand elsewhere, or at the object.
        after: (2, F) the same.
    """

    entity: int
    before: FloatArray
    after: FloatArray


def achieve(task: KinematicTask, state: FloatArray, aim: Aim, entity: int, rng: np.random.Generator) -> None:
    """Let an object meet an aim in a state (F,), which is changed."""
    if task.meets(state, aim, entity, 0.5):
        return
    direction = rng.standard_normal(task.width)
    offset = SPREAD * rng.random() * direction / np.linalg.norm(direction)
    value = target(task, state, aim, entity, offset)
    if task.entities[entity].moves in ("slides", "turns"):
        set_joint(task, state[None], entity, value)
    else:
        state[task.place(entity, aim.attribute)] = value


def serve(task: KinematicTask, state: FloatArray, phase: Phase, entity: int, rng: np.random.Generator) -> None:
    """Let an object meet all aims of a phase that it is in."""
    if task.member(state, phase, entity):
        for aim in phase.aims:
            achieve(task, state, aim, entity, rng)


def started(task: KinematicTask, phase: Phase, seed: int) -> tuple[FloatArray, np.random.Generator]:
    """Return a state in which a phase may begin: what comes before it is done, what comes in any order perhaps."""
    rng = np.random.default_rng([SEED, seed])
    state = initial(task, SEED + seed)
    for rank, other in enumerate(task.phases):
        free = task.phase_order != "fixed" and rank >= task.first
        begun = rank < task.phases.index(phase) if not free else rng.random() < 0.5
        if other != phase and begun:
            for entity in task.of_kind(other.kind):
                serve(task, state, other, entity, rng)
    return state, rng


def moments(task: KinematicTask, phase: Phase, episodes: int = 20) -> list[Moment]:
    """Serve the objects of a phase in an order that the script allows, and stop whenever one is chosen."""
    found: list[Moment] = []
    for seed in range(episodes):
        state, rng = started(task, phase, seed)
        while True:
            waiting = tuple(e for e in task.of_kind(phase.kind) if not task.served(state, phase, e))
            allowed = task.may_come(state, phase) if waiting else ()
            found.append(Moment(state.copy(), allowed, waiting))
            if not waiting:
                break
            entity = int(rng.choice(allowed))
            serve(task, state, phase, entity, rng)
            state[task.hand] = state[task.place(entity)] + rng.uniform(-0.005, 0.005, task.width)
    return found


def endings(task: KinematicTask, phase: Phase, episodes: int = 20) -> list[Ending]:
    """For some object of a phase, with others served or not: just before and just after its last aim is met."""
    found: list[Ending] = []
    for seed in range(episodes):
        state, rng = started(task, phase, seed)
        waiting = [e for e in task.of_kind(phase.kind) if not task.served(state, phase, e)]
        if not waiting:
            continue
        entity, *others = rng.permutation(waiting).tolist()
        for other in others:
            if rng.random() < 0.5:
                serve(task, state, phase, other, rng)
        for aim in phase.aims[:-1]:
            achieve(task, state, aim, entity, rng)
        before = _with_hand(task, state, entity, rng)
        achieve(task, state, phase.aims[-1], entity, rng)
        found.append(Ending(entity, before, _with_hand(task, state, entity, rng)))
    return found


def _with_hand(task: KinematicTask, state: FloatArray, entity: int, rng: np.random.Generator) -> FloatArray:
    """Return a state twice (2, F): the hand, open, where nothing is, and, closed, at an object."""
    both = np.stack([state, state])
    both[0, task.hand] = rng.uniform(1.6, 2.0, task.width)
    both[1, task.hand] = state[task.place(entity)] + 0.005
    if task.fingers:
        both[:, task.place(ROBOT, "opening")] = [[1.0], [0.0]]
    return both


def finished(task: KinematicTask, episodes: int = 20) -> tuple[FloatArray, FloatArray]:
    """Return states (S, F) in which all is served, with the hand at the last object, and far from every object."""
    rows = []
    for seed in range(episodes):
        state, rng = started(task, task.phases[-1], seed)
        for entity in task.of_kind(task.phases[-1].kind):
            serve(task, state, task.phases[-1], entity, rng)
        rows.append(_with_hand(task, state, entity, rng))
    far, near = np.stack(rows).swapaxes(0, 1)
    far[:, task.hand] = np.append(0.6, np.full(task.width - 1, 1.3))
    return near, far
