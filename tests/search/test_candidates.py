"""The figures that speak for a predicate, and the order of preference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.syntax import Truth
from roboscribe.search.candidates import Anchor, Candidate, Judged, first_true, judge
from tests.search.examples import FEATURES, random_states, samples

BASE = Candidate(
    predicate=Truth(),
    accepted=0.0,
    initial=0.0,
    kept=1.0,
    first=0.5,
    copy=False,
    relevant=True,
    advances=True,
    margin=0.1,
    scales=(),
    entities=1,
    detail=1,
    own_goal=False,
    size=5,
    family="",
)


@pytest.mark.parametrize(
    "worse",
    [
        {"advances": False},
        {"accepted": 0.5},
        {"copy": True},
        {"relevant": False},
        {"kept": 0.3},
        {"entities": 0},
        {"entities": 2},
        {"standing": 1},
        {"initial": 0.2},
        {"accepted": 0.05},
        {"first": 0.8},
        {"size": 9},
        {"detail": 0},
        {"margin": 0.01},
    ],
    ids=str,
)
def test_each_figure_alone_decides_between_equals(worse: dict[str, float]) -> None:
    assert BASE.rank < replace(BASE, **worse).rank


def test_the_order_of_preference_is_lexicographic() -> None:
    late = replace(BASE, first=0.99, size=40, accepted=0.09)
    assert late.rank < replace(BASE, advances=False).rank
    assert late.rank < replace(BASE, standing=1).rank
    assert replace(BASE, standing=2, initial=0.2).rank < replace(BASE, kept=0.4).rank


def test_what_separates_explains_only_if_it_is_a_new_step_about_the_goals_entities() -> None:
    assert BASE.explains
    for change in ({"accepted": 0.21}, {"advances": False}, {"copy": True}, {"relevant": False}):
        assert not replace(BASE, **change).explains


def test_first_true_counts_from_each_episodes_start() -> None:
    truth = np.array([0, 1, 1, 0, 0, 0, 1], dtype=np.bool_)
    starts = np.array([0, 3, 6])
    assert first_true(truth, starts).tolist() == [1, 3, 0]


def test_figures_of_three_demonstrations_by_hand() -> None:
    states = random_states(np.random.default_rng(0), 12)
    given = replace(
        samples(states[:3], states[:4], episodes=(states[:4], states[4:8], states[8:])),
        after={frozenset(["b1"]): np.array([0, 0, 0])},
    )
    on_frames = np.array([0, 1, 1, 1, 0, 0, 1, 0, 1, 1, 1, 1], dtype=np.bool_)
    on_negatives = np.array([1, 0, 0, 0], dtype=np.bool_)
    feature = next(f for f in FEATURES if str(f.term) == "b1↓p")
    found = judge(Judged(parse_predicate("b1↓p < 0.5"), (feature,), on_negatives, on_frames, 0.2, ()), given)
    assert found.accepted == 0.25
    assert found.initial == pytest.approx(1 / 3)
    assert found.kept == pytest.approx((3 + 1 + 4) / (3 + 2 + 4))
    assert found.first == pytest.approx(1 / 3)
    assert not found.advances, "a third begins with it"
    assert found.relevant
    assert found.standing == 0


@pytest.mark.parametrize(("anchor", "own_goal", "standing"), [(True, False, 1), (False, False, 2)])
def test_with_predecessors_an_addition_stands_before_a_newcomer(anchor: bool, own_goal: bool, standing: int) -> None:
    states = random_states(np.random.default_rng(0), 12)
    held = Anchor(parse_predicate("b1↓q < 0.5"), {})
    given = samples(states[:3], states[:4], anchors=(held,), episodes=(states,))
    truth = np.ones(12, dtype=np.bool_)
    feature = next(f for f in FEATURES if str(f.term) == "b1↓p")
    assert feature.own_goal == own_goal
    it = Judged(parse_predicate("b1↓p < 0.5"), (feature,), truth[:4], truth, 0.2, (), held if anchor else None)
    assert judge(it, given).standing == standing
