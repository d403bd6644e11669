"""What is remembered of a training, and where the next one begins."""

from __future__ import annotations

from dataclasses import replace

from roboscribe.dsl.parser import parse_program
from roboscribe.grounding import LastTraining
from roboscribe.subtask_tree import ROOT

ONE, OTHER = (parse_program(f"def P(μ : EE): π_hold(μ) until μ↓x < {value}") for value in ("0.1", "0.2"))


def test_the_same_program_takes_another_turn_and_another_one_its_first() -> None:
    first = LastTraining().next("at", ONE)
    assert first.trained_before == 0
    assert [replace(first, trained_before=n, unfinished=True).next("at", ONE).trained_before for n in (0, 1)] == [1, 2]
    assert not replace(first, unfinished=True).next("at", ONE).unfinished
    assert first.next(ROOT, ONE).trained_before == 0
    assert first.next("at", OTHER).trained_before == 0
