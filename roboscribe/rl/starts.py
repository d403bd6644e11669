"""Filling a skill's pool: run the program and keep the states in which the skill takes over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.interpreter import Machine
from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.dsl.syntax import Program
from roboscribe.rl.config import PoolConfig
from roboscribe.rl.pool import StartPool
from roboscribe.rl.skill_env import Controller
from roboscribe.world.layout import FloatArray, IntArray
from roboscribe.world.task import Task

IDLE = -1
"""Rank of the episode of a row that runs none."""


@dataclass(frozen=True)
class Prefix:
    """A program up to one of its controllers.

    Args:
        program: the whole program.
        targets: ranks of the controller among `controllers(program)`; branches may share one.
        skills: controllers trained so far, by name.
        limits: step limit by controller name.
        confirm: consecutive steps for which a subgoal must hold.
    """

    program: Program
    targets: tuple[int, ...]
    skills: Mapping[str, Controller]
    limits: Mapping[str, int]
    confirm: int = CONFIRM


class _Collection:
    """Episodes in flight, and the starts found so far."""

    def __init__(self, prefix: Prefix, task: Task, batch: int, rng: np.random.Generator) -> None:
        self.prefix, self.task = prefix, task
        self.runs = controllers(prefix.program)
        self.world = task.world(batch)
        self.machine = Machine(
            prefix.program,
            task.layout,
            batch,
            limits=prefix.limits,
            confirm=prefix.confirm,
            rng=rng,
            solved=task.solved,
        )
        self.episode = np.full(batch, IDLE, np.int64)
        self.steps = np.zeros(batch, np.int64)
        self.visits = np.zeros(batch, np.int64)
        self.states = np.zeros((batch, task.layout.size))
        self.found: list[tuple[int, int, FloatArray, FloatArray, IntArray]] = []

    def begin(self, rows: IntArray, seeds: IntArray, first: int) -> None:
        """Start one episode per row."""
        self.states[rows] = self.world.reset(rows, seeds)
        self.machine.reset(rows)
        self.episode[rows] = np.arange(first, first + len(rows))
        self.steps[rows], self.visits[rows] = 0, 0
        self._observe(rows)

    def _observe(self, rows: IntArray) -> None:
        """Let the program decide; keep rows in which the target takes over, end those it cannot go on with."""
        self.machine.advance(rows, self.states[rows])
        now, visits = self.machine.run_index[rows], self.machine.visit[rows]
        fresh = ~self.machine.ended[rows] & ~self.task.solved(self.states[rows])
        self._keep(rows[np.isin(now, self.prefix.targets) & (visits != self.visits[rows]) & fresh])
        self.visits[rows] = visits
        known = np.array([run.controller in self.prefix.skills for run in self.runs])
        over = (now < 0) | ~known[now] | ~fresh | self.world.diverged(rows)
        self.episode[rows[over | (self.steps[rows] >= self.task.horizon)]] = IDLE

    def _keep(self, rows: IntArray) -> None:
        if not len(rows):
            return
        bound = self.machine.entities(rows)[:, : len(run_variables(self.runs[self.prefix.targets[0]]))]
        for row, snapshot, entities in zip(rows, self.world.save(rows), bound, strict=True):
            when = int(self.episode[row]), int(self.steps[row])
            self.found.append((*when, snapshot, self.states[row].copy(), entities))

    def step(self) -> None:
        """Let the active controllers act once in every row in flight."""
        rows = np.flatnonzero(self.episode != IDLE)
        actions = np.zeros((len(rows), self.task.action_size))
        for rank, run in enumerate(self.runs):
            mine = np.flatnonzero(self.machine.run_index[rows] == rank)
            if len(mine):
                bound = self.machine.entities(rows[mine])[:, : len(run_variables(run))]
                actions[mine] = self.prefix.skills[run.controller].act(self.states[rows[mine]], bound)
        self.states[rows] = self.world.step(rows, actions)
        self.steps[rows] += 1
        self._observe(rows)

    def pool(self, entities: int) -> StartPool:
        """Assemble the starts in order of their episodes."""
        found = sorted(self.found, key=lambda start: start[:2])
        size = self.world.save(np.zeros(1, np.int64)).shape[1]
        return StartPool(
            np.array([snapshot for _, _, snapshot, *_ in found]).reshape(len(found), size),
            np.array([state for *_, state, _ in found]).reshape(len(found), self.task.layout.size),
            np.array([bound for *_, bound in found], np.int64).reshape(len(found), entities),
            np.array([steps for _, steps, *_ in found], np.int64),
            np.array([episode for episode, *_ in found], np.int64),
        )


def collect_starts(
    prefix: Prefix,
    task: Task,
    wanted: int,
    seeds: IntArray,
    rng: np.random.Generator,
    batch: int = PoolConfig.batch,
    most: float = inf,
) -> tuple[StartPool, int]:
    """Run the program until enough states are found in which the target takes over.

    Args:
        prefix: program, target and the skills before it; an episode ends where a controller is missing.
        task: where to run.
        wanted: starts to find.
        seeds: (E,) start states of the episodes, the greatest number run.
        rng: decides among entities that `get` may bind.
        batch: rows stepped at once; part of what the result depends on.
        most: control steps that may be spent; what was found until then is returned.

    Returns:
        The starts, fewer than wanted where the prefix fails, and the control steps spent.

    Departs: the paper fills a replay buffer per controller from whole-program runs (Sec. 4.3.3); the states visited
        are the same.
    """
    collection = _Collection(prefix, task, min(batch, len(seeds)), rng)
    launched = 0
    while True:
        free = np.flatnonzero(collection.episode == IDLE)[: len(seeds) - launched]
        if len(free) and len(collection.found) < wanted:
            collection.begin(free, seeds[launched : launched + len(free)], launched)
            launched += len(free)
            continue
        flying = int((collection.episode != IDLE).sum())
        if not flying or collection.world.control_steps + flying > most:
            entities = len(run_variables(collection.runs[prefix.targets[0]]))
            return collection.pool(entities).take(
                np.arange(min(wanted, len(collection.found)))
            ), collection.world.control_steps
        collection.step()
