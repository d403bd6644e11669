"""Loops over some of the entities of a type."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import walk
from roboscribe.dsl.syntax import Const, Less, Truth
from roboscribe.search.candidates import Candidate
from roboscribe.search.features import enumerate_features
from roboscribe.search.loop_entities import Pairs, _growing, middle
from roboscribe.search.recurring import recurring_candidates
from roboscribe.world.layout import FloatArray, Layout
from roboscribe.world.trajectory import AGREEMENT
from tests.search.examples import LAYOUT as ONE

THREE = Layout(ONE.robot, ONE.entities * 3)
DEMONSTRATIONS, LENGTH = 20, 40
P, S = (tuple(THREE.columns[i, name, False].start for i in range(3)) for name in ("p", "s"))


def found(red: list[list[bool]], served: list[list[bool]], noise: float = 0.0) -> dict[str, Candidate]:
    """Find what recurs with p where `served` says which blocks are brought to it, and s says which are red."""
    rng = np.random.default_rng(3)
    states = rng.uniform(0.5, 1.0, (DEMONSTRATIONS, LENGTH, THREE.size))
    for d in range(DEMONSTRATIONS):
        for i in range(3):
            states[d, :, S[i]] = (0.9 if red[d % len(red)][i] else 0.1) + rng.uniform(-noise, noise)
            if served[d % len(served)][i]:
                states[d, 8 * (i + 1) :, P[i]] = rng.uniform(0.0, 0.02)
    negatives = rng.uniform(0.5, 1.0, (500, THREE.size))
    negatives[:, S] = rng.choice([0.1, 0.9], (500, 3))
    starts = np.arange(DEMONSTRATIONS) * LENGTH
    pairs = Pairs(THREE, "b1", (0, 1, 2), states.reshape(-1, THREE.size), starts, negatives, {Truth(): {}})
    candidates = recurring_candidates(enumerate_features(THREE, ["b1"]), pairs)
    return {str(c.only): c for c in candidates if str(c.predicate).startswith("b1↓p <")}


RED = [[True, True, False], [False, True, True], [True, False, False]]


def test_a_loop_may_be_about_the_red_ones() -> None:
    (loop,) = found(RED, RED).values()
    assert loop.only == parse_predicate("b1↓s > 0.5")
    assert loop.possible
    assert loop.each


def test_kinds_are_parted_in_the_gap_between_them() -> None:
    """Of sixty numbers, all different, evenly spread cuts would part some reds from the others."""
    loop = next(iter(found(RED, RED, noise=0.09).values()))
    (cut,) = [n.value for n in walk(loop.only) if isinstance(n, Const)]
    assert 0.25 < cut < 0.75


def test_where_all_are_served_a_loop_is_about_all() -> None:
    assert set(found(RED, [[True] * 3])) == {"true"}


def test_what_others_are_served_by_lot_tells_nothing() -> None:
    by_lot = np.random.default_rng(0).random((DEMONSTRATIONS, 3)) < 0.5
    assert not found(RED, by_lot.tolist())


def told_apart(levels: FloatArray, ends: FloatArray) -> dict[str, Candidate]:
    """Find what recurs with p where s of each block (D, N) decides where p of it ends (D, N), one after the other."""
    rng = np.random.default_rng(3)
    count = levels.shape[1]
    layout = Layout(ONE.robot, ONE.entities * count)
    p, s = (tuple(layout.columns[i, name, False].start for i in range(count)) for name in ("p", "s"))
    states = rng.uniform(0.0, 1.0, (len(levels), LENGTH, layout.size))
    states[..., s], states[..., p] = levels[:, None], 1.0
    for i in range(count):
        states[:, 8 * (i + 1) :, p[i]] = ends[:, i, None] + rng.uniform(0.0, 0.02, (len(levels), 1))
    negatives = rng.uniform(0.5, 1.0, (500, layout.size))
    negatives[:, s] = rng.choice(np.unique(levels), (500, count))
    starts = np.arange(len(levels)) * LENGTH
    pairs = Pairs(layout, "b1", tuple(range(count)), states.reshape(-1, layout.size), starts, negatives, {Truth(): {}})
    candidates = recurring_candidates(enumerate_features(layout, ["b1"]), pairs)
    return {str(c.only): c for c in candidates if str(c.predicate).startswith("b1↓p <")}


LEVELS = np.random.default_rng(1).choice([0.1, 0.5, 0.9], (DEMONSTRATIONS, 3))


def test_a_loop_may_be_about_those_between_two_bounds() -> None:
    (loop,) = told_apart(LEVELS, np.where(LEVELS == 0.5, 0.0, 0.98)).values()
    assert loop.only == parse_predicate("b1↓s > 0.3 ∧ b1↓s < 0.7")
    assert loop.possible


def test_of_three_places_in_a_row_the_first_is_for_one_kind_not_for_two() -> None:
    assert set(told_apart(LEVELS, LEVELS)) - {"true"} == {"b1↓s < 0.3"}


def test_what_hardly_any_demonstration_does_with_one_of_several_is_no_loop() -> None:
    levels = np.random.default_rng(1).choice([0.1, 0.5], (40, 3))
    for shown, loops in ((30, 1), (4, 0)):
        some = levels.copy()
        some[:shown, 0] = 0.9
        told = told_apart(some, np.where(some > 0.7, 0.0, 0.98))
        assert len(set(told) - {"true"}) == loops


def test_what_is_done_to_a_single_entity_may_depend_on_it() -> None:
    alone = LEVELS[:, :1]
    (loop,) = told_apart(alone, np.where(alone > 0.3, 0.0, 0.98)).values()
    assert loop.only == parse_predicate("b1↓s > 0.3")
    assert loop.possible
    assert (loop.accepted, loop.initial) == (0.0, 0.0), "where it is not meant it neither fails nor is done"


def test_what_is_always_done_to_a_single_entity_is_no_loop() -> None:
    assert not told_apart(LEVELS[:, :1], np.zeros((DEMONSTRATIONS, 1)))


def test_both_sides_of_the_number_that_tells_entities_apart_end_at_the_same_threshold() -> None:
    """Of sixty numbers, all different, wide gaps and evenly spread thresholds may miss the one that matters."""
    rng = np.random.default_rng(7)
    levels = rng.uniform(0.0, 1.0, (60, 1))
    near, far = rng.uniform(0.0, 0.1, levels.shape), rng.uniform(0.9, 1.0, levels.shape)
    (below,) = told_apart(levels, np.where(levels < 0.5, near, far)).values()
    (above,) = told_apart(levels, np.where(levels > 0.5, near, far)).values()
    cuts = [[n.value for n in walk(c.only) if isinstance(n, Const)] for c in (below, above)]
    assert cuts[0] == cuts[1]
    assert ((levels < cuts[0]) == (levels < 0.5)).all()


def test_a_kind_is_told_by_every_threshold_even_where_few_lie_near_its_own() -> None:
    """One block in the gap: the threshold beside it parts all, wider gaps elsewhere part most."""
    rng = np.random.default_rng(3)
    levels = np.where(rng.random((40, 3)) < 0.5, rng.uniform(0.0, 0.3, (40, 3)), rng.uniform(0.7, 1.0, (40, 3)))
    levels[0, 0] = 0.501
    loop = next(c for c in told_apart(levels, np.where(levels > 0.5, 0.0, 0.98)).values() if c.only != Truth())
    (cut,) = [n.value for n in walk(loop.only) if isinstance(n, Const)]
    assert ((levels > cut) == (levels > 0.5)).all()


def test_two_bounds_are_better_than_one_that_parts_all_but_a_few() -> None:
    levels = np.random.default_rng(5).choice([0.1, 0.5, 0.9], (DEMONSTRATIONS, 3), p=[0.45, 0.5, 0.05])
    assert (levels == 0.9).any()
    (loop,) = told_apart(levels, np.where(levels == 0.5, 0.0, 0.98)).values()
    assert loop.only == parse_predicate("b1↓s > 0.3 ∧ b1↓s < 0.7")


def lit_and_served(blocks: int, against: float = 0.0) -> dict[str, Candidate]:
    """Find what recurs with p where a lamp's s decides whether p of each block ends low.

    Args:
        blocks: how many there are.
        against: spread of s of block and lamp alike, of which the difference decides; 0 where the lamp's does.
    """
    rng = np.random.default_rng(3)
    lamp = replace(ONE.entities[0], name="lamp")
    layout = Layout(ONE.robot, (*ONE.entities * blocks, lamp))
    p, s = (tuple(layout.columns[i, name, False].start for i in range(blocks + 1)) for name in ("p", "s"))
    states = rng.uniform(0.5, 1.0, (DEMONSTRATIONS, LENGTH, layout.size))
    lit = rng.random(DEMONSTRATIONS) < 0.5
    states[..., s[-1]] = np.where(lit, 0.9, 0.1)[:, None]
    if against:
        states[..., s[0]] = rng.uniform(0.0, against, DEMONSTRATIONS)[:, None]
        states[..., s[-1]] = states[..., s[0]] + np.where(lit, 0.2, -0.2)[:, None]
    for i in range(blocks):
        states[:, 8 * (i + 1) :, p[i]] = np.where(lit, 0.0, 0.98)[:, None] + rng.uniform(0.0, 0.02, (DEMONSTRATIONS, 1))
    negatives = rng.uniform(0.5, 1.0, (500, layout.size))
    negatives[:, s] = rng.choice([0.1, 0.9], (500, blocks + 1))
    starts = np.arange(DEMONSTRATIONS) * LENGTH
    members = tuple(range(blocks))
    pairs = Pairs(layout, "b1", members, states.reshape(-1, layout.size), starts, negatives, {Truth(): {}})
    candidates = recurring_candidates(enumerate_features(layout, ["b1", "l1"]), pairs)
    return {str(c.only): c for c in candidates if str(c.predicate).startswith("b1↓p <") and c.only != Truth()}


def test_what_is_done_to_a_single_entity_may_depend_on_another_thing_without_like() -> None:
    (loop,) = lit_and_served(1).values()
    assert loop.only == parse_predicate("l1↓s > 0.5")
    assert loop.possible


def test_a_thing_without_like_does_not_tell_which_of_several_entities_are_meant() -> None:
    assert not lit_and_served(2)


@pytest.mark.parametrize(("low", "high", "expected"), [(1.0, 3.0, 2.0), (0.1, 0.2, 0.15), (0.12345, 0.12347, 0.12346)])
def test_a_threshold_lies_between_two_numbers_with_few_digits(low: float, high: float, expected: float) -> None:
    assert middle(low, high) == expected


def test_quantiles_are_those_of_numpy() -> None:
    ends = np.random.default_rng(0).normal(size=30)
    for count, found in enumerate(_growing(ends), start=1):
        np.testing.assert_allclose(found, np.quantile(ends[:count], [0.0, 1.0 - AGREEMENT, AGREEMENT, 1.0]), rtol=1e-12)


def test_between_adjacent_numbers_there_is_no_threshold() -> None:
    levels = np.tile([0.3, np.nextafter(0.3, 1.0), 0.7], (DEMONSTRATIONS, 1))
    told = told_apart(levels, np.where(levels < 0.5, 0.0, 0.98))
    assert set(told) - {"true"} == {"b1↓s < 0.5"}
    told = told_apart(levels[:, :2], np.where(levels[:, :2] == 0.3, 0.0, 0.98))
    assert set(told) - {"true"} == {"∃b':block. b1↓s < b'↓s"}, "which of the two is less can be said"


def test_a_loop_may_be_about_the_greatest_or_all_but_the_greatest() -> None:
    """No threshold parts numbers that lie anywhere."""
    levels = np.random.default_rng(2).random((DEMONSTRATIONS, 3))
    greatest = levels == levels.max(axis=1, keepdims=True)
    told = told_apart(levels, np.where(greatest, 0.0, 0.98))
    assert set(told) - {"true"} == {"¬∃b':block. b1↓s < b'↓s"}
    told = told_apart(levels, np.where(greatest, 0.98, 0.0))
    assert set(told) - {"true"} == {"∃b':block. b1↓s < b'↓s"}


def test_what_is_done_to_a_single_entity_may_depend_on_how_it_compares_with_another_thing() -> None:
    (loop,) = lit_and_served(1, against=0.9).values()
    assert isinstance(loop.only, Less)
    assert str(loop.only.left) == "b1↓s − l1↓s"
    assert loop.possible


def test_where_all_are_alike_none_is_the_greatest() -> None:
    levels = np.repeat(np.random.default_rng(2).random((DEMONSTRATIONS, 1)), 3, axis=1)
    ends = np.where(np.arange(3) == 0, 0.0, 0.98) * np.ones((DEMONSTRATIONS, 1))
    assert not set(told_apart(levels, ends)) - {"true"}
