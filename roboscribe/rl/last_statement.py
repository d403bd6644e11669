"""Which statement of a program comes last: ψ_R is asked of its controller, not only its own φ."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import assert_never

from roboscribe.dsl.rewrite import conjunction, conjuncts, controllers, free_vars, walk
from roboscribe.dsl.syntax import Exists, Get, If, Not, Or, Predicate, Program, Run, Seq, Statement, Truth, While


def continues_if(program: Program, controller: str, settled: Callable[[Predicate], bool]) -> Predicate:
    """Return where a program goes on once a controller has reached its φ; elsewhere it is over.

    The last statement of a loop that comes last goes on while there is another entity, the one of a branch where the
    condition chooses the other branch. What guards and conditions name besides is whatever a get binds it to.

    Args:
        program: whose statements.
        controller: its name; branches may share it.
        settled: whether a condition is as true at the end as it was when it was asked. The statements of branches
            whose condition is not are taken for ones that others follow.
    """
    over = _over(program.body, controller, [part for part in walk(program) if isinstance(part, Get)], settled)
    return Truth() if over is None else _negation(over)


def _over(
    statement: Statement, controller: str, gets: Sequence[Get], settled: Callable[[Predicate], bool]
) -> Predicate | None:
    """Return where a statement is over once a controller has reached its φ; None: nowhere."""
    match statement:
        case Run():
            return Truth() if statement.controller == controller else None
        case Get():
            return None
        case Seq(parts):
            earlier = {run.controller for part in parts[:-1] for run in controllers(part)}
            return _over(parts[-1], controller, gets, settled) if parts and controller not in earlier else None
        case While(guard, body):
            last = controllers(body)[-1:]
            if not last or last[0].controller != controller or not isinstance(guard, Get):
                return None
            return _negation(_exists(guard, gets))
        case If(test, then, otherwise):
            first, second = (_over(branch, controller, gets, settled) for branch in (then, otherwise))
            if first == second == Truth():
                return Truth()
            chosen = _closed(test, gets)
            if not settled(chosen):
                return None
            found = [
                conjunction([where, *conjuncts(over)])
                for where, over in ((chosen, first), (_negation(chosen), second))
                if over is not None
            ]
            return reduce(Or, found) if found else None
        case _:
            assert_never(statement)


def _negation(predicate: Predicate) -> Predicate:
    return predicate.of if isinstance(predicate, Not) else Not(predicate)


def _exists(get: Get, gets: Sequence[Get]) -> Predicate:
    """Say that an entity is there to get, whatever others are bound to."""
    others = [each for each in gets if each.var != get.var]
    return _closed(Exists(get.var, get.type, get.where), others)


def _closed(predicate: Predicate, gets: Sequence[Get]) -> Predicate:
    """Bind a predicate's variables to what is got: those without like need no further words."""
    for each in reversed(gets):
        if each.var.name in free_vars(predicate):
            predicate = Exists(each.var, each.type, conjunction([each.where, predicate]))
    return predicate
