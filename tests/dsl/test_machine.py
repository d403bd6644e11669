"""The machine's decisions, state by state."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.interpreter import Machine
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.errors import ProgramError
from roboscribe.world.layout import NULL, FloatArray, IntArray
from tests.dsl.kinematic import TOWER, blocks

TWO = blocks(2)
AWAY, GOALS = (0.4, 0.0, 0.0), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.06))


def state(gripper: float = 0.0, first: float = 0.3, second: float = 0.3) -> FloatArray:
    """Two blocks on a line, `first` and `second` metres from their goals; the gripper at x = `gripper`."""
    bodies = [[first, 0, 0], GOALS[0], [second, 0, 0.06], GOALS[1]]
    return np.array([gripper, 0, 0, 0, *np.ravel(bodies)])


def rows(*numbers: int) -> IntArray:
    """Row numbers."""
    return np.array(numbers, dtype=np.int64)


def program(body: str) -> Program:
    """Parse the body of a program."""
    return parse_program(f"def P(μ : EE): {body}")


def observe(machine: Machine, *states: FloatArray) -> list[int]:
    """Advance row 0 and list which controller acts after each state."""
    acting = []
    for each in states:
        machine.advance(rows(0), each[None])
        acting.append(int(machine.run_index[0]))
    return acting


NEAR = "μ↓x > 0.5"


def test_a_goal_counts_only_after_consecutive_confirmations() -> None:
    machine = Machine(program(f"π_a() until {NEAR}; π_b() until true"), TWO, 1, limits={}, confirm=3)
    on, off = state(0.6), state(0.4)
    assert observe(machine, on, on, off, on, on, on) == [0, 0, 0, 0, 0, 1]
    assert not machine.ended[0]
    assert observe(machine, off, off) == [1, 1]
    assert machine.ended[0], "b's goal held in the state in which a's was confirmed and in two more"


def test_with_one_confirmation_a_goal_that_holds_on_arrival_is_passed_at_once() -> None:
    machine = Machine(
        program(f"π_a() until {NEAR}; π_b() until {NEAR}; π_c() until ψ_R"),
        TWO,
        1,
        limits={},
        confirm=1,
        solved=lambda s: s[:, 0] > 0.8,
    )
    assert observe(machine, state(0.4), state(0.6), state(0.6), state(0.9)) == [0, 2, 2, 2]
    assert machine.ended[0]
    assert machine.visit[0] == 3


def test_get_takes_the_lowest_index_without_a_generator_and_records_the_order_of_binding() -> None:
    machine = Machine(TOWER, TWO, 1, limits={}, confirm=1)
    observe(machine, state())
    assert machine.entities(rows(0)).tolist() == [[0]]
    observe(machine, state(gripper=0.0, first=0.0))
    assert machine.entities(rows(0)).tolist() == [[1]], "b1 is placed, so both statements are passed and b2 is bound"
    assert machine.bound == [[0, 1]]


def test_get_draws_reproducibly_and_from_all_answers_with_a_generator() -> None:
    unfinished = program("b := get(λb:block. true); π_a(b) until ¬true")
    drawn = []
    for seed in (7, 7, 8):
        machine = Machine(unfinished, TWO, 64, limits={}, rng=np.random.default_rng(seed))
        machine.advance(np.arange(64), np.tile(state(), (64, 1)))
        drawn.append(machine.entities(np.arange(64))[:, 0].tolist())
    assert drawn[0] == drawn[1] != drawn[2]
    assert set(drawn[0]) == {0, 1}
    assert 16 <= sum(drawn[0]) <= 48, "uniformly"


def test_null_ends_a_loop_and_the_last_controller_keeps_its_entities() -> None:
    loop = "while ((b := get(λb:block. b↓x > 0.1)) ≠ null) { π_a(b) until b↓x < 0.1; π_b(b) until μ↓x > 0.5 }"
    machine = Machine(program(loop), TWO, 1, limits={}, confirm=1)
    placed = {"first": 0.0, "second": 0.0}
    acting = observe(machine, state(), state(first=0.0), state(0.6, first=0.0), state(**placed), state(0.6, **placed))
    assert acting == [0, 1, 0, 1, 1]
    assert machine.ended[0]
    assert machine.entities(rows(0)).tolist() == [[1]]
    assert machine.bound == [[0, 1]]
    assert observe(machine, state()) == [1], "nothing starts over"


def test_a_get_without_answer_binds_null_outside_a_loop() -> None:
    nothing = program("b := get(λb:block. b↓z > 9.0); if (b ≠ null) { π_a(b) until true } else { π_b(b) until ¬true }")
    machine = Machine(nothing, TWO, 1, limits={})
    assert observe(machine, state()) == [1]
    assert machine.entities(rows(0)).tolist() == [[NULL]]
    assert machine.bound == [[]]


def test_a_time_out_in_a_loop_asks_the_guard_again() -> None:
    loop = program("while ((b := get(λb:block. b↓x > 0.1)) ≠ null) { π_a(b) until μ↓x > 9.0; π_b(b) until true }")
    machine = Machine(loop, TWO, 1, limits={"a": 2})
    assert observe(machine, state(), state()) == [0, 0]
    assert machine.entities(rows(0)).tolist() == [[0]]
    observe(machine, state(first=0.0))
    assert machine.entities(rows(0)).tolist() == [[1]], "two steps were taken, and b1 is no longer an answer"
    observe(machine, state(first=0.0), state(first=0.0, second=0.0))
    assert machine.ended[0], "the guard found nothing at the next time-out"


def test_what_took_too_long_waits_for_the_others() -> None:
    loop = program("while ((b := get(λb:block. b↓x > 0.1)) ≠ null) { π_a(b) until μ↓x > 9.0 }")
    machine = Machine(loop, TWO, 1, limits={"a": 1})
    served = []
    for _ in range(4):
        observe(machine, state())
        served.append(int(machine.entities(rows(0))[0, 0]))
    assert served == [0, 1, 0, 1]
    machine.reset(rows(0))
    observe(machine, state())
    assert machine.entities(rows(0)).tolist() == [[0]], "a new episode knows nothing of the last"


def test_what_slipped_off_waits_for_what_was_not_served_yet() -> None:
    loop = program("while ((b := get(λb:block. b↓x > 0.1)) ≠ null) { π_a(b) until μ↓x > 0.9 }")
    machine = Machine(loop, TWO, 1, limits={}, confirm=1)
    assert [observe(machine, state(x)) for x in (0.0, 1.0)] == [[0], [0]]
    assert machine.entities(rows(0)).tolist() == [[1]], "b1 is asked for still, but b2 was never served"


def test_what_was_never_reached_is_told_from_what_was_lost_again() -> None:
    """The block was reached, then not brought; that the hand is away from it again is not what is missing."""
    loop = program("while ((b := get(λb:block. b↓x > 0.1)) ≠ null) { π_a(b) until μ↓x > 0.9; π_b(b) until b↓x < 0.1 }")
    machine = Machine(loop, TWO, 1, limits={"b": 1}, confirm=1)
    told = []
    for gripper in (0.0, 1.0, 0.0, 1.0, 0.0):
        observe(machine, state(gripper))
        told.append((int(machine.served[0]), int(machine.run_index[0]), machine.never_reached(0)))
    assert told == [(0, 0, 0), (0, 1, 1), (1, 0, 0), (1, 1, 1), (0, 0, NULL)]
    machine.reset(rows(0))
    observe(machine, state())
    assert machine.never_reached(0) == 0, "a new episode knows nothing of the last"
    observe(machine, state(first=0.0, second=0.0), state(1.0, 0.0, 0.0))
    assert machine.ended[0]
    assert machine.never_reached(0) == NULL


def test_a_time_out_in_straight_line_code_changes_nothing() -> None:
    machine = Machine(program(f"π_a() until {NEAR}; π_b() until ¬true"), TWO, 1, limits={"a": 1}, confirm=1)
    assert observe(machine, *[state()] * 4, state(0.6)) == [0, 0, 0, 0, 1]


def test_only_the_innermost_loop_is_asked_again() -> None:
    nested = program(
        f"while ((b := get(λb:block. true)) ≠ null) {{ while (¬({NEAR})) {{ π_a() until ¬true }}; π_b() until ¬true }}"
    )
    machine = Machine(nested, TWO, 1, limits={"a": 1})
    assert observe(machine, state(), state(), state(0.6)) == [0, 0, 1]
    assert machine.visit[0] == 3


def test_branches_are_taken_row_by_row_and_rows_stand_at_different_places() -> None:
    branching = program(f"if ({NEAR}) {{ π_a() until ¬({NEAR}) }} else {{ π_b() until {NEAR} }}; π_c() until ¬true")
    machine = Machine(branching, TWO, 3, limits={}, confirm=1)
    machine.advance(rows(0, 1, 2), np.stack([state(0.6), state(0.4), state(0.6)]))
    assert machine.run_index.tolist() == [0, 1, 0]
    machine.advance(rows(2, 1), np.stack([state(0.4), state(0.4)]))
    assert machine.run_index.tolist() == [0, 1, 2]


def test_an_endless_loop_without_a_controller_is_stuck_and_the_others_go_on() -> None:
    machine = Machine(
        program(f"π_a() until true; while ({NEAR}) {{ }}; π_b() until ¬true"), TWO, 2, limits={}, confirm=1
    )
    machine.advance(rows(0, 1), np.stack([state(0.6), state(0.4)]))
    assert machine.stuck.tolist() == machine.ended.tolist() == [True, False]
    assert machine.run_index.tolist() == [0, 1]


def test_reset_starts_one_row_over() -> None:
    machine = Machine(TOWER, TWO, 2, limits={}, confirm=1)
    both = np.stack([state(0.0, 0.0, 0.0)] * 2)
    machine.advance(rows(0, 1), both)
    assert machine.ended.all()
    machine.reset(rows(1))
    assert (machine.ended.tolist(), machine.run_index.tolist()) == ([True, False], [-1, -1])
    machine.advance(rows(1), state()[None])
    assert machine.run_index.tolist() == [-1, 0]
    assert machine.bound == [[], [0]]


def test_the_empty_program_ends_at_once_and_never_has_a_controller() -> None:
    machine = Machine(program("skip"), TWO, 1, limits={})
    assert observe(machine, state()) == [-1]
    assert machine.ended[0]
    assert not machine.stuck[0]


def test_a_program_is_checked_before_it_runs() -> None:
    with pytest.raises(ProgramError, match="variable b is used before"):
        Machine(program("π_a(b) until true"), TWO, 1, limits={})
    assert len(controllers(TOWER)) == 2
