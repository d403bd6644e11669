"""Which demonstrations a program explains."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.segmentation import explains
from roboscribe.dsl.syntax import Program
from roboscribe.world import Trajectory
from roboscribe.world.layout import BoolArray, FloatArray
from tests.dsl.kinematic import TOWER, blocks

Frame = tuple[float, float, float]
"""Hand and two blocks along x, whose goals are at 0, the second's a little higher."""
FULL: tuple[Frame, ...] = ((0.9, 0.5, 0.8), (0.5, 0.5, 0.8), (0.01, 0.01, 0.8), (0.8, 0.01, 0.8), (0.01, 0.01, 0.01))
"""Reach for the first, hold it, place it; hold the second, place it."""


def demonstration(*frames: Frame) -> Trajectory:
    """Write a demonstration."""
    states = [[hand, 0, 0, 0, a, 0, 0, 0, 0, 0, b, 0, 0, 0, 0, 0.001] for hand, a, b in frames]
    return Trajectory(blocks(2), np.array(states, dtype=np.float64))


def within(distance: float) -> Callable[[FloatArray], BoolArray]:
    """ψ_R: both blocks are so near to their goals."""
    return lambda states: (np.abs(states[..., [4, 10]]) < distance).all(axis=-1)


def explained(program: Program, *frames: Frame, distance: float = 0.05) -> bool:
    """Ask about one demonstration."""
    (answer,) = explains(program, [demonstration(*frames)], within(distance))
    return bool(answer)


def straight(body: str) -> Program:
    """Parse a program."""
    return parse_program(f"def P(μ : EE): {body}")


def test_a_program_that_comes_to_its_end_explains_a_demonstration() -> None:
    assert explained(TOWER, *FULL)
    assert explained(TOWER, *FULL, (0.5, 0.01, 0.01)), "what is shown after success does not matter"


def test_each_demonstration_is_judged_on_its_own_whatever_its_length() -> None:
    shown = [demonstration(*FULL), demonstration(*FULL[:3]), demonstration(*FULL, FULL[-1])]
    assert explains(TOWER, shown, within(0.05)).tolist() == [True, False, True]


def test_a_demonstration_that_stops_before_the_task_is_solved_is_not_explained() -> None:
    assert not explained(TOWER, *FULL[:4])


def test_a_loop_may_end_as_soon_as_the_last_entity_solves_the_task() -> None:
    """The last block is solved at 8 cm, where the demonstration ends; the program asks for 5 cm."""
    last = (0.07, 0.01, 0.07)
    assert explained(TOWER, *FULL[:4], last, distance=0.08)
    assert not explained(TOWER, *FULL[:4], last, distance=0.05)


SHORT: tuple[Frame, ...] = ((0.9, 0.5, 0.8), (0.5, 0.5, 0.8), (0.07, 0.07, 0.8), (0.8, 0.07, 0.8), (0.07, 0.07, 0.07))
"""Both blocks are left 7 cm from their goals."""


def test_what_two_entities_of_a_loop_lack_is_not_left_to_the_end() -> None:
    """The task is solved at 8 cm; no block ever gets where the program wants it, at 5 cm."""
    assert not explained(TOWER, *SHORT, distance=0.08)


def test_what_two_entities_lack_is_not_left_to_the_end() -> None:
    """The same without a loop."""
    at = "‖{0}↓xyz − g({0})↓xyz‖ < 0.05".format
    gets = "a := get(λa:block. ¬(a↓x > 0.6)); b := get(λb:block. b↓x > 0.6)"
    program = straight(f"{gets}; π_one(μ, a, g(a)) until {at('a')}; π_other(μ, b, g(b)) until {at('b')}")
    assert explained(program, *FULL)
    assert not explained(program, *SHORT, distance=0.08)


def test_what_was_done_earlier_than_the_program_asks_for_counts() -> None:
    """Independent parts are written in one order, demonstrations may show any."""
    program = straight("π_right() until μ↓x > 0.5; π_left() until μ↓x < -0.5")
    assert explained(program, (0.0, 1, 1), (0.9, 1, 1), (-0.9, 1, 1))
    assert explained(program, (0.0, 1, 1), (-0.9, 1, 1), (0.9, 1, 1))


def test_what_was_never_done_does_not() -> None:
    program = straight("π_right() until μ↓x > 0.5; π_left() until μ↓x < -0.5")
    assert not explained(program, (0.0, 1, 1), (0.9, 1, 1), (0.0, 1, 1))
    assert not explained(program, (0.0, 1, 1), (-0.9, 1, 1), (0.0, 1, 1))


def test_the_last_step_of_a_straight_program_may_be_what_the_demonstration_ends_with() -> None:
    program = straight("π_right() until μ↓x > 0.5; π_left() until μ↓x < -0.5")
    assert explained(program, (0.0, 0, 0), (0.9, 0, 0), (-0.4, 0, 0))


@pytest.mark.parametrize("block", [0.0, 1.0], ids=["solved", "unsolved"])
def test_a_program_that_never_ends_explains_nothing(block: float) -> None:
    program = straight("while (true) { π_right() until μ↓x > 0.5; π_left() until μ↓x < -0.5 }")
    frames = [(x, block, block) for x in (0.0, 0.9, -0.9, 0.9, -0.9)]
    assert not explained(program, *frames)


def test_a_program_that_goes_round_without_a_controller_explains_nothing() -> None:
    assert not explained(straight("while (true) { b := get(λb:block. true) }"), *FULL)


def test_nothing_is_left_to_do_where_all_holds_from_the_start() -> None:
    assert explained(TOWER, (0.9, 0.0, 0.0), (0.9, 0.0, 0.0))


@pytest.mark.parametrize(("frames", "answer"), [(FULL[:4], True), (SHORT[:4], False)], ids=["one", "two"])
def test_a_loop_over_branches_may_ask_again_for_what_the_demonstration_ends_with(
    frames: tuple[Frame, ...], answer: bool
) -> None:
    """The task is solved at 8 cm, where the demonstration ends; the program asks for 5 cm."""
    at = "‖{0}↓xyz − g({0})↓xyz‖ < 0.05".format
    gets = "a := get(λa:block. ¬(a↓x > 0.6)); b := get(λb:block. b↓x > 0.6)"
    one, other = f"π_one(μ, a, g(a)) until {at('a')}", f"π_other(μ, b, g(b)) until {at('b')}"
    program = straight(
        f"{gets}; while (¬({at('a')} ∧ {at('b')})) {{ if (¬({at('a')})) {{ {one} }} else {{ {other} }} }}"
    )
    assert explained(program, *frames, (0.07, frames[-1][1], 0.07), distance=0.08) == answer
