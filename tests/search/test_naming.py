"""Names for people."""

from __future__ import annotations

import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.search.naming import name_predicate

HOLD = "‖μ↓xyz − b1↓xyz‖ < 0.02"
ALIGN = "‖arctan2(μ↓xy − b1↓xy) − arctan2(g(b1)↓xy − b1↓xy)‖ > 2.8"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (HOLD, "hold"),
        ("‖b1↓xyz − g(b1)↓xyz‖ < 0.05", "at"),
        ("‖μ↓xyz − g(b1)↓xyz‖ < 0.05", "reach"),
        (ALIGN, "align"),
        (f"{HOLD} ∧ {ALIGN}", "align"),
        ("¬∃b':block. ‖μ↓xyz − g(b')↓xyz‖ < 0.1", "leave"),
        ("d1↓opening > 0.1", "open"),
        ("b1↓z > 0.4", "phi"),
        ("‖b1↓xyz − b2↓xyz‖ < 0.1", "phi"),
    ],
)
def test_a_predicate_is_named_by_its_shape(text: str, name: str) -> None:
    assert name_predicate(parse_predicate(text), set()) == name


def test_taken_names_are_numbered() -> None:
    predicate = parse_predicate(HOLD)
    assert name_predicate(predicate, {"hold"}) == "hold2"
    assert name_predicate(predicate, {"hold", "hold2", "hold3"}) == "hold4"
