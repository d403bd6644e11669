"""What follows from a program for one of its skills."""

import pytest

from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Not, Predicate, Program, Truth
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.program_training import ProgramTraining
from tests.rl.carry_world import Carry

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
