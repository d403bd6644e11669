"""Running programs: `execute` drives worlds with controllers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.machine import Machine
from roboscribe.dsl.observer import Arrivals, Observer
from roboscribe.dsl.rewrite import controllers as runs_of
from roboscribe.dsl.rewrite import run_variables
from roboscribe.dsl.rollouts import FinishedEpisode, Recorder, Rollouts, gather
from roboscribe.dsl.syntax import Program
from roboscribe.errors import ProgramError
from roboscribe.world.layout import NULL, BoolArray, FloatArray, IntArray
from roboscribe.world.task import Judge, Task, World

__all__ = ["Controller", "Machine", "Rollouts", "execute"]


class Controller(Protocol):
    """A low-level controller π: a function of the state and of the entities it is given."""

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Choose actions (R, A) in [-1, 1] for states (R, F) and entities (R, n).

        n is the count of distinct variables among the controller's arguments, in order of first occurrence; a column
        holds NULL where the variable is null.
        """


class Memory(Protocol):
    """A controller at work in many rows that remembers what it saw earlier in each row's episode."""

    def forget(self, rows: IntArray) -> None:
        """Begin episodes in some rows (R,)."""

    def act(self, rows: IntArray, states: FloatArray, entities: IntArray) -> FloatArray:
        """Choose actions (R, A) as a controller does; called once per step in which the controller acts in `rows`."""


@runtime_checkable
class Remembering(Protocol):
    """A controller whose action depends on more than the present state."""

    def remember(self, batch: int) -> Memory:
        """Return what acts in `batch` rows."""


@dataclass(frozen=True)
class _Memoryless:
    """An ordinary controller where one that remembers is wanted."""

    controller: Controller

    def forget(self, rows: IntArray) -> None:
        """Do nothing: there is nothing to forget."""

    def act(self, rows: IntArray, states: FloatArray, entities: IntArray) -> FloatArray:
        return self.controller.act(states, entities)


def execute(
    program: Program,
    controllers: Mapping[str, Controller],
    task: Task,
    seeds: IntArray,
    *,
    limits: Mapping[str, int],
    batch: int = 64,
    horizon: int | None = None,
    until_end: bool = False,
    confirm: int = CONFIRM,
    rng: Generator | None = None,
    keep_actions: bool = False,
    observer: Observer | None = None,
) -> Rollouts:
    """Run a program once from every seed's initial state.

    Rows whose episode is over take the next seed, so the batch stays full. Without `rng` the result of an episode
    depends on its seed alone, whatever the batch (given controllers whose answers do not depend on it either).

    Args:
        program: what to run.
        controllers: controller by name.
        task: world, goal test and horizon.
        seeds: (E,) one per episode.
        limits: step limit by controller name; a controller without one has all the time it wants.
        batch: most rows at once.
        horizon: most control steps of an episode; None is the task's.
        until_end: success is that the program reaches its end, not that the task is solved.
        confirm: consecutive observed states in which `until` must hold to count as reached.
        rng: draws among the answers of get that were served least often; None takes the lowest index of them.
        keep_actions: keep the actions in the trajectories.
        observer: looks on. With one, controllers may be lacking: an episode that comes to such a one ends there.

    Returns:
        Episodes in the order of `seeds`, but for those that `observer` left out. With `until_end` False an episode ends
        as soon as the task is solved; with True as soon as the program ends. Both end at the horizon and on divergence,
        as failures. A program that is over leaves its last controller acting, and one that never had a controller
        commands zero.

    Raises:
        ProgramError: the program does not type-check for the task, or runs a controller that `controllers` lacks,
            and nobody looks on.

    Source: Exec(M, P) of Sec. 3 and Fig. 14.
    """
    missing = {run.controller for run in runs_of(program)} - set(controllers)
    if missing and observer is None:
        given = ", ".join(sorted(controllers)) or "none"
        msg = f"program {program.name} runs π_{', π_'.join(sorted(missing))}; controllers given: {given}"
        raise ProgramError(msg)
    rows = min(batch, max(len(seeds), 1))
    machine = Machine(program, task.layout, rows, limits=limits, confirm=confirm, rng=rng, solved=task.solved)
    recorder = Recorder(
        task.layout, rows, task.horizon if horizon is None else horizon, task.action_size * keep_actions
    )
    names = tuple(run.controller for run in runs_of(program))
    crew = [
        (at_work(controllers[run.controller], rows) if run.controller in controllers else None, len(run_variables(run)))
        for run in runs_of(program)
    ]
    drawn, looks_on = np.asarray(seeds, dtype=np.int64), observer or Observer()
    return _Execution(drawn, task, task.world(rows), machine, recorder, crew, names, until_end, looks_on).run()


