"""What a program did is found again from the states of its episode."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.replay import guards, readings, replay
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Get, Less
from roboscribe.envs.point_world import POINT_TASKS, Lookahead

TASK = POINT_TASKS["point-tower-3"]
TOWER = parse_program(
    "def Tower(μ : EE): while (b := get(λb:block. ¬(‖b↓xz − g(b)↓xz‖ < 0.02) ∧ "
    "¬(∃b':block. g(b')↓z < g(b)↓z ∧ ¬(‖b'↓xz − g(b')↓xz‖ < 0.02)))) ≠ null "
    "{ π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.0125; π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02 }"
)


def test_a_replay_agrees_with_the_run() -> None:
    library = {run.controller: Lookahead(TASK, run, {}, 0) for run in controllers(TOWER)}
    rollouts = execute(TOWER, library, TASK, np.arange(2), limits={}, batch=1, confirm=3)
    for trajectory, lines, served in zip(rollouts.trajectories, rollouts.lines, rollouts.served, strict=True):
        moments = replay(TOWER, TASK.layout, trajectory.states, {}, 3, TASK.solved)
        assert len(moments) == len(trajectory.states)
        assert [moment.run for moment in moments[:-1]] == lines.tolist()
        assert [moment.bound["b"] for moment in moments[:-1]] == served.tolist()


def test_readings_name_entities_and_give_values() -> None:
    state = TASK.world(1).reset(np.array([0]), np.array([1]))[0]
    phi = parse_predicate("‖μ↓xz − b↓xz‖ < 0.0125 ∧ ¬(b↓x > 5.0) ∧ ∃c:block. c↓x < 9.0")
    near, right, true = readings(phi, state, {"b": 1}, TASK.layout)
    hand, block = state[TASK.layout.columns[-2, "position", False]], state[TASK.layout.columns[1, "position", False]]
    assert near.said == "‖μ↓xz − b2↓xz‖ < 0.0125"
    assert near.value == pytest.approx(np.linalg.norm(hand - block))
    assert (near.threshold, near.holds) == (0.0125, False)
    assert (right.said, right.threshold, right.holds) == ("¬(b2↓x > 5.0)", 5.0, True)
    assert right.value == pytest.approx(block[0])
    assert true.holds
    assert isnan(true.value)


def test_what_is_about_null_cannot_be_read() -> None:
    state = TASK.world(1).reset(np.array([0]), np.array([1]))[0]
    phi = parse_predicate("‖μ↓xz − b↓xz‖ < 0.0125 ∧ ‖μ↓xz − b1↓xz‖ < 9.0")
    assert [reading.said for reading in readings(phi, state, {}, TASK.layout)] == ["‖μ↓xz − b1↓xz‖ < 9.0"]


def test_guards_are_those_of_the_innermost_loop_or_branch() -> None:
    program = parse_program(
        "def P(μ : EE): π_a(μ) until true; while (μ↓x < 1.0) { π_b(μ) until true; "
        "if (μ↓z < 2.0) { π_c(μ) until true } else { π_d(μ) until true } }"
    )
    first, second, third, fourth = guards(program)
    assert first is None
    assert isinstance(second, Less)
    assert str(second) == "μ↓x < 1.0"
    assert str(third) == str(fourth) == "μ↓z < 2.0"
    assert isinstance(guards(TOWER)[1], Get)
