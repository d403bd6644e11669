"""Meaning of terms and predicates (Fig. 13), on whole arrays of states at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from typing import TypeAlias, assert_never

import numpy as np

from roboscribe.dsl.rewrite import free_vars
from roboscribe.dsl.syntax import (
    And,
    Arctan2,
    Const,
    Diff,
    Exists,
    Goal,
    Greater,
    Less,
    Norm,
    Not,
    NotNull,
    Or,
    Predicate,
    Proj,
    Robot,
    Solved,
    Term,
    Truth,
    Var,
)
from roboscribe.world.layout import NULL, BoolArray, FloatArray, IntArray, Layout

Binding: TypeAlias = Mapping[str, IntArray | int]
"""Entity index by variable name; arrays broadcast against the leading axes of the states."""
SolvedTest: TypeAlias = Callable[[FloatArray], BoolArray]
"""ψ_R: states (..., F) to (...)."""


def evaluate(term: Term, states: FloatArray, binding: Binding, layout: Layout) -> FloatArray:
    """Evaluate a term.

    A variable that `binding` lacks but that names an entity of the layout (b1, d1, ...) stands for that entity.

    Args:
        term: what to evaluate.
        states: (..., F).
        binding: entity indices by variable; broadcast against the leading axes.
        layout: meaning of the columns.

    Returns:
        (..., w) in the unit of the term; NaN wherever a variable of the term is null.

    Raises:
        ValueError: a variable without a binding, a field that its entity lacks, or widths that do not fit.

    Source: Fig. 13, left column.
    Departs: a difference of two angles is wrapped to [-π, π], since angles half a turn apart are not 3π apart.
    """
    value, _ = _value(term, states, binding, layout)
    return np.array(np.broadcast_to(value, (*_leading(term, states, binding), value.shape[-1])))


def holds(
    predicate: Predicate,
    states: FloatArray,
    binding: Binding,
    layout: Layout,
    solved: SolvedTest | None = None,
) -> BoolArray:
    """Decide a predicate in every state.

    Comparisons with NaN, that is with attributes of null, are false.

    Args:
        predicate: what to decide.
        states: (..., F).
        binding: entity indices by free variable; broadcast against the leading axes.
        layout: meaning of the columns.
        solved: answers ψ_R.

    Returns:
        (...), the leading axes of `states` broadcast with those of the bindings of free variables.

    Raises:
        ValueError: ψ_R occurs and `solved` is None, or as in `evaluate`.

    Source: Fig. 13, right column.
    """
    answer = _holds(predicate, states, binding, layout, solved)
    leading = _leading(predicate, states, binding)
    return answer if answer.shape == leading else np.array(np.broadcast_to(answer, leading))


def _holds(p: Predicate, states: FloatArray, binding: Binding, layout: Layout, solved: SolvedTest | None) -> BoolArray:
    match p:
        case Less(left, right) | Greater(right, left):
            return _scalar(left, states, binding, layout) < _scalar(right, states, binding, layout)
        case Not(inner):
            return ~_holds(inner, states, binding, layout, solved)
        case And(left, right):
            first = _holds(left, states, binding, layout, solved)
            return first & _holds(right, states, binding, layout, solved) if first.any() else first
        case Or(left, right):
            first = _holds(left, states, binding, layout, solved)
            return first if first.all() else first | _holds(right, states, binding, layout, solved)
        case Exists():
            return _exists(p, states, binding, layout, solved)
        case NotNull(var):
            return np.asarray(np.not_equal(_entity(var, binding, layout), NULL))
        case Truth():
            return np.ones((), dtype=np.bool_)
        case Solved():
            if solved is None:
                msg = "ψ_R was asked without a task to ask; expected the task's `solved`"
                raise ValueError(msg)
            return solved(states)
        case _:
            assert_never(p)


def _exists(p: Exists, states: FloatArray, binding: Binding, layout: Layout, solved: SolvedTest | None) -> BoolArray:
    answer: BoolArray = np.zeros((), dtype=np.bool_)
    for index in layout.of_type(p.type):
        answer = answer | _holds(p.body, states, {**binding, p.var.name: index}, layout, solved)
        if answer.all():
            break
    return answer


def _scalar(term: Term, states: FloatArray, binding: Binding, layout: Layout) -> FloatArray:
    if isinstance(term, Const):
        return np.array(term.value, dtype=np.float64)
    value, _ = _value(term, states, binding, layout)
    if value.shape[-1] != 1:
        msg = f"{term} has {value.shape[-1]} numbers; only a single number can be compared"
        raise ValueError(msg)
    return value[..., 0]


def _value(term: Term, states: FloatArray, binding: Binding, layout: Layout) -> tuple[FloatArray, str]:
    """Value (..., w), or (w,) where no axis matters, and the unit, which tells angles apart."""
    match term:
        case Proj():
            return _project(term, states, binding, layout)
        case Diff(left, right):
            return _difference(_value(left, states, binding, layout), _value(right, states, binding, layout), term)
        case Norm(of):
            value, unit = _value(of, states, binding, layout)
            return (np.abs(value) if value.shape[-1] == 1 else _length(value)), unit
        case Arctan2(of):
            value, _ = _value(of, states, binding, layout)
            if value.shape[-1] != 2:
                msg = f"{term}: arctan2 takes a planar vector (x, y), got {value.shape[-1]} numbers"
                raise ValueError(msg)
            return np.arctan2(value[..., 1:], value[..., :1]), "rad"
        case Const(value=number):
            return np.array([number], dtype=np.float64), ""
        case _:
            assert_never(term)


def _length(value: FloatArray) -> FloatArray:
    squares: FloatArray = np.einsum("...i,...i->...", value, value)[..., None]
    return np.sqrt(squares)


def _difference(left: tuple[FloatArray, str], right: tuple[FloatArray, str], term: Diff) -> tuple[FloatArray, str]:
    (a, unit), (b, other) = left, right
    if a.shape[-1] != b.shape[-1]:
        msg = f"{term} subtracts {b.shape[-1]} numbers from {a.shape[-1]}; expected equal counts"
        raise ValueError(msg)
    value = a - b
    if unit == other == "rad" and value.shape[-1] == 1:  # dials are labelled in degrees, and have stops
        value -= 2 * pi * np.round(value / (2 * pi))
    return value, unit or other


def _project(term: Proj, states: FloatArray, binding: Binding, layout: Layout) -> tuple[FloatArray, str]:
    owner = term.of
    if isinstance(owner, Robot):
        place = layout.place(term.field, robot=True)
        return states[..., place.columns[0]], place.unit
    goal = isinstance(owner, Goal)
    place = layout.place(term.field, goal=goal)
    entity = _entity(owner.of if isinstance(owner, Goal) else owner, binding, layout)
    width = place.columns.shape[1]
    if np.ndim(entity) > 0:
        return _gather(states, np.asarray(entity), place.columns, term), place.unit
    if entity == NULL:
        return np.full(width, np.nan), place.unit
    columns = place.columns[entity]
    if columns[0] < 0:
        _refuse(term, int(entity), layout)
    if place.contiguous:
        return states[..., columns[0] : columns[0] + width], place.unit
    return states[..., columns], place.unit


def _gather(states: FloatArray, entity: IntArray, table: IntArray, term: Proj) -> FloatArray:
    columns = table[entity]
    leading = np.broadcast_shapes(states.shape[:-1], entity.shape)
    if states.shape[:-1] != leading:
        states = np.broadcast_to(states, (*leading, states.shape[-1]))
    if entity.shape != leading:
        columns = np.broadcast_to(columns, (*leading, table.shape[1]))
    found = np.take_along_axis(states, columns, axis=-1) if states.ndim != 2 else _pick(states, columns)
    missing = entity[..., None] < 0
    if (columns < 0).any():
        if bool(((columns < 0) & ~missing).any()):
            bad = entity[(table[entity][..., 0] < 0) & (entity >= 0)]
            msg = f"{term}: entity {bad.flat[0]} has no such field"
            raise ValueError(msg)
        found = np.where(missing, np.nan, found)
    return found


def _pick(states: FloatArray, columns: IntArray) -> FloatArray:
    """`take_along_axis` for two axes, without its overhead: small batches are asked at every control step."""
    picked: FloatArray = states[np.arange(len(states))[:, None], columns]
    return picked


def _refuse(term: Proj, entity: int, layout: Layout) -> None:
    msg = f"{term}: entity {layout.names[entity]} of type {layout.type_of(entity).name} has no such field"
    raise ValueError(msg)


def _entity(var: Var, binding: Binding, layout: Layout) -> IntArray | int:
    if var.name in binding:
        return binding[var.name]
    if var.name in layout.names:
        return layout.names.index(var.name)
    msg = f"variable {var.name} is not bound; bound are {sorted(binding)}, entities are {', '.join(layout.names)}"
    raise ValueError(msg)


def _leading(node: Term | Predicate, states: FloatArray, binding: Binding) -> tuple[int, ...]:
    """Leading axes of an answer; free variables are searched only where some binding has axes of its own."""
    shapes = {np.shape(value) for value in binding.values()} - {()}
    if shapes <= {states.shape[:-1]}:
        return states.shape[:-1]
    used = (np.shape(binding[name]) for name in free_vars(node) if name in binding)
    return np.broadcast_shapes(states.shape[:-1], *used)
