"""How long a predicate is."""

from __future__ import annotations

import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.search.length import length


@pytest.mark.parametrize(
    ("against_goal", "alone"),
    [
        ("‖d1↓extension − g(d1)↓extension‖ < 0.02", "d1↓extension > 0.08"),
        ("‖b1↓xyz − g(b1)↓xyz‖ < 0.05", "b1↓z > 0.4"),
        ("¬(‖b1↓xyz − g(b1)↓xyz‖ < 0.05)", "¬(b1↓z > 0.4)"),
    ],
)
def test_both_sides_of_a_goal_are_no_longer_than_one_side_of_a_number(against_goal: str, alone: str) -> None:
    assert length(parse_predicate(against_goal)) == length(parse_predicate(alone))


@pytest.mark.parametrize(
    ("another", "own"),
    [
        ("‖b1↓xyz − g(b2)↓xyz‖ < 0.05", "‖b1↓xyz − g(b1)↓xyz‖ < 0.05"),
        ("‖μ↓xyz − g(b1)↓xyz‖ < 0.05", "‖b1↓xyz − g(b1)↓xyz‖ < 0.05"),
    ],
)
def test_what_is_not_its_own_goal_has_to_be_said(another: str, own: str) -> None:
    assert length(parse_predicate(another)) > length(parse_predicate(own))
