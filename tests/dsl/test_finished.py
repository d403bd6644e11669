"""What a loop has finished counts until it clearly is undone; then the loop goes back to it."""

from __future__ import annotations

import numpy as np

from roboscribe.dsl.finished import PATIENCE, slackened
from roboscribe.dsl.interpreter import Machine
from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.world.layout import Attribute, FloatArray, Layout, ObjectType
from tests.dsl.test_machine import TWO, observe, program, rows, state

LOOP = program(
    "while ((b := get(λb:block. b↓x > 0.1 ∧ ¬∃b':block. g(b')↓z < g(b)↓z ∧ b'↓x > 0.1)) ≠ null) "
    "{ π_a(b) until b↓x < 0.1 }"
)
"""Bring the lower block within 0.1 m, then the other."""
CONFIRM = 2


def at(first: float, second: float = 0.3) -> FloatArray:
    """Return a state."""
    return state(first=first, second=second)


def served(machine: Machine, *states: FloatArray) -> int:
    """Advance row 0; return the block that is served then."""
    observe(machine, *states)
    return int(machine.entities(rows(0))[0, 0])


def placed() -> Machine:
    """Return a machine that has placed the first block and serves the second."""
    machine = Machine(LOOP, TWO, 1, limits={}, confirm=CONFIRM)
    assert served(machine, at(0.3)) == 0
    assert served(machine, at(0.05), at(0.05)) == 1
    return machine


def test_a_loop_goes_back_to_what_is_undone() -> None:
    machine = placed()
    assert served(machine, at(0.5)) == 1, "one observation may be wrong"
    assert served(machine, at(0.5)) == 0
    assert served(machine, at(0.05), at(0.05)) == 1
    observe(machine, at(0.05, 0.05), at(0.05, 0.05))
    assert machine.ended[0]


def test_an_outlier_changes_nothing() -> None:
    machine = placed()
    assert served(machine, at(0.5), at(0.05), at(0.5), at(0.05)) == 1


def test_what_is_slightly_off_is_no_reason_to_leave_what_is_served() -> None:
    machine = placed()
    assert served(machine, *[at(0.15)] * (2 * PATIENCE)) == 1
    assert served(machine, at(0.15, 0.05), at(0.15, 0.05)) == 0, "at the next guard it counts"


def test_a_loop_looks_again_before_it_ends() -> None:
    machine = placed()
    observe(machine, at(0.05, 0.05), at(0.15, 0.05))
    assert not machine.ended[0]
    assert machine.run_index[0] == 0, "what acted acts on"
    observe(machine, at(0.05, 0.05))
    assert machine.ended[0]


def test_a_loop_that_goes_on_seeing_a_fault_takes_it_up() -> None:
    machine = placed()
    observe(machine, at(0.05, 0.05), *[at(0.15, 0.05)] * (PATIENCE - 1))
    assert not machine.ended[0]
    assert served(machine, at(0.15, 0.05)) == 0


def test_an_episode_forgets_what_was_finished_in_the_last_one() -> None:
    machine = placed()
    machine.reset(rows(0))
    assert served(machine, at(0.15)) == 0


def test_rows_do_not_influence_each_other() -> None:
    """Two rows of which one is knocked off."""
    machine, both = Machine(LOOP, TWO, 2, limits={}, confirm=CONFIRM), np.arange(2)
    for first in (0.3, 0.05, 0.05):
        machine.advance(both, np.stack([at(first)] * 2))
    for _ in range(CONFIRM):
        machine.advance(both, np.stack([at(0.05), at(0.5)]))
    assert machine.entities(both)[:, 0].tolist() == [1, 0]


def test_thresholds_below_which_something_must_lie_are_widened() -> None:
    found = slackened(parse_predicate("μ↓x < 0.1 ∧ (¬(b↓x < 0.2) ∨ b↓x > 0.3)"))
    assert str(found) == str(parse_predicate("μ↓x < 0.2 ∧ (¬(b↓x < 0.2) ∨ b↓x > 0.3)"))


def test_an_entity_that_is_known_by_its_goal_alone_can_be_served() -> None:
    wish = ObjectType("wish", (), (Attribute("level", ("level",), "1"),))
    layout = Layout(ObjectType("EE", (Attribute("level", ("level",), "1"),)), (wish, wish))
    loop = parse_program(
        "def P(μ : EE): while ((w := get(λw:wish. ¬‖μ↓level − g(w)↓level‖ < 0.1)) ≠ null) "
        "{ π_at(μ, g(w)) until ‖μ↓level − g(w)↓level‖ < 0.1 }"
    )
    machine = Machine(loop, layout, 1, limits={}, confirm=1)
    machine.advance(np.zeros(1, np.int64), np.array([[0.0, 1.0, 2.0]]))
    assert machine.entities(np.zeros(1, np.int64)).tolist() == [[0]]
    machine.advance(np.zeros(1, np.int64), np.array([[1.0, 1.0, 2.0]]))
    assert machine.entities(np.zeros(1, np.int64)).tolist() == [[1]]