def at_work(controller: Controller, batch: int) -> Memory:
    """Return a controller as it acts in `batch` rows."""
    return controller.remember(batch) if isinstance(controller, Remembering) else _Memoryless(controller)


@dataclass
class _Execution:
    """One call of `execute`: rows that act, rows whose episode is over, seeds that wait."""

    seeds: IntArray
    task: Task
    world: World
    machine: Machine
    recorder: Recorder
    crew: list[tuple[Memory | None, int]]
    names: tuple[str, ...]
    until_end: bool
    observer: Observer

    def __post_init__(self) -> None:
        rows = len(self.recorder.steps)
        self._states = np.zeros((rows, self.task.layout.size))
        self._diverged = np.zeros(rows, dtype=np.bool_)
        self._episode = np.zeros(rows, dtype=np.int64)
        self._known = np.array([*(memory is not None for memory, _ in self.crew), True], dtype=np.bool_)
        self._next = 0
        self._finished: dict[int, FinishedEpisode] = {}

    def run(self) -> Rollouts:
        rows = self._begin(np.arange(len(self._states)))
        while len(rows):
            acting, over = self._judge(rows)
            while len(fresh := self._begin(over)):
                started, over = self._judge(fresh)
                acting = np.sort(np.concatenate((acting, started)))
            if not self.observer.allows(len(acting)):
                break
            if len(acting):
                self._step(acting)
            rows = acting
        return gather(self.task.layout, [episode for _, episode in sorted(self._finished.items())])

    def _begin(self, rows: IntArray) -> IntArray:
        """Start the next episodes in `rows`; return the rows for which there was one."""
        if not self.observer.wants_episodes():
            return rows[:0]
        rows = rows[: len(self.seeds) - self._next]
        if len(rows):
            self._episode[rows] = np.arange(self._next, self._next + len(rows))
            self._next += len(rows)
            self._states[rows] = self.world.reset(rows, self.seeds[self._episode[rows]])
            self._diverged[rows] = False
            self.recorder.start(rows, self._states[rows])
            self.machine.reset(rows)
            for controller, _ in self.crew:
                if controller is not None:
                    controller.forget(rows)
        return rows

    def _judge(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """Look at the new states of `rows`: return those that act next, and those whose episode is over."""
        diverged = self._diverged[rows]
        lost = diverged | (self.recorder.steps[rows] >= self.recorder.horizon)
        if self.until_end:
            self.machine.advance(rows[~diverged], self._states[rows[~diverged]])
            lost |= self.machine.stuck[rows]
            success = self.machine.ended[rows] & ~self.machine.stuck[rows] & ~diverged
        else:
            success = self._solved(rows) & ~diverged
        over = success | lost
        if not self.until_end:
            self.machine.advance(rows[~over], self._states[rows[~over]])
        lines = self.machine.run_index[rows]
        over |= ~self._known[lines]  # the last one stands for -1, no controller at all
        over |= self._seen(rows)
        self._finish(rows[over], success[over])
        return rows[~over], rows[over]

    def _solved(self, rows: IntArray) -> BoolArray:
        return self.world.solved(rows) if isinstance(self.world, Judge) else self.task.solved(self._states[rows])

    def _seen(self, rows: IntArray) -> BoolArray:
        """Show the new states of `rows` to the observer; return which (R,) it ends."""
        steps, states = self.recorder.steps[rows], self._states[rows]
        return self.observer.see(Arrivals(rows, self._episode[rows], steps, states, self.world, self.machine))

    def _finish(self, rows: IntArray, success: BoolArray) -> None:
        for row, solved in zip(rows.tolist(), success.tolist(), strict=True):
            diverged, line = bool(self._diverged[row]), self.machine.never_reached(row)
            unreached = "" if line == NULL else self.names[line]
            episode = self.recorder.cut(row, solved, diverged, self.machine.bound[row], unreached)
            self._finished[int(self._episode[row])] = episode

    def _step(self, rows: IntArray) -> None:
        lines = self.machine.run_index[rows]
        actions = self._command(rows, lines, self._states[rows], self.machine.entities(rows))
        states = self.world.step(rows, actions)
        self.recorder.step(rows, actions, lines, self.machine.served[rows], states)
        self._states[rows] = states
        self._diverged[rows] = self.world.diverged(rows)

    def _command(self, rows: IntArray, lines: IntArray, states: FloatArray, entities: IntArray) -> FloatArray:
        """Ask each row's controller for an action (R, A); rows without one stand still."""
        actions = np.zeros((len(lines), self.task.action_size))
        for line in np.flatnonzero(np.bincount(lines + 1)) - 1:
            if line >= 0:
                here = np.flatnonzero(lines == line)
                controller, count = self.crew[line]
                assert controller is not None, "a row that comes to an unknown controller ends there"
                actions[here] = controller.act(rows[here], states[here], entities[here, :count])
        return actions
