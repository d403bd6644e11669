"""Cutting demonstrations by what a program would have run."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.segmentation import Segment, segment
from roboscribe.dsl.semantics import SolvedTest
from roboscribe.dsl.syntax import Program
from roboscribe.world import Trajectory
from tests.dsl.kinematic import TOWER, blocks


def demonstration(*positions: tuple[float, float, float]) -> Trajectory:
    """Two blocks on a line with goals at 0; each frame is (gripper, b1, b2), all along x."""
    frames = [[g, 0, 0, 0, a, 0, 0, 0, 0, 0, b, 0, 0, 0, 0, 0.001] for g, a, b in positions]
    return Trajectory(blocks(2), np.array(frames, dtype=np.float64))


FULL = demonstration(
    (0.9, 0.5, 0.8),  # 0: reach for b1, the lower goal
    (0.7, 0.5, 0.8),
    (0.5, 0.5, 0.8),  # 2: held; carry
    (0.3, 0.3, 0.8),
    (0.01, 0.01, 0.8),  # 4: placed; reach for b2
    (0.5, 0.01, 0.8),
    (0.79, 0.01, 0.8),  # 6: held; carry
    (0.04, 0.01, 0.04),  # 7: placed, the loop ends; carrying goes on
    (0.04, 0.01, 0.04),
    (0.04, 0.01, 0.04),  # the last state has no action
)
FINISHED = demonstration((0.5, 0.0, 0.0), (0.4, 0.0, 0.0))


def part(frames: int) -> Trajectory:
    """Return so many frames of the full demonstration."""
    return Trajectory(FULL.layout, FULL.states[:frames])


def cut(program: Program, path: Trajectory, solved: SolvedTest | None = None) -> tuple[Segment, ...]:
    """Cut one demonstration."""
    (parts,) = segment(program, [path], solved=solved)
    return parts


def test_a_demonstration_is_cut_exactly_where_goals_are_first_reached() -> None:
    assert cut(TOWER, FULL) == (
        Segment(0, 0, 2, (0,)),
        Segment(1, 2, 4, (0,)),
        Segment(0, 4, 6, (1,)),
        Segment(1, 6, 9, (1,)),
    )


@pytest.mark.parametrize("after_end", [True, False])
def test_demonstrations_of_any_length_are_cut_side_by_side_as_each_alone(after_end: bool) -> None:
    shown = [part(5), FULL, FINISHED, part(1), demonstration((0.5, 0.5, 0.8), (0.4, 0.4, 0.8), (0.2, 0.2, 0.8))]
    alone = [segment(TOWER, [each], after_end=after_end)[0] for each in shown]
    assert segment(TOWER, shown, after_end=after_end) == tuple(alone)


def test_what_comes_after_the_end_is_left_out_if_asked_so() -> None:
    ((*_, last),) = segment(TOWER, [FULL], after_end=False)
    assert last == Segment(1, 6, 7, (1,))


def test_statements_passed_on_arrival_get_no_frames() -> None:
    assert cut(TOWER, demonstration((0.5, 0.5, 0.8), (0.4, 0.4, 0.8), (0.2, 0.2, 0.8))) == (Segment(1, 0, 2, (0,)),)
    assert cut(TOWER, FINISHED) == (), "no controller is ever reached"
    assert segment(TOWER, []) == ()


def test_two_visits_to_one_statement_are_two_segments() -> None:
    back_and_forth = parse_program(
        "def P(μ : EE): while (true) { π_go() until μ↓x > 0.5; if (μ↓x > 0.8) { π_back() until ¬(μ↓x > 0.5) } }"
    )
    path = demonstration(*((x, 0.0, 0.0) for x in [0.0, 0.9, 0.3, 0.4, 0.9, 0.0]))
    assert cut(back_and_forth, path) == (
        Segment(0, 0, 1, ()),
        Segment(1, 1, 2, ()),
        Segment(0, 2, 4, ()),
        Segment(1, 4, 5, ()),
    )


def test_the_opaque_goal_is_asked_of_the_caller() -> None:
    root = parse_program("def P(μ : EE): π_any() until ψ_R")
    path = demonstration((0.0, 1, 1), (0.1, 1, 1), (0.2, 1, 1))
    assert cut(root, path, lambda s: s[..., 0] > 0.15) == (Segment(0, 0, 2, ()),)
    with pytest.raises(ValueError, match="ψ_R was asked"):
        cut(root, path)
