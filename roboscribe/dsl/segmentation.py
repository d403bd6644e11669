"""Cutting demonstrations by what a program would have run, and telling which of them it explains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from roboscribe.dsl.machine import Machine
from roboscribe.dsl.rewrite import controllers as runs_of
from roboscribe.dsl.rewrite import free_vars, run_variables, walk
from roboscribe.dsl.semantics import SolvedTest, holds
from roboscribe.dsl.syntax import Get, Predicate, Program, Run, While
from roboscribe.world.layout import NULL, BoolArray, FloatArray, IntArray
from roboscribe.world.trajectory import NEVER, Trajectory


@dataclass(frozen=True)
class Segment:
    """Frames start to stop - 1 of a demonstration: the actions taken while one controller statement was active.

    Args:
        run_index: index into `controllers(program)`.
        start: first frame.
        stop: frame after the last one.
        entities: what the statement's variables were bound to, in order of first occurrence among its arguments.
    """

    run_index: int
    start: int
    stop: int
    entities: tuple[int, ...]


class _Shown:
    """Which entity demonstrations finish next, for every loop of a program over entities.

    Args:
        program: whose loops.
        trajectories: D demonstrations.
        solved: answers ψ_R.
    """

    def __init__(self, program: Program, trajectories: Sequence[Trajectory], solved: SolvedTest | None) -> None:
        """Look up when each entity is finished."""
        self.frame = 0
        """The state that is observed now; the last one of a shorter demonstration stands for later ones."""
        loops = [(part.guard, runs_of(part.body)) for part in walk(program) if isinstance(part, While)]
        self._steps: dict[str, list[IntArray]] = {}
        for guard, runs in loops:
            if isinstance(guard, Get) and runs and free_vars(runs[-1].until) == (guard.var.name,):
                found = [_next_steps(guard, runs[-1].until, shown, solved) for shown in trajectories]
                self._steps[guard.var.name] = found

    def prefers(self, var: str, rows: IntArray) -> FloatArray:
        """Say how soon entities (N,) are finished in demonstrations `rows` (R,), the sooner the greater: (N, R)."""
        if var not in self._steps:
            return np.zeros((1, len(rows)))
        steps = [self._steps[var][row] for row in rows]
        now = [step[:, min(self.frame, step.shape[1] - 1)] for step in steps]
        return np.asarray(-np.stack(now, axis=1), np.float64)


def _next_steps(get: Get, until: Predicate, shown: Trajectory, solved: SolvedTest | None) -> IntArray:
    """Return from every frame on when `until` next holds of each entity, (N, T); NEVER where it does not."""
    members = shown.layout.of_type(get.type)
    truth = np.stack([holds(until, shown.states, {get.var.name: e}, shown.layout, solved) for e in members])
    steps = np.where(truth, np.arange(len(shown)), NEVER)
    return np.asarray(np.minimum.accumulate(steps[:, ::-1], axis=1)[:, ::-1], np.int64)


def segment(
    program: Program,
    trajectories: Sequence[Trajectory],
    limits: Mapping[str, int] | None = None,
    solved: SolvedTest | None = None,
    *,
    after_end: bool = True,
) -> tuple[tuple[Segment, ...], ...]:
    """Cut demonstrations into the parts that each visit to a controller statement would have been responsible for.

    The program is advanced along the demonstrated states; where a loop may serve several entities, it takes the one
    that the demonstration finishes next. A statement whose goal holds on arrival gets no frame, unless it is the last:
    frames after the program's end belong to the last statement reached, if asked so.

    Args:
        program: what to advance.
        trajectories: D demonstrations.
        limits: step limit by controller name; none by default.
        solved: answers ψ_R, where the program mentions it.
        after_end: whether what comes after the program's end belongs to the last statement.

    Returns:
        Of each demonstration its segments in order, without gaps from the first controller on; none where no
        controller is ever reached.
    """
    found: list[list[Segment]] = [[] for _ in trajectories]
    if not trajectories:
        return ()
    counts = [len(run_variables(run)) for run in runs_of(program)]
    visits = np.zeros(len(trajectories), dtype=np.int64)
    machine, shown = _machine(program, trajectories, limits or {}, solved)
    for frame, rows in _advance(machine, shown, trajectories, _lengths(trajectories) - 1):
        for row in rows[after_end | ~machine.ended[rows]].tolist():
            line, parts = int(machine.run_index[row]), found[row]
            if line >= 0 and machine.visit[row] != visits[row]:
                visits[row] = machine.visit[row]
                entities = tuple(machine.entities(np.array([row]))[0, : counts[line]].tolist())
                parts.append(Segment(line, frame, frame + 1, entities))
            elif parts:
                parts[-1] = replace(parts[-1], stop=frame + 1)
    return tuple(tuple(parts) for parts in found)


def _machine(
    program: Program, trajectories: Sequence[Trajectory], limits: Mapping[str, int], solved: SolvedTest | None
) -> tuple[Machine, _Shown]:
    """Return a machine with a row for each demonstration, and what tells it whom they serve next."""
    shown = _Shown(program, trajectories, solved)
    layout, count = trajectories[0].layout, len(trajectories)
    return Machine(program, layout, count, limits=limits, confirm=1, solved=solved, prefers=shown.prefers), shown


def _advance(
    machine: Machine, shown: _Shown, trajectories: Sequence[Trajectory], lengths: IntArray
) -> Iterator[tuple[int, IntArray]]:
    """Advance the first `lengths` (D,) states of demonstrations side by side; yields each frame, and who has it."""
    for frame in range(int(lengths.max())):
        shown.frame = frame
        rows = np.flatnonzero(lengths > frame)
        machine.advance(rows, np.stack([trajectories[row].states[frame] for row in rows]))
        yield frame, rows


def _lengths(trajectories: Sequence[Trajectory]) -> IntArray:
    """Count the states of each demonstration, (D,)."""
    return np.array([len(each) for each in trajectories], dtype=np.int64)


def explains(program: Program, trajectories: Sequence[Trajectory], solved: SolvedTest) -> BoolArray:
    """Tell which demonstrations a program explains: each brings about whatever the program asks for.

    The program is advanced along the demonstrated states. What it waits for in vain counts where it was reached
    earlier, for parts that may be done in any order are written in one; and so does what is left to do for one entity
    where a demonstration ends as soon as the task is solved.

    Args:
        program: what to advance.
        trajectories: D demonstrations, entities named by the order in which they are displaced.
        solved: answers ψ_R.

    Returns:
        (D,).
    """
    machine, shown = _machine(program, trajectories, {}, solved)
    for _ in _advance(machine, shown, trajectories, _lengths(trajectories)):
        pass
    runs = runs_of(program)
    return np.array([_closes(machine, row, runs, t, solved) for row, t in enumerate(trajectories)], dtype=np.bool_)


def _closes(machine: Machine, row: int, runs: Sequence[Run], shown: Trajectory, solved: SolvedTest) -> bool:
    """Tell whether a demonstration leaves nothing to do but what it did before, or for the entity that it ends with."""
    rows, last = np.array([row]), shown.states[-1:]
    unfinished: tuple[int, ...] | None = None
    for _ in range(len(runs) * (1 + len(shown.layout.entities))):
        if machine.ended[row]:
            return not machine.stuck[row]
        run = runs[int(machine.run_index[row])]
        names = run_variables(run)
        bound = tuple(machine.entities(rows)[0, : len(names)].tolist())
        if not _ever(run, bound, shown, solved):
            served = int(machine.served[row])
            about = bound if served == NULL else (served,)
            if not solved(last)[0] or unfinished not in (None, about):
                return False
            if unfinished == about and served == NULL:  # asked for again, as the first of what is left
                return all(_ever(other, found, shown, solved) for other, found in _bound(machine, row, runs, but=run))
            if unfinished == about and run is runs[-1]:
                alike = shown.layout.of_type(shown.layout.entities[served].name)
                others = (tuple(e if b == served else b for b in bound) for e in alike if e != served)
                return all(_ever(run, other, shown, solved) for other in others)
            unfinished = about
        machine.skip(rows)
        machine.advance(rows, last)
    return False


def _bound(machine: Machine, row: int, runs: Sequence[Run], but: Run) -> Iterator[tuple[Run, tuple[int, ...]]]:
    """Yield the other controller statements whose variables are all bound, and what to."""
    binding = machine.binding(row)
    for run in (each for each in runs if each != but):
        bound = tuple(binding[name] for name in run_variables(run))
        if NULL not in bound:
            yield run, bound


def _ever(run: Run, bound: tuple[int, ...], shown: Trajectory, solved: SolvedTest) -> bool:
    """Tell whether a demonstration ever reaches what a controller is to bring about for some entities."""
    binding = dict(zip(run_variables(run), bound, strict=True))
    return bool(holds(run.until, shown.states, binding, shown.layout, solved).any())
