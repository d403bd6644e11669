"""Loops over some of the entities of a type."""

from __future__ import annotations

import numpy as np

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import walk
from roboscribe.dsl.syntax import Const, Truth
from roboscribe.search.candidates import Candidate
from roboscribe.search.features import enumerate_features
from roboscribe.search.loop_entities import Pairs
from roboscribe.search.recurring import recurring_candidates
from roboscribe.world.layout import Layout
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
