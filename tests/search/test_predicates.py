"""The exact search over one and two atoms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import conjuncts, walk
from roboscribe.dsl.syntax import And, Const, Proj
from roboscribe.search.candidates import Anchor
from roboscribe.search.predicates import Candidate, rank_predicates
from tests.search.examples import FEATURES, GAUGES, planted, random_states, samples, truth_of


def gauges(candidate: Candidate) -> set[str]:
    """Which numbers a candidate looks at."""
    return {n.field for n in walk(candidate.predicate) if isinstance(n, Proj)}


@pytest.mark.parametrize("text", ["b1↓p < 0.1", "b1↓s > 0.92"])
def test_a_planted_threshold_is_found(text: str) -> None:
    positives, negatives = planted(parse_predicate(text), np.random.default_rng(0))
    best = rank_predicates(FEATURES, samples(positives, negatives))[0]
    assert type(best.predicate) is type(parse_predicate(text))
    assert gauges(best) == {text[3]}
    assert best.accepted == 0.0
    (const,) = [n.value for n in walk(best.predicate) if isinstance(n, Const)]
    assert const == pytest.approx(float(text[-4:]), abs=0.01)


def test_a_threshold_lies_beyond_every_positive_and_has_few_digits() -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.1"), np.random.default_rng(1))
    for candidate in rank_predicates(FEATURES, samples(positives, negatives)):
        assert truth_of(candidate.predicate, positives).all()
        for number in (n.value for n in walk(candidate.predicate) if isinstance(n, Const)):
            assert number == float(f"{number:.6g}")


@pytest.mark.parametrize(("one", "other"), [("p", "q"), ("q", "s"), ("r", "p")])
def test_a_planted_conjunction_is_found_where_no_atom_separates(one: str, other: str) -> None:
    truth = parse_predicate(f"b1↓{one} < 0.3 ∧ b1↓{other} > 0.7")
    positives, negatives = planted(truth, np.random.default_rng(2))
    best = rank_predicates(FEATURES, samples(positives, negatives))[0]
    assert len(conjuncts(best.predicate)) == 2
    assert gauges(best) == {one, other}
    fresh = random_states(np.random.default_rng(3), 2000)
    assert np.mean(truth_of(best.predicate, fresh) != truth_of(truth, fresh)) < 0.01


def test_the_table_is_ranked() -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.3 ∧ b1↓q < 0.6"), np.random.default_rng(4))
    ranks = [c.rank for c in rank_predicates(FEATURES, samples(positives, negatives))]
    assert ranks == sorted(ranks)
    assert len(ranks) > 1


def test_nothing_is_offered_where_nothing_differs() -> None:
    states = np.full((50, 5), 0.5)
    assert rank_predicates(FEATURES, samples(states, states[:10], episodes=(states,))) == ()


def two_stages(rng: np.random.Generator, *, accidents: bool) -> tuple[np.ndarray, ...]:
    """Draw demonstrations in which first p < 0.1 comes true and stays so, then q < 0.1.

    By accident q < 0.1 holds in some frame before p < 0.1 does.
    """
    episodes = []
    for _ in range(20):
        states = rng.uniform(0.2, 1.0, (30, 5))
        states[10:, 1] = rng.uniform(0.0, 0.1, 20)
        states[20:, 2] = rng.uniform(0.0, 0.1, 10)
        if accidents:
            states[4, 2] = 0.05
        episodes.append(states)
    return tuple(episodes)


@pytest.mark.parametrize("accidents", [False, True])
def test_a_step_after_a_predecessor_asks_for_the_predecessor_too(accidents: bool) -> None:
    rng = np.random.default_rng(5)
    episodes = two_stages(rng, accidents=accidents)
    positives = np.stack([e[-1] for e in episodes])
    failures = rng.uniform(0.2, 1.0, (500, 5))
    failures[:, 1] = rng.uniform(0.0, 0.1, 500)
    first = parse_predicate("b1↓p < 0.11")
    given = samples(
        positives,
        failures,
        after={frozenset(["b1"]): np.full(20, 10)},
        anchors=(Anchor(first, {"b1↓p": 0.3}),),
        episodes=episodes,
    )
    best = rank_predicates(FEATURES, given)[0]
    assert isinstance(best.predicate, And)
    assert best.predicate.left == first
    assert gauges(best) == {"p", "q"}
    assert best.advances
    assert dict(best.scales)["b1↓p"] == 0.3
    assert set(dict(best.scales)) == {"b1↓p", "b1↓q"}


def test_an_accident_before_the_predecessor_is_no_advance_for_the_atom_alone() -> None:
    rng = np.random.default_rng(6)
    episodes = two_stages(rng, accidents=True)
    positives, failures = np.stack([e[-1] for e in episodes]), rng.uniform(0.2, 1.0, (500, 5))
    given = samples(positives, failures, after={frozenset(["b1"]): np.full(20, 10)}, episodes=episodes)
    alone = next(c for c in rank_predicates(FEATURES, given) if gauges(c) == {"q"} and c.accepted == 0.0)
    assert not alone.advances


def test_a_weaker_copy_of_the_goal_explains_nothing() -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.1"), np.random.default_rng(7))
    copied = next(f.family for f in FEATURES if str(f.term) == "b1↓p")
    given = replace(samples(positives, negatives), goal_families=frozenset([copied]))
    for candidate in rank_predicates(FEATURES, given):
        if gauges(candidate) == {"p"}:
            assert candidate.copy
            assert not candidate.explains
    assert set(GAUGES) > {"p"}
