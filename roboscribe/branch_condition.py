"""When one branch comes before another (Sec. 4.5): conditions on what stands when they are chosen."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from roboscribe.dsl.fields import components, same_measure
from roboscribe.dsl.rewrite import size
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import Const, Goal, Greater, Less, Not, Predicate, Term, Var
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.search.loop_entities import is_lasting
from roboscribe.subtask_tree import Node
from roboscribe.world.layout import BoolArray
from roboscribe.world.trajectory import AGREEMENT

DIGITS = range(3, 16)
"""Significant digits of a threshold: as few as will do."""


def order_condition(evidence: Evidence, one: Node, other: Node) -> Predicate | Fail:
    """Find when `one` is reached before `other`, as a predicate on the initial state.

    Args:
        evidence: demonstrations.
        one: a branch's node.
        other: the branch that comes first where the predicate is false.

    Returns:
        The smallest comparison of attributes of the two nodes' entities and goals, or its negation; where there is
        none, what a number that no branch changes has to do with it. Fail where nothing explains it, or where there
        are so few demonstrations that something would by accident.

    Source: Sec. 4.5.
    """
    first = evidence.first_steps(one.lifted(evidence.types)) < evidence.first_steps(other.lifted(evidence.types))
    starts = evidence.states[evidence.starts]
    names = (*one.entities, *other.entities)
    tests = sorted(_cross_comparisons(evidence, names), key=lambda p: (size(p), str(p)))
    if len(first) < np.log2(max(1, 2 * len(tests))):
        return Fail(f"too few demonstrations to tell why {one.name} sometimes comes before {other.name}")
    for test in tests:
        truth = holds(test, starts, {}, evidence.layout)
        for predicate, answer in ((test, truth), (Not(test), ~truth)):
            if np.mean(answer != first) <= 1.0 - AGREEMENT:
                return predicate
    reading = _telling_reading(evidence, first)
    if reading is not None:
        return reading
    return Fail(f"no comparison of attributes explains why {one.name} sometimes comes before {other.name}")


def _telling_reading(evidence: Evidence, first: BoolArray) -> Predicate | None:
    """Find a number on whose side of a threshold it depends whether `first` (D,); None where there is none."""
    starts, layout = evidence.states[evidence.starts], evidence.layout
    readings = list(_lasting_readings(evidence))
    if len(first) < np.log2(max(1, 2 * len(readings) * len(first))):
        return None
    for term in readings:
        values = evaluate(term, starts, {}, layout)[..., 0]
        levels = np.unique(values)
        cuts = (levels[1:] + levels[:-1]) / 2
        wrong = np.mean((values < cuts[:, None]) != first, axis=1)
        for side, missed in ((Less, wrong), (Greater, 1.0 - wrong)):
            if len(cuts) and missed.min() <= 1.0 - AGREEMENT:
                best = np.flatnonzero(missed == missed.min())
                widest = best[np.argmax(np.diff(levels)[best])]
                return side(term, Const(_rounded(float(levels[widest]), float(levels[widest + 1]))))
    return None


def _rounded(below: float, above: float) -> float:
    """Return the middle of two numbers, with the fewest digits with which it lies between them."""
    middle = (below + above) / 2
    return next((r for digits in DIGITS if below < (r := float(f"{middle:.{digits}g}")) < above), middle)


def _lasting_readings(evidence: Evidence) -> Iterator[Term]:
    """Yield single numbers of entities that have no like, and of their goals, that no demonstration changes."""
    layout = evidence.layout
    for name, kind in evidence.types.items():
        if len(layout.of_type(kind)) == 1:
            for goal in (False, True):
                item = Goal(Var(name)) if goal else Var(name)
                for attribute in (a for a in layout.types[kind].described(goal) if a.is_place):
                    for term in components(item, layout.types[kind], attribute):
                        values = evaluate(term, evidence.states, {}, layout)[..., 0]
                        if is_lasting(values, evidence.starts):
                            yield term


def _cross_comparisons(evidence: Evidence, names: tuple[str, ...]) -> Iterator[Predicate]:
    for one, two in combinations(names, 2):
        kinds = [evidence.layout.types[evidence.types[n]] for n in (one, two)]
        for goals in (True, False):
            ends = [Goal(Var(n)) if goals else Var(n) for n in (one, two)]
            places = [[a for a in kind.described(goals) if a.is_place] for kind in kinds]
            for attribute, other in product(*places):
                if same_measure(attribute, other):
                    pairs = zip(
                        components(ends[0], kinds[0], attribute), components(ends[1], kinds[1], other), strict=True
                    )
                    yield from (Less(a, b) for a, b in pairs)
