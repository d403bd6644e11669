"""Filling a skill's pool: run the program and keep the states in which the skill takes over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.interpreter import Controller, execute
from roboscribe.dsl.observer import Arrivals, Observer
from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.dsl.syntax import Program
from roboscribe.rl.config import PoolConfig
from roboscribe.rl.pool import StartPool
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import Task


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


class _Collector(Observer):
    """Keeps the states in which a program comes to the target, until there are enough of them."""

    def __init__(self, prefix: Prefix, task: Task, wanted: int, batch: int, most: float) -> None:
        self.prefix, self.task, self.wanted, self.most = prefix, task, wanted, most
        self.arguments = len(run_variables(controllers(prefix.program)[prefix.targets[0]]))
        self.visits = np.zeros(batch, np.int64)
        self.found: list[tuple[int, int, FloatArray, FloatArray, IntArray]] = []
        self.snapshot_size = self.spent = 0

    def see(self, arrivals: Arrivals) -> BoolArray:
        """Keep rows in which the target takes over; end those whose task is solved or that no controller acts in."""
        rows, machine = arrivals.rows, arrivals.machine
        self.spent = arrivals.world.control_steps
        self.snapshot_size = self.snapshot_size or arrivals.world.save(rows[:1]).shape[1]
        self.visits[rows[arrivals.steps == 0]] = 0
        over = machine.ended[rows] | self.task.solved(arrivals.states)
        fresh = ~over & (machine.visit[rows] != self.visits[rows])
        self._keep(arrivals, np.flatnonzero(np.isin(machine.run_index[rows], self.prefix.targets) & fresh))
        self.visits[rows] = machine.visit[rows]
        return np.asarray(over | (machine.run_index[rows] < 0), np.bool_)

    def _keep(self, arrivals: Arrivals, ranks: IntArray) -> None:
        if not len(ranks):
            return
        rows = arrivals.rows[ranks]
        snapshots, bound = arrivals.world.save(rows), arrivals.machine.entities(rows)[:, : self.arguments]
        for rank, snapshot, entities in zip(ranks, snapshots, bound, strict=True):
            when = int(arrivals.episodes[rank]), int(arrivals.steps[rank])
            self.found.append((*when, snapshot, arrivals.states[rank].copy(), entities))

    def wants_episodes(self) -> bool:
        """Tell whether starts are lacking."""
        return len(self.found) < self.wanted

    def allows(self, steps: int) -> bool:
        """Tell whether so many more control steps may be spent."""
        return self.spent + steps <= self.most

    def pool(self) -> StartPool:
        """Assemble the starts in order of their episodes, no more than are wanted."""
        found = sorted(self.found, key=lambda start: start[:2])
        pool = StartPool(
            np.array([snapshot for _, _, snapshot, *_ in found]).reshape(len(found), self.snapshot_size),
            np.array([state for *_, state, _ in found]).reshape(len(found), self.task.layout.size),
            np.array([bound for *_, bound in found], np.int64).reshape(len(found), self.arguments),
            np.array([steps for _, steps, *_ in found], np.int64),
            np.array([episode for episode, *_ in found], np.int64),
        )
        return pool.take(np.arange(min(self.wanted, len(found))))


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
    rows = min(batch, len(seeds))
    collector = _Collector(prefix, task, wanted, rows, most)
    execute(
        prefix.program,
        prefix.skills,
        task,
        seeds,
        limits=prefix.limits,
        batch=rows,
        until_end=True,
        confirm=prefix.confirm,
        rng=rng,
        observer=collector,
    )
    return collector.pool(), collector.spent
