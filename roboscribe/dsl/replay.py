"""What a program did in every state of an episode, found again from the states alone; for films and reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from typing import assert_never

import numpy as np

from roboscribe.dsl.machine import Machine
from roboscribe.dsl.rewrite import conjuncts, controllers, free_vars, rename
from roboscribe.dsl.semantics import SolvedTest, evaluate, holds
from roboscribe.dsl.syntax import (
    And,
    Exists,
    Get,
    Greater,
    If,
    Less,
    Not,
    NotNull,
    Or,
    Predicate,
    Program,
    Run,
    Seq,
    Solved,
    Statement,
    Truth,
    While,
)
from roboscribe.world.layout import NULL, FloatArray, Layout


@dataclass(frozen=True)
class Moment:
    """Where a program stands in one observed state.

    Args:
        run: index into `controllers(program)` of what acts; -1 for nothing.
        bound: entity index by variable; variables that are null are left out.
        ended: whether the program is over; its last controller acts on.
    """

    run: int
    bound: Mapping[str, int]
    ended: bool


def replay(
    program: Program,
    layout: Layout,
    states: FloatArray,
    limits: Mapping[str, int],
    confirm: int,
    solved: SolvedTest | None = None,
) -> tuple[Moment, ...]:
    """Advance a program along the states of an episode that it ran.

    Args:
        program: what was run.
        layout: meaning of the states.
        states: (T + 1, F).
        limits: step limit by controller.
        confirm: consecutive states in which `until` must hold.
        solved: answers ψ_R.

    Returns:
        One moment per state.
    """
    machine = Machine(program, layout, 1, limits=limits, confirm=confirm, solved=solved)
    row, found = np.zeros(1, dtype=np.int64), []
    for state in states:
        machine.advance(row, state[None])
        bound = {name: entity for name, entity in machine.binding(0).items() if entity != NULL}
        found.append(Moment(int(machine.run_index[0]), bound, bool(machine.ended[0])))
    return tuple(found)


@dataclass(frozen=True)
class Reading:
    """One comparison of a predicate in one state.

    Args:
        said: the comparison, about entities by name.
        value: its left side, in its unit; NaN where it is no comparison of numbers.
        threshold: its right side.
        holds: whether it is true.
    """

    said: str
    value: float
    threshold: float
    holds: bool


def readings(
    predicate: Predicate, state: FloatArray, bound: Mapping[str, int], layout: Layout, solved: SolvedTest | None = None
) -> tuple[Reading, ...]:
    """Read every conjunct of a predicate in a state (F,); what is about a variable that is null cannot be read.

    Args:
        predicate: what is asked.
        state: one state.
        bound: entity index by variable.
        layout: meaning of the state.
        solved: answers ψ_R.
    """
    named = rename(predicate, {name: layout.names[entity] for name, entity in bound.items()})
    known = [part for part in conjuncts(named) if set(free_vars(part)) <= set(layout.names)]
    return tuple(_reading(part, state, layout, solved) for part in known)


def _reading(part: Predicate, state: FloatArray, layout: Layout, solved: SolvedTest | None) -> Reading:
    true = bool(holds(part, state, {}, layout, solved))
    match part:
        case Less(left, right) | Greater(left, right) | Not(Less(left, right)) | Not(Greater(left, right)):
            sides = (evaluate(term, state, {}, layout) for term in (left, right))
            value, threshold = (float(side[0]) if side.size == 1 else nan for side in sides)
            return Reading(str(part), value, threshold, true)
        case Not() | And() | Or() | Exists() | NotNull() | Truth() | Solved():
            return Reading(str(part), nan, nan, true)
        case _:
            assert_never(part)


def guards(program: Program) -> tuple[Get | Predicate | None, ...]:
    """Return for every controller the condition of the innermost loop or branch around it; None outside of them."""
    found: list[Get | Predicate | None] = []
    _guards(program.body, None, found)
    assert len(found) == len(controllers(program))
    return tuple(found)


def _guards(statement: Statement, guard: Get | Predicate | None, found: list[Get | Predicate | None]) -> None:
    match statement:
        case Run():
            found.append(guard)
        case Seq(parts):
            for part in parts:
                _guards(part, guard, found)
        case While(condition, body):
            _guards(body, condition, found)
        case If(condition, then, otherwise):
            _guards(then, condition, found)
            _guards(otherwise, condition, found)
        case Get():
            pass
