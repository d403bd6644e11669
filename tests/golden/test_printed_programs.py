"""Programs print as the documentation shows them, letter by letter."""

from __future__ import annotations

from pathlib import Path

import pytest

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import pretty
from roboscribe.dsl.syntax import (
    And,
    Const,
    Diff,
    Exists,
    Get,
    Goal,
    Greater,
    If,
    Less,
    Norm,
    Not,
    Object,
    Predicate,
    Program,
    Proj,
    Robot,
    Run,
    Seq,
    Solved,
    Truth,
    Var,
    While,
)

FOLDER = Path(__file__).parent / "programs"
MU, B, OTHER, C, D = Robot(), Var("b"), Var("b'"), Var("c"), Var("d")


def near(left: Object, right: Object, distance: float) -> Predicate:
    """‖left↓xyz − right↓xyz‖ < distance."""
    return Less(Norm(Diff(Proj(left, "xyz"), Proj(right, "xyz"))), Const(distance))


def at(v: Var) -> Predicate:
    """`v` is at its goal."""
    return near(v, Goal(v), 0.05)


def tower() -> Program:
    """Fig. 11."""
    lower = Less(Proj(Goal(OTHER), "z"), Proj(Goal(B), "z"))
    guard = And(Not(at(B)), Not(Exists(OTHER, "block", And(lower, Not(at(OTHER))))))
    body = Seq((Run("hold", (MU, B), near(MU, B, 0.021)), Run("at", (MU, B, Goal(B)), at(B))))
    return Program("Tower", While(Get(B, "block", guard), body))


def pick_and_place() -> Program:
    """Fig. 8."""
    runs = Run("grasp", (MU, B), near(MU, B, 0.033)), Run("position", (MU, B, Goal(B)), at(B))
    return Program("PickAndPlace", Seq((Get(B, "block", Truth()), *runs)))


def drawer_then_cubes() -> Program:
    """Two branches of a tree, with a loop, a conditional and the task's own goal."""
    hold = And(near(MU, C, 0.021), Less(Proj(MU, "opening"), Const(0.045)))
    carry, grasp = Run("inside", (MU, C, Goal(C)), at(C)), Run("hold", (MU, C), hold)
    opened = Seq(
        (
            Get(D, "drawer", Truth()),
            Run("latch", (MU, D), near(MU, D, 0.04)),
            Run("open", (MU, D), Greater(Proj(D, "opening"), Const(0.12))),
            While(Get(C, "cube", Not(at(C))), If(And(hold, Not(at(C))), carry, grasp)),
            Run("root", (MU,), Solved()),
        )
    )
    return Program("PlaceCubesDrawer", opened)


@pytest.mark.parametrize("program", [tower(), pick_and_place(), drawer_then_cubes()], ids=lambda p: p.name)
def test_pretty_prints_the_documented_text(program: Program) -> None:
    names = {"Tower": "tower", "PickAndPlace": "pick_and_place", "PlaceCubesDrawer": "drawer_then_cubes"}
    expected = (FOLDER / f"{names[program.name]}.txt").read_text(encoding="utf-8")
    assert pretty(program) == expected
    assert parse_program(expected) == program


def test_the_same_predicate_is_defined_once_whatever_its_variables() -> None:
    twice = Program(
        "P", Seq((Get(B, "block", at(B)), Get(C, "block", at(C)), Run("at", (B,), at(B)), Run("to", (C,), at(C))))
    )
    assert pretty(twice).splitlines()[1:] == [
        "  b := get(λb:block. at(b))",
        "  c := get(λc:block. at(c))",
        "  π_at(b) until at(b)",
        "  π_to(c) until at(c)",
        "where",
        "  at(b) ≡ ‖b↓xyz − g(b)↓xyz‖ < 0.05",
    ]


def test_a_name_that_is_taken_gets_a_number_and_definitions_use_each_other() -> None:
    both = And(at(B), near(MU, B, 0.1))
    reused = Program("P", Seq((Get(B, "block", Truth()), Run("at", (B,), both), Run("at", (B,), at(B)))))
    assert pretty(reused).splitlines()[2:] == [
        "  π_at(b) until at(μ, b)",
        "  π_at(b) until at_2(b)",
        "where",
        "  at(μ, b) ≡ at_2(b) ∧ ‖μ↓xyz − b↓xyz‖ < 0.1",
        "  at_2(b) ≡ ‖b↓xyz − g(b)↓xyz‖ < 0.05",
    ]
