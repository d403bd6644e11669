"""Types: fields that objects have, widths and units that fit, variables that are bound before they are used."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TypeAlias, assert_never

from roboscribe.dsl.syntax import (
    And,
    Arctan2,
    Const,
    Diff,
    Exists,
    Get,
    Goal,
    Greater,
    If,
    Less,
    Norm,
    Not,
    NotNull,
    Or,
    Predicate,
    Program,
    Proj,
    Robot,
    Run,
    Seq,
    Solved,
    Statement,
    Term,
    Truth,
    Var,
    While,
)
from roboscribe.errors import ProgramError
from roboscribe.world.layout import Attribute, Layout, ObjectType

Variables: TypeAlias = Mapping[str, str]
"""Type by variable name."""


def named_entities(layout: Layout) -> dict[str, str]:
    """Return the type of every entity by its name (b1, b2, d1, ...), as predicates over named entities use them."""
    return {name: layout.entities[index].name for index, name in enumerate(layout.names)}


def check_predicate(predicate: Predicate, layout: Layout, variables: Variables) -> None:
    """Check a predicate.

    Args:
        predicate: what to check.
        layout: the objects there are.
        variables: type of each free variable.

    Raises:
        ProgramError: an unknown variable, type or field; widths or units that do not fit; a constant that is not
            finite.
    """
    match predicate:
        case Truth() | Solved():
            pass
        case Less() | Greater():
            _comparison(predicate, layout, variables)
        case NotNull(of):
            _type(of, layout, variables)
        case Not(of):
            check_predicate(of, layout, variables)
        case And(left, right) | Or(left, right):
            check_predicate(left, layout, variables)
            check_predicate(right, layout, variables)
        case Exists(var, kind, body):
            check_predicate(body, layout, _bound(var, kind, layout, variables))
        case _:
            assert_never(predicate)


def check_program(program: Program, layout: Layout) -> None:
    """Check a whole program: its predicates, and that every variable is assigned before it is used.

    Names of entities count as assigned.

    Raises:
        ProgramError: as in `check_predicate`; a variable used before any get; one controller with differing arguments;
            a sequence directly inside a sequence.
    """
    _statement(program.body, layout, named_entities(layout), {})


def _statement(
    statement: Statement, layout: Layout, variables: Variables, arguments: dict[str, tuple[str, ...]]
) -> Variables:
    """Check a statement; return the variables assigned once it has run."""
    match statement:
        case Seq(parts):
            for part in parts:
                if isinstance(part, Seq):
                    msg = "a sequence stands directly inside a sequence; expected one flat sequence"
                    raise ProgramError(msg)
                variables = _statement(part, layout, variables, arguments)
            return variables
        case Get():
            return _get(statement, layout, variables)
        case While(guard, body):
            return _loop(guard, body, layout, variables, arguments)
        case If(test, then, otherwise):
            check_predicate(test, layout, variables)
            first = _statement(then, layout, variables, arguments)
            second = _statement(otherwise, layout, variables, arguments)
            return {name: kind for name, kind in first.items() if second.get(name) == kind}
        case Run():
            _run(statement, layout, variables, arguments)
            return variables
        case _:
            assert_never(statement)


def _loop(
    guard: Get | Predicate,
    body: Statement,
    layout: Layout,
    variables: Variables,
    arguments: dict[str, tuple[str, ...]],
) -> Variables:
    if isinstance(guard, Get):
        variables = _get(guard, layout, variables)
    else:
        check_predicate(guard, layout, variables)
    _statement(body, layout, variables, arguments)
    return variables


def _get(get: Get, layout: Layout, variables: Variables) -> Variables:
    inner = _bound(get.var, get.type, layout, variables)
    check_predicate(get.where, layout, inner)
    return inner


def _run(run: Run, layout: Layout, variables: Variables, arguments: dict[str, tuple[str, ...]]) -> None:
    signature: list[str] = []
    for arg in run.args:
        kind = _owner(arg, layout, variables)
        if isinstance(arg, Goal) and not kind.goal:
            msg = f"{arg} in the arguments of π_{run.controller}: entities of type {kind.name} have no goal"
            raise ProgramError(msg)
        signature.append(f"g({kind.name})" if isinstance(arg, Goal) else kind.name)
    known = arguments.setdefault(run.controller, tuple(signature))
    if known != tuple(signature):
        shown = f"({', '.join(known)}) and ({', '.join(signature)})"
        msg = f"controller π_{run.controller} is given arguments of types {shown}; expected the same everywhere"
        raise ProgramError(msg)
    check_predicate(run.until, layout, variables)


def _bound(var: Var, kind: str, layout: Layout, variables: Variables) -> Variables:
    if kind not in layout.types:
        msg = f"unknown type {kind!r} of variable {var.name}; expected one of {', '.join(layout.types)}"
        raise ProgramError(msg)
    return {**variables, var.name: kind}


def _comparison(atom: Less | Greater, layout: Layout, variables: Variables) -> None:
    (width, unit), (other_width, other_unit) = (_term(side, layout, variables) for side in (atom.left, atom.right))
    if width != 1 or other_width != 1:
        msg = f"{atom} compares {width} with {other_width} numbers; expected one with one (take a norm or a component)"
        raise ProgramError(msg)
    _same_unit(str(atom), unit, other_unit)


def _same_unit(where: str, unit: str | None, other: str | None) -> None:
    if unit is not None and other is not None and unit != other:
        msg = f"{where} mixes the units {unit} and {other}; expected one unit"
        raise ProgramError(msg)


def _type(var: Var, layout: Layout, variables: Variables) -> ObjectType:
    if var.name not in variables:
        known = ", ".join(variables) or "none"
        msg = f"variable {var.name} is used before it is bound; bound here are: {known}"
        raise ProgramError(msg)
    return layout.types[variables[var.name]]


def _owner(item: Robot | Var | Goal, layout: Layout, variables: Variables) -> ObjectType:
    if isinstance(item, Robot):
        return layout.robot
    return _type(item.of if isinstance(item, Goal) else item, layout, variables)


def _term(term: Term, layout: Layout, variables: Variables) -> tuple[int, str | None]:
    """Return width and unit."""
    match term:
        case Proj():
            return _projection(term, layout, variables)
        case Diff(left, right):
            width, unit = _term(left, layout, variables)
            other_width, other = _term(right, layout, variables)
            if width != other_width:
                msg = f"{term} subtracts {other_width} from {width} numbers; expected equal counts"
                raise ProgramError(msg)
            _same_unit(str(term), unit, other)
            return width, other if unit is None else unit
        case Norm(of):
            return 1, _term(of, layout, variables)[1]
        case Arctan2(of):
            width, _ = _term(of, layout, variables)
            if width != 2:
                msg = f"{term} takes a planar vector of 2 numbers, got {width}"
                raise ProgramError(msg)
            return 1, "rad"
        case Const(value):
            if not isfinite(value):
                msg = f"constant {value} is not finite"
                raise ProgramError(msg)
            return 1, None
        case _:
            assert_never(term)


def _projection(term: Proj, layout: Layout, variables: Variables) -> tuple[int, str]:
    kind = _owner(term.of, layout, variables)
    goal = isinstance(term.of, Goal)
    found = kind.find(term.field, goal)
    if found is None:
        names = ", ".join(name for each in kind.described(goal) for name in _fields(each)) or "none"
        owner = f"goals of type {kind.name}" if goal else f"type {kind.name}"
        msg = f"{term}: {owner} has no field {term.field!r}; it has: {names}"
        raise ProgramError(msg)
    attribute, picked = found
    return len(picked), attribute.unit


def _fields(attribute: Attribute) -> tuple[str, ...]:
    return tuple(dict.fromkeys((attribute.name, *attribute.components)))
