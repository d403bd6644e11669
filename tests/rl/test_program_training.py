"""What follows from a program for one of its skills."""

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Not, Predicate, Program, Truth
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.program_training import ProgramTraining
from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, Layout, ObjectType
from roboscribe.world.trajectory import Trajectory
from tests.rl.carry_world import PLANE, Carry

LOOP = """def P(μ : EE):
  while (b := get(λb:block. ¬‖b↓xy − g(b)↓xy‖ < 0.08)) ≠ null:
    π_hold(μ, b) until ‖μ↓xy − b↓xy‖ < 0.04;
    π_at(μ, b, g(b)) until ‖b↓xy − g(b)↓xy‖ < 0.08"""
LEAVE = ";\n  π_leave(μ) until ¬∃b:block. ‖μ↓xy − b↓xy‖ < 0.1"
LINE = """def P(μ : EE):
  b := get(λb:block. true);
  π_hold(μ, b) until ‖μ↓xy − b↓xy‖ < 0.04;
  π_at(μ, b, g(b)) until ‖b↓xy − g(b)↓xy‖ < 0.08"""
UNSERVED = parse_predicate("∃b:block. ¬‖b↓xy − g(b)↓xy‖ < 0.08")


def training(program: Program, *, solve: bool = True) -> ProgramTraining:
    return ProgramTraining(Carry(blocks=3), program, (), TrainConfig(target=0.99, subgoal_target=0.9), 0, solve)


def test_what_a_loop_repeats_must_succeed_as_often_as_all_repetitions_together() -> None:
    hold, at, leave = controllers(program := parse_program(LOOP + LEAVE))
    assert training(program).target(hold) ** 3 == pytest.approx(0.99)
    assert training(program, solve=False).target(at) ** 3 == pytest.approx(0.9)
    assert training(program).target(leave) == 0.99
    assert training(line := parse_program(LINE)).target(controllers(line)[0]) == 0.99


@pytest.mark.parametrize(
    ("text", "continues_if"),
    [(LINE, [Truth(), Not(Truth())]), (LOOP, [Truth(), UNSERVED]), (LOOP + LEAVE, [Truth(), Truth(), Not(Truth())])],
)
def test_the_last_statement_is_to_bring_the_task_about(text: str, continues_if: list[Predicate]) -> None:
    program = parse_program(text)
    runs = controllers(program)
    assert [training(program).continues_if(run) for run in runs] == continues_if
    assert [training(program, solve=False).continues_if(run) for run in runs] == [Truth()] * len(runs)


BRANCHES = """def P(μ : EE):
  b := get(λb:block. true);
  m := get(λm:marker. true);
  if TEST:
    π_b(μ, b) until ‖μ↓xy − b↓xy‖ < 0.04;
    π_m(μ, m) until ‖μ↓xy − m↓xy‖ < 0.04
  else:
    π_m(μ, m) until ‖μ↓xy − m↓xy‖ < 0.04;
    π_b(μ, b) until ‖μ↓xy − b↓xy‖ < 0.04"""


def test_in_branches_the_condition_tells_what_comes_last() -> None:
    goal_right, hand_right = "g(b)↓x > 0.5", "μ↓x > 0.5"
    task = Marked(blocks=1)
    states = np.zeros((2, task.layout.size))
    columns = task.layout.columns
    states[1, columns[0, "position", True]] = states[:, columns[ROBOT, "position", False]] = 1.0
    shown = [Trajectory(task.layout, np.stack([state, state])) for state in states]
    shown[0].states[1, columns[ROBOT, "position", False]] = 0.0

    def goes_on(test: str) -> dict[str, list[bool]]:
        program = parse_program(BRANCHES.replace("TEST", test))
        learned = ProgramTraining(task, program, shown, TrainConfig(), 0, solve=True)
        answers = {run.controller: learned.continues_if(run) for run in learned.runs}
        return {name: holds(answer, states, {}, task.layout).tolist() for name, answer in answers.items()}

    assert goes_on(goal_right) == {"b": [False, True], "m": [True, False]}
    assert goes_on(f"¬{goal_right}") == {"b": [True, False], "m": [False, True]}
    assert goes_on(hand_right) == {"b": [True, True], "m": [True, True]}, "it changes on the way: nothing is known"


def test_a_controller_that_comes_earlier_too_is_not_asked_for_the_task() -> None:
    again = ";\n  π_hold(μ, b) until ‖μ↓xy − b↓xy‖ < 0.04"
    program = parse_program(LINE + again)
    assert {training(program).continues_if(run) for run in controllers(program)} == {Truth()}


NEAR_FIRST = """def P(μ : EE):
  m := get(λm:marker. true);
  while (b := get(λb:block. ¬‖b↓xy − g(b)↓xy‖ < 0.08 ∧ ¬∃o:block. ‖m↓xy − o↓xy‖ < ‖m↓xy − b↓xy‖)) ≠ null:
    π_at(μ, b, g(b)) until ‖b↓xy − g(b)↓xy‖ < 0.08"""


class Marked(Carry):
    """Blocks, and a marker that never moves."""

    @property
    def layout(self) -> Layout:
        """Add the marker."""
        blocks = super().layout
        return Layout(blocks.robot, (*blocks.entities, ObjectType("marker", (PLANE,))))

    def solved(self, states: FloatArray) -> BoolArray:
        """All blocks are at their goals."""
        return super().solved(states[..., : super().layout.size])


def test_a_guard_may_speak_of_what_was_bound_before_its_loop() -> None:
    """The program goes on while there is a block to get, the one nearest to the marker; then ψ_R decides."""
    program = parse_program(NEAR_FIRST)
    task = Marked(blocks=2)
    (run,) = controllers(program)
    subtask = ProgramTraining(task, program, (), TrainConfig(), 0, solve=True).subtask(run)
    states = np.zeros((3, task.layout.size))
    states[:, [4, 5, 8, 9]] = 0.2  # the goals
    states[1:, [2, 3]] = 0.2  # the first block is there
    states[2, [6, 7]] = 0.2  # the second one, too
    entities = np.zeros((3, 1), np.int64)
    assert subtask.achieved(states, entities).tolist() == [False, True, True]
    assert subtask.achieved(states, entities + 1).tolist() == [False, False, True]
