"""When one branch comes before another (Sec. 4.5): conditions on what stands when they are chosen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product
from math import comb, log2

import numpy as np

from roboscribe.dsl.fields import components, same_measure
from roboscribe.dsl.rewrite import rename, size
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import Const, Goal, Greater, Less, Norm, Not, Predicate, Term, Var
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.search.differences import differences, landmarks
from roboscribe.search.loop_entities import is_lasting
from roboscribe.subtask_tree import Node
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import AGREEMENT, NEVER

BY_ACCIDENT = 0.05
"""How seldom one of all distances may tell the order of demonstrations by accident."""
DIGITS = range(3, 16)
"""Significant digits of a threshold: as few as will do."""


def order_condition(evidence: Evidence, one: Node, other: Node, chosen: IntArray | None = None) -> Predicate | Fail:
    """Find when `one` is reached before `other`, as a predicate on the initial state.

    Args:
        evidence: demonstrations; those that finish one of the branches alone say nothing.
        one: a branch's node.
        other: the branch that comes first where the predicate is false.
        chosen: (D,) step of each demonstration at which the first of the two is chosen; None where that is at once.

    Returns:
        The smallest comparison of attributes of the two nodes' entities and goals, or its negation; where there is
        none, what a number that no branch changes has to do with it, or which of two distances is shorter when the
        branch is chosen. Fail where nothing explains it, or where there are so few demonstrations that something would
        by accident.

    Source: Sec. 4.5.
    """
    mine, theirs = (evidence.first_steps(node.lifted(evidence.types)) for node in (one, other))
    both = finish_both(mine, theirs)
    first, starts = (mine < theirs)[both], evidence.states[evidence.starts][both]
    names = (*one.entities, *other.entities)
    tests = sorted(_cross_comparisons(evidence, names), key=lambda p: (size(p), str(p)))
    if _bits(first, 0) < log2(max(1, 2 * len(tests))):
        return Fail(f"too few demonstrations to tell why {one.name} sometimes comes before {other.name}")
    unexplained = Fail(f"no comparison of attributes explains why {one.name} sometimes comes before {other.name}")
    return (
        _telling_comparison(tests, starts, first, evidence.layout)
        or _telling_reading(evidence, starts, first)
        or _shorter_distance(evidence, one, other, first, _at_choice(evidence, chosen)[both])
        or unexplained
    )


def finish_both(one: IntArray, other: IntArray) -> BoolArray:
    """Tell which demonstrations (D,) finish two branches, given the steps at which they do."""
    return (one < NEVER) & (other < NEVER)


def _bits(first: BoolArray, wrong: int) -> float:
    """Return what a rule with so many exceptions says about which demonstrations are `first` (D,), in bits.

    Where hardly any is, little remains to be said, and some number always lies far off in one of them.
    """
    count = len(first)
    untold = min(float(count), log2((count + 1) * comb(count, int(first.sum()))))
    return untold - log2((wrong + 1) * comb(count, wrong))


def _tells(answer: BoolArray, first: BoolArray, choices: float) -> bool:
    """Whether an answer (D,) agrees with `first` (D,), and says more than it takes to choose among so many."""
    wrong = int((answer != first).sum())
    return wrong <= (1.0 - AGREEMENT) * len(first) and _bits(first, wrong) >= log2(choices)


def _telling_comparison(
    tests: Sequence[Predicate], states: FloatArray, first: BoolArray, layout: Layout, accidents: float = 1.0
) -> Predicate | None:
    """Find the first of the tests, or its negation, that holds in states (D, F) where `first` (D,); None where none."""
    for test in tests:
        truth = holds(test, states, {}, layout)
        for predicate, answer in ((test, truth), (Not(test), ~truth)):
            if _tells(answer, first, 2 * len(tests) / accidents):
                return predicate
    return None


def _telling_reading(evidence: Evidence, starts: FloatArray, first: BoolArray) -> Predicate | None:
    """Find a number on whose side of a threshold in `starts` (D, F) `first` (D,) depends; None where there is none."""
    layout = evidence.layout
    readings = list(_lasting_readings(evidence))
    for term in readings:
        values = evaluate(term, starts, {}, layout)[..., 0]
        levels = np.unique(values)
        below = values < ((levels[1:] + levels[:-1]) / 2)[:, None]
        for side, answers in ((Less, below), (Greater, ~below)):
            wrong = (answers != first).sum(axis=1)
            best = np.flatnonzero(wrong == wrong.min(initial=len(first)))
            if len(best) and _tells(answers[best[0]], first, 2 * len(readings) * len(below)):
                widest = best[np.argmax(np.diff(levels)[best])]
                return side(term, Const(_rounded(float(levels[widest]), float(levels[widest + 1]))))
    return None


def _at_choice(evidence: Evidence, chosen: IntArray | None) -> FloatArray:
    """Return the states (D, F) in which the first of two branches is chosen, see `order_condition`."""
    last = np.array([len(shown) - 1 for shown in evidence.trajectories])
    states: FloatArray = evidence.states[evidence.starts + (0 if chosen is None else np.minimum(chosen, last))]
    return states


def _shorter_distance(
    evidence: Evidence, one: Node, other: Node, first: BoolArray, states: FloatArray
) -> Predicate | None:
    """Find which distance is shorter in `states` (D, F) where `first` (D,); None where none tells."""
    if len(one.entities) != 1 or len(other.entities) != 1:
        return None
    tests = list(_distance_comparisons(evidence, one.entities[0], other.entities[0]))
    return _telling_comparison(tests, states, first, evidence.layout, BY_ACCIDENT)


def _distance_comparisons(evidence: Evidence, one: str, two: str) -> Iterator[Less]:
    """One entity is nearer than the other to the robot, to its own goal, or to a third one without like."""
    layout = evidence.layout
    first, second = (layout.types[evidence.types[name]] for name in (one, two))
    if max(len(layout.of_type(first.name)), len(layout.of_type(second.name))) > 1:
        return
    kinds = ((one, first), (two, second))
    for mark, its in (m for m in landmarks(layout, evidence.types) if m[0] not in (Var(one), Var(two))):
        nearer = [list(differences(mark, its, Var(name), kind)) for name, kind in kinds]
        yield from (Less(Norm(a), Norm(b)) for a, b in product(*nearer) if a.left == b.left)
    own = [list(differences(Var(name), kind, Goal(Var(name)), kind)) for name, kind in kinds]
    yield from (Less(Norm(a), Norm(b)) for a, b in product(*own) if a.left == rename(b.left, {two: one}))


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
