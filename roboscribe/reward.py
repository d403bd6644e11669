"""R_φ, the dense reward read off a predicate (Sec. 4.3.3)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import assert_never

import numpy as np

from roboscribe.dsl.rewrite import walk
from roboscribe.dsl.semantics import Binding, SolvedTest, evaluate, holds
from roboscribe.dsl.syntax import (
    And,
    Atom,
    Const,
    Exists,
    Greater,
    Less,
    Not,
    NotNull,
    Or,
    Predicate,
    Solved,
    Term,
    Truth,
)
from roboscribe.world.layout import FloatArray, Layout

UNSCALED: Mapping[str, float] = MappingProxyType({})
"""Every atom's margin counts in its own unit."""
FALSE_MARGIN = -1.0
"""Reward, in scales, of what has no margin of its own and does not hold: null objects, empty types."""


def reward(  # noqa: C901 - one case per kind of predicate
    predicate: Predicate,
    states: FloatArray,
    binding: Binding,
    layout: Layout,
    scales: Mapping[str, float] = UNSCALED,
    solved: SolvedTest | None = None,
) -> FloatArray:
    """Score how far each state is inside (positive) or outside (negative) a predicate.

    Where R > 0 the predicate holds and where R < 0 it does not; on the boundary, for True and for an unsolved ψ_R
    it is 0. The bonus of +1 while φ holds is paid by the skill's environment, not here.

    Args:
        predicate: φ.
        states: (..., F).
        binding: entity indices of φ's free variables, shapes broadcastable to the leading axes of `states`.
        layout: meaning of the columns.
        scales: unit of each atom's margin by the text of its left term, in that term's unit; 1 where missing.
        solved: answers ψ_R; needed only where φ contains it.

    Returns:
        (...), counted in scales.

    Raises:
        ValueError: φ contains ψ_R and `solved` is None.

    Source: R_φ of Sec. 4.3.3.
    Departs: completed for ¬, ∃, True, α < α and ψ_R, and atoms are divided by scales, because a minimum over
        metres and radians compares unlike units. Negation flips the sign, which is the reward of the negation
        normal form since −min(a, b) = max(−a, −b).
    """

    def score(part: Predicate, bound: Binding) -> FloatArray:
        match part:
            case And(left, right):
                return np.minimum(score(left, bound), score(right, bound))
            case Or(left, right):
                return np.maximum(score(left, bound), score(right, bound))
            case Not(of):
                return -score(of, bound)
            case Less() | Greater():
                return _margin(part, states, bound, layout) / scales.get(str(atom_term(part)), 1.0)
            case Exists(var, kind, body):
                answers = [score(body, {**bound, var.name: i}) for i in layout.of_type(kind)]
                return np.max(answers, axis=0) if answers else np.full(states.shape[:-1], FALSE_MARGIN)
            case NotNull():
                return np.where(holds(part, states, bound, layout), -FALSE_MARGIN, FALSE_MARGIN)
            case Truth():
                return np.zeros(states.shape[:-1])
            case Solved():
                if solved is None:
                    msg = "the predicate contains ψ_R, so a test `solved` is needed to score it"
                    raise ValueError(msg)
                return solved(states).astype(np.float64)
        assert_never(part)

    return score(predicate, binding)


def _margin(atom: Atom, states: FloatArray, binding: Binding, layout: Layout) -> FloatArray:
    """Return how far an atom's sides are apart in the direction that satisfies it, in the term's unit."""
    left = evaluate(atom.left, states, binding, layout)[..., 0]
    right = evaluate(atom.right, states, binding, layout)[..., 0]
    match atom:
        case Less():
            gap = right - left
        case Greater():
            gap = left - right
        case _:
            assert_never(atom)
    return np.where(np.isnan(gap), FALSE_MARGIN, gap)


def atoms(predicate: Predicate) -> tuple[Atom, ...]:
    """List the atoms of a predicate in order of appearance."""
    return tuple(node for node in walk(predicate) if isinstance(node, Atom))


def atom_term(atom: Atom) -> Term:
    """Return the term whose text keys an atom's scale: its left, or its right where the left is a constant."""
    return atom.right if isinstance(atom.left, Const) else atom.left
