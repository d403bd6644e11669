"""The exact search over one and two atoms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import conjuncts, walk
from roboscribe.dsl.syntax import And, Const, Norm, Proj, Var
from roboscribe.search.candidates import Anchor, is_copy
from roboscribe.search.features import Feature
from roboscribe.search.predicates import Candidate, rank_predicates
from roboscribe.search.thresholds import bound, far_side, too_fine, usual_range
from tests.search.examples import FEATURES, GAUGES, LAYOUT, planted, random_states, samples, truth_of


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


@pytest.mark.parametrize("afterwards", [True, False])
def test_what_holds_in_most_failures_is_half_of_a_pair_where_it_is_about_leaving(afterwards: bool) -> None:
    """Whoever stands at one of two things is far from the other: 69 % of these failures have b1↓p < 0.9."""
    positives, negatives = planted(parse_predicate("b1↓p < 0.9 ∧ b1↓q < 0.75"), np.random.default_rng(0))
    table = rank_predicates(FEATURES, replace(samples(positives, negatives), afterwards=afterwards))
    assert any(gauges(candidate) == {"p", "q"} for candidate in table) == afterwards


def test_the_table_is_ranked() -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.3 ∧ b1↓q < 0.6"), np.random.default_rng(4))
    ranks = [c.rank for c in rank_predicates(FEATURES, samples(positives, negatives))]
    assert ranks == sorted(ranks)
    assert len(ranks) > 1


def test_nothing_is_offered_where_nothing_differs() -> None:
    states = np.full((50, 5), 0.5)
    assert rank_predicates(FEATURES, samples(states, states[:10], episodes=(states,))) == ()


P, OPENING, Q = 1, 0, 2
"""Columns of the states."""


def two_stages(rng: np.random.Generator, column: int, accidents: int = 0) -> tuple[NDArray[Any], ...]:
    """Draw 20 demonstrations in which first p < 0.1 comes true and stays so, then the number in `column` < 0.1.

    In the first `accidents` of them the latter holds in a frame before p < 0.1 does, too.
    """
    episodes = []
    for i in range(20):
        states = rng.uniform(0.2, 1.0, (30, 5))
        states[10:, P] = rng.uniform(0.0, 0.1, 20)
        states[20:, column] = rng.uniform(0.0, 0.1, 10)
        if i < accidents:
            states[4, column] = 0.05
        episodes.append(states)
    return tuple(episodes)


FIRST = parse_predicate("b1↓p < 0.11")


def after_p(column: int, accidents: int = 0) -> tuple[Candidate, ...]:
    """Rank what failures lack that reach p < 0.1 and nothing else."""
    rng = np.random.default_rng(5)
    episodes = two_stages(rng, column, accidents)
    failures = rng.uniform(0.2, 1.0, (500, 5))
    failures[:, P] = rng.uniform(0.0, 0.1, 500)
    given = samples(
        np.stack([e[-1] for e in episodes]),
        failures,
        steps={frozenset(["b1"]): (np.full(20, 10),)},
        anchors=(Anchor(FIRST, {"b1↓p": 0.3}),),
        episodes=episodes,
    )
    return rank_predicates(FEATURES, given)


def test_what_comes_about_in_the_world_after_a_predecessor_is_a_step_of_its_own() -> None:
    best = after_p(Q)[0]
    assert gauges(best) == {"q"}
    assert best.advances


def test_what_others_undo_is_asked_for_in_addition_to_the_predecessor() -> None:
    best = after_p(Q, accidents=20)[0]
    assert isinstance(best.predicate, And)
    assert best.predicate.left == FIRST
    assert gauges(best) == {"p", "q"}
    assert best.advances
    assert dict(best.scales)["b1↓p"] == 0.3
    assert set(dict(best.scales)) == {"b1↓p", "b1↓q"}


def test_an_accident_before_the_predecessor_is_no_advance_for_the_atom_alone() -> None:
    alone = next(c for c in after_p(Q, accidents=10) if gauges(c) == {"q"})
    assert not alone.advances
    assert gauges(after_p(Q, accidents=10)[0]) == {"p", "q"}


def test_a_weaker_copy_of_the_goal_explains_nothing() -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.1"), np.random.default_rng(7))
    copied = next(f.family for f in FEATURES if str(f.term) == "b1↓p")
    given = replace(samples(positives, negatives), known={copied: 1})
    for candidate in rank_predicates(FEATURES, given):
        if gauges(candidate) == {"p"}:
            assert candidate.copy
            assert not candidate.explains
    assert set(GAUGES) > {"p"}


def test_what_looks_at_more_numbers_is_no_copy() -> None:
    wide = Feature(Norm(Proj(Var("b1"), "p")), family="b1.p", detail=3)
    assert is_copy(replace(wide, detail=1), {"b1.p": 1})
    assert is_copy(wide, {"b1.p": 3})
    assert not is_copy(wide, {"b1.p": 1})


@pytest.mark.parametrize("sharp_before", [False, True])
def test_a_threshold_is_measured_where_it_is_sharper(sharp_before: bool) -> None:
    """What is passed on the way to the goal shows right before it, what the goal asks for shows in it."""
    rng = np.random.default_rng(8)
    negatives = random_states(rng, 2000)
    loose, sharp = random_states(rng, 100), random_states(rng, 100)
    loose[:, P], sharp[:, P] = rng.uniform(0.3, 0.5, 100), rng.uniform(0.0, 0.05, 100)
    before, reached = (sharp, loose) if sharp_before else (loose, sharp)
    episodes = tuple(np.vstack([negatives[20 * i : 20 * i + 10], loose[i], sharp[i]]) for i in range(20))
    best = rank_predicates(FEATURES, samples(before, negatives, reached=reached, episodes=episodes))[0]
    (const,) = [n.value for n in walk(best.predicate) if isinstance(n, Const)]
    assert gauges(best) == {"p"}
    assert 0.05 <= const < 0.07


def test_a_threshold_leaves_room_for_what_was_not_seen_but_not_for_failures() -> None:
    seen = np.linspace(0.0, 1.0, 20)
    assert bound(seen, np.full(100, 10.0), 1.0, 10.0) == (1.25, 9.0)
    few = np.linspace(0.0, 1.0, 4)
    assert bound(few, np.full(100, 10.0), 1.0, 10.0) == (2.72, 9.0), "with four samples 0.05 to the power of -1/3"
    close = np.full(100, 1.1)
    threshold, gap = bound(seen, close, 1.0, 10.0)
    assert gap == pytest.approx(0.1)
    assert threshold == pytest.approx(1.05), "half-way to the next failure"


def test_what_a_few_reach_beyond_what_is_needed_says_nothing_about_the_threshold() -> None:
    usual = np.linspace(-0.02, 0.03, 50)
    beyond = np.append(usual[2:], [-0.9, -1.0])
    failures = np.full(100, 0.08)
    assert bound(beyond, failures, 0.05, 0.1) == pytest.approx(bound(usual, failures, 0.05, 0.1), abs=1e-3)
    spread_out = np.linspace(-1.0, 0.03, 50)
    assert far_side(spread_out) == -1.0, "all that differ much are no exceptions"


def test_lengths_are_measured_from_zero() -> None:
    """A mug 5 to 11 cm from its place, brought to within 5 cm: in three dimensions that is a tenth of the space."""
    away = np.linspace(0.05, 0.11, 200)
    assert usual_range(away) == pytest.approx(0.054, abs=1e-3)
    assert usual_range(away, numbers=3) == pytest.approx(0.107, abs=1e-3)


def test_a_threshold_lies_short_of_a_stop() -> None:
    stopped = np.full(20, -0.18) + np.linspace(0.0, 1e-5, 20)
    threshold, _ = bound(stopped, np.linspace(-0.1, 0.0, 100), 0.03, 0.16)
    assert threshold == pytest.approx(-0.17, abs=2e-3), "a sixteenth of the way before it"
    near, _ = bound(stopped, np.linspace(-0.178, 0.0, 100), 0.03, 0.16)
    assert -0.18 < near <= -0.178, "not where failures are"


@pytest.mark.parametrize("last", [0.05, 0.75])
def test_what_stands_at_its_threshold_when_the_goal_is_reached_says_as_much_as_where_it_is_left(last: float) -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.7"), np.random.default_rng(5))
    lasts = positives.copy()
    lasts[:, LAYOUT.columns[0, "p", False]] = last  # beyond the threshold it is undone and says nothing
    table = rank_predicates(FEATURES, samples(positives, negatives, lasts=lasts))
    (found,) = [c for c in table if gauges(c) == {"p"}]
    assert found.possible == (last < 0.7)


@pytest.mark.parametrize(("accidents", "left_out"), [(1, True), (2, True), (3, False)])
def test_a_threshold_leaves_out_what_a_twentieth_did_by_accident(accidents: int, left_out: bool) -> None:
    """Of forty that were served, few are brushed far aside again."""
    pos = np.concatenate([np.linspace(0.0, 0.01, 40 - accidents), np.full(accidents, 0.12)])
    threshold, _ = bound(pos, np.linspace(0.3, 1.0, 100), 0.3, 1.0)
    assert (threshold < 0.05) == left_out


def test_a_tail_is_no_accident() -> None:
    pos = np.random.default_rng(0).exponential(0.01, 40)
    threshold, _ = bound(pos, np.linspace(0.3, 1.0, 100), 0.3, 1.0)
    assert threshold > pos.max()


def touching(before: float) -> tuple[Candidate, ...]:
    """Rank what leads to a subgoal that comes about as soon as p falls below 0.1, from `before` in one step."""
    rng = np.random.default_rng(9)
    ways = [np.append(np.linspace(1.0, before * (1 + 0.2 * rng.random()), 10), 0.02) for _ in range(20)]
    episodes = []
    for way in ways:
        states = np.full((11, 5), 0.5)
        states[:, P] = way
        episodes.append(states)
    failures = np.full((500, 5), 0.5)
    failures[:, P] = rng.uniform(0.5, 1.0, 500)
    before_it, reached = (np.stack([e[i] for e in episodes]) for i in (-2, -1))
    given = samples(before_it, failures, reached=reached, episodes=tuple(episodes))
    return rank_predicates(FEATURES, replace(given, root=False))


def test_what_comes_to_hold_with_its_goal_is_offered_as_it_is_right_before() -> None:
    best = touching(0.2)[0]
    assert best.explains
    assert gauges(best) == {"p"}
    (threshold,) = [n.value for n in walk(best.predicate) if isinstance(n, Const)]
    assert 0.2 < threshold < 0.5


def test_of_two_atoms_neither_follows_from_the_other() -> None:
    rng = np.random.default_rng(11)
    positives, negatives = (random_states(rng, n) for n in (200, 2000))
    positives[:, [1, 2, 3]] = rng.uniform(0.0, 0.3, (200, 3))
    for states in (positives, negatives):
        states[:, 2] = states[:, 1] / 2  # q says what p says
    pairs = [c for c in rank_predicates(FEATURES, samples(positives, negatives)) if len(conjuncts(c.predicate)) == 2]
    assert pairs
    assert all(gauges(c) != {"p", "q"} for c in pairs)


def test_a_loop_over_one_number_is_offered_with_one_side_bounded_and_with_both() -> None:
    positives, negatives = planted(parse_predicate("b1↓p < 0.1"), np.random.default_rng(12))
    whole = Feature(Norm(Proj(Var("b1"), "p")), family="b1.p")
    one = next(c for c in rank_predicates(FEATURES, samples(positives, negatives)) if gauges(c) == {"p"})
    loops = [replace(one, each=True), replace(one, each=True, predicate=whole.below(0.1))]
    table = rank_predicates((*FEATURES, whole), samples(positives, negatives), loops)
    assert {c.predicate for c in table if c.each} == {c.predicate for c in loops}


@pytest.mark.parametrize(
    ("unit", "width", "fine"),
    [
        ("rad", 0.01, True),
        ("rad", 0.1, False),
        ("deg", 1.0, True),
        ("m", 1e-4, True),
        ("mm", 5.0, False),
        ("N", 1e-4, False),
    ],
)
def test_what_varies_by_less_than_robots_are_precise_is_no_subgoal(unit: str, width: float, fine: bool) -> None:
    reading = Feature(Proj(Var("b1"), "x"), unit=unit)
    positives, negatives = np.full(9, width), np.zeros(9)
    assert too_fine(reading, 0.5 * width, positives, negatives) is fine
    assert not too_fine(reading, 1000.0, positives, negatives), "what is usual decides as well"
