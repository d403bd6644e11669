"""One skill as an ordinary vectorised environment, and its evaluation on fixed starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roboscribe.dsl.interpreter import Controller
from roboscribe.rl.checkpoint import Arrays
from roboscribe.rl.config import PoolConfig
from roboscribe.rl.pool import StartPool
from roboscribe.rl.subtask import Subtask
from roboscribe.world.layout import NULL, BoolArray, FloatArray, IntArray
from roboscribe.world.task import World

COUNTS = ("steps", "streak", "limit", "harm", "protected")
"""What a row's attempt in progress is known by."""
LASTING = 1.0
"""Return of φ that holds for ever: the sum of (1 − γ) γᵗ over all control steps t."""
HOPELESS = 0.1
"""Success short of what is to be beaten at which a candidate is dropped on the first starts alone: at 50 of them a rate
of 90 % is uncertain by 4 points, so that one that is better over all is seldom dropped."""
IDLE = -1
"""Rank of the start of a row that attempts none."""


@dataclass(frozen=True)
class Step:
    """Outcome of one control step of every row; `final` are the states before rows that ended were reset."""

    reward: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    succeeded: BoolArray
    final: FloatArray
    final_entities: IntArray


class AttemptCounter:
    """Counts steps and consecutive achievements of rows, and says when each row's attempt is over.

    An attempt that undoes what a loop around it had achieved fails as soon as that is confirmed.
    """

    def __init__(self, subtask: Subtask, batch: int) -> None:
        """Count for `batch` rows."""
        self.subtask = subtask
        self.steps = np.zeros(batch, np.int64)
        self.streak = np.zeros(batch, np.int64)
        self.limit = np.zeros(batch, np.int64)
        self.harm = np.zeros(batch, np.int64)
        self.protected = np.zeros((batch, len(subtask.others)), np.bool_)

    def begin(self, rows: IntArray, states: FloatArray, start: StartPool) -> None:
        """Start attempts; what is left of the episode bounds them as the subtask's limit does."""
        self.steps[rows] = 0
        self.limit[rows] = np.maximum(1, np.minimum(self.subtask.limit, self.subtask.task.horizon - start.elapsed))
        self.streak[rows] = self.subtask.achieved(states, start.entities)
        self.harm[rows] = 0
        self.protected[rows] = self.subtask.protected(states, start.entities)

    def advance(self, rows: IntArray, states: FloatArray, entities: IntArray) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Count one step of `rows`; returns which succeeded, which ran out of steps without, and which did harm."""
        invariant_holds = self.subtask.invariant_holds(states, self.protected[rows])
        achieved = self.subtask.achieved(states, entities) & invariant_holds
        self.steps[rows] += 1
        self.streak[rows] = np.where(achieved, self.streak[rows] + 1, 0)
        self.harm[rows] = np.where(invariant_holds, 0, self.harm[rows] + 1)
        succeeded = self.streak[rows] >= self.subtask.needed
        harmful = self.harm[rows] >= self.subtask.confirm
        return succeeded, ~succeeded & ~harmful & (self.steps[rows] >= self.limit[rows]), harmful


class SkillEnv:
    """B attempts at a subtask in parallel, each reset from the pool on its own as it ends.

    The step reward is (1 − γ)(R_φ + 1 while φ), so that returns stay within a few units. An attempt that succeeds is
    paid as if φ went on to hold for ever (1), because otherwise leaving and re-entering φ would earn more than
    finishing; one that diverges, or undoes what a loop around it had achieved, is charged as much.
    """

    def __init__(self, subtask: Subtask, pool: StartPool, batch: int, gamma: float, rng: np.random.Generator) -> None:
        """Build a world of `batch` rows; `restart` must be called before `step`."""
        self.subtask, self.pool, self.batch, self.gamma, self.rng = subtask, pool, batch, gamma, rng
        self.world: World = subtask.task.world(batch)
        self.rows = np.arange(batch)
        self.progress = AttemptCounter(subtask, batch)
        self.states = np.zeros((batch, subtask.task.layout.size))
        self.entities = np.full((batch, pool.entities.shape[1]), NULL, np.int64)

    def restart(self) -> None:
        """Start every row afresh."""
        self._begin(self.rows)

    def _begin(self, rows: IntArray) -> None:
        start = self.pool.take(self.rng.integers(len(self.pool), size=len(rows)))
        self.states[rows] = self.world.load(rows, start.snapshots)
        self.entities[rows] = start.entities
        self.progress.begin(rows, self.states[rows], start)

    def step(self, actions: FloatArray) -> Step:
        """Apply actions (B, A) and reset the rows that ended."""
        states = self.world.step(self.rows, actions).copy()
        entities = self.entities.copy()
        succeeded, truncated, harmful = self.progress.advance(self.rows, states, entities)
        lost = self.world.diverged(self.rows) | harmful
        succeeded, truncated = succeeded & ~lost, truncated & ~lost
        payment = (1 - self.gamma) * self.subtask.shaped(states, entities) + LASTING * succeeded - LASTING * lost
        self.states[:] = states
        ended = np.flatnonzero(succeeded | truncated | lost)
        if len(ended):
            self._begin(ended)
        return Step(payment, succeeded | lost, truncated, succeeded, states, entities)

    def save(self) -> tuple[Arrays, Mapping[str, object]]:
        """Return all that decides the future: arrays, and the state of the random generator as JSON values."""
        arrays: Arrays = {"snapshots": self.world.save(self.rows), "states": self.states, "entities": self.entities}
        arrays |= {name: getattr(self.progress, name) for name in COUNTS}
        return {name: array.copy() for name, array in arrays.items()}, self.rng.bit_generator.state

    def restore(self, arrays: Mapping[str, NDArray[np.generic]], generator: Mapping[str, object]) -> None:
        """Return to what `save` gave."""
        self.world.load(self.rows, np.asarray(arrays["snapshots"], np.float64))
        self.states[:] = arrays["states"]
        self.entities[:] = arrays["entities"]
        for name in COUNTS:
            getattr(self.progress, name)[:] = arrays[name]
        self.rng.bit_generator.state = dict(generator)


@dataclass(frozen=True)
class Attempts:
    """Outcome of one attempt from each start.

    Args:
        success: (P,).
        harmful: (P,) it undid what a loop around the skill had achieved.
        final: (P, F) last states.
        control_steps: that were spent.
    """

    success: BoolArray
    harmful: BoolArray
    final: FloatArray
    control_steps: int

    @property
    def rate(self) -> float:
        """Share of attempts that succeeded; 0 where there were none."""
        return float(self.success.mean()) if len(self.success) else 0.0


class Verdict(NamedTuple):
    """Success of a skill on held-out starts, and the control steps that it took to find out."""

    rate: float
    control_steps: int


@dataclass(frozen=True)
class SkillEvaluator:
    """Measures skills on the same held-out starts, in rollouts.

    Args:
        subtask: what to reach.
        starts: held out.
        world: any world of the task.
        screening: starts tried first; a candidate that is clearly worse there than what it has to beat is dropped.
        allowance: control steps that the world may have taken in the end.
    """

    subtask: Subtask
    starts: StartPool
    world: World
    screening: int = PoolConfig.screening
    allowance: float = inf

    @property
    def rest(self) -> float:
        """Control steps that may be spent before one more evaluation, which may take as many as its starts allow."""
        return self.allowance - self.world.control_steps - len(self.starts) * self.subtask.limit

    def __call__(self, skill: Controller, to_beat: float = 0.0) -> Verdict:
        """Measure a skill, on the first starts alone where it is `HOPELESS` short of `to_beat` there."""
        ranks = np.arange(len(self.starts))
        first = evaluate_skill(self.subtask, self.starts.take(ranks[: self.screening]), skill, self.world)
        if len(ranks) <= self.screening or first.rate < to_beat - HOPELESS:
            return Verdict(first.rate, first.control_steps)
        rest = evaluate_skill(self.subtask, self.starts.take(ranks[self.screening :]), skill, self.world)
        success = np.concatenate([first.success, rest.success])
        return Verdict(float(success.mean()), first.control_steps + rest.control_steps)


def evaluate_skill(subtask: Subtask, pool: StartPool, controller: Controller, world: World) -> Attempts:
    """Attempt the subtask once from every start of the pool, with a deterministic controller.

    Args:
        subtask: what to reach.
        pool: fixed starts, (P).
        controller: acts on rows independently.
        world: any world of the task; its present contents are lost.

    Returns:
        Success by start. A diverged attempt fails.
    """
    before = world.control_steps
    progress = AttemptCounter(subtask, len(pool))
    success, harmed = np.zeros(len(pool), np.bool_), np.zeros(len(pool), np.bool_)
    final = np.zeros((len(pool), subtask.task.layout.size))
    running = np.full(world.batch, IDLE, np.int64)
    waiting = 0
    while True:
        free = np.flatnonzero(running == IDLE)[: len(pool) - waiting]
        if len(free):
            running[free] = np.arange(waiting, waiting + len(free))
            waiting += len(free)
            start = pool.take(running[free])
            final[running[free]] = world.load(free, start.snapshots)
            progress.begin(running[free], final[running[free]], start)
        rows = np.flatnonzero(running != IDLE)
        if not len(rows):
            return Attempts(success, harmed, final, world.control_steps - before)
        ranks = running[rows]
        final[ranks] = world.step(rows, controller.act(final[ranks], pool.entities[ranks]))
        reached, late, harmful = progress.advance(ranks, final[ranks], pool.entities[ranks])
        lost = world.diverged(rows) | harmful
        success[ranks], harmed[ranks] = reached & ~lost, harmful
        running[rows[reached | late | lost]] = IDLE
