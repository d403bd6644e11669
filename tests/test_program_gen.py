"""GENPROGRAM on trees made by hand."""

from __future__ import annotations

import numpy as np

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.syntax import Program
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.program_gen import gen_program
from roboscribe.subtask_tree import ROOT, TRUE, Tree
from tests.handmade import AT, HOLD, bottom_up, chain, evidence, node

ONE = PointTask("toy", ("block",))
THREE = PointTask("toy", ("block",) * 3)
BOTH = PointTask("toy", ("peg", "cube"))
HOLD1, AT1 = node("hold", HOLD, "b1"), node("at", AT, "b1")
PEG, CUBE = node("at", AT, "p1"), node("at2", AT, "c1")
TWO_PATHS = Tree((*Tree().nodes, PEG, CUBE), ((TRUE, "at"), ("at", ROOT), (TRUE, "at2"), ("at2", ROOT)))


def program(body: str) -> Program:
    """Parse a program, with HOLD and AT written as hold(v) and at(v)."""
    for v in ("b", "p", "c"):
        body = body.replace(f"hold({v})", HOLD.format(v)).replace(f"at({v})", f"{AT.format(v)}")
    return parse_program(f"def P(μ : EE): {body}")


def test_without_subgoals_one_controller_is_asked_for_the_goal() -> None:
    answer = gen_program(ROOT, evidence(ONE), Tree())
    assert answer == program("b := get(λb:block. true); π_R(μ, b, g(b)) until ψ_R")


def test_a_path_becomes_a_sequence_and_the_goal_needs_no_controller_of_its_own() -> None:
    answer = gen_program(ROOT, evidence(ONE), chain(HOLD1, AT1))
    assert answer == program("b := get(λb:block. true); π_hold(μ, b) until hold(b); π_at(μ, b, g(b)) until at(b)")


def test_a_goal_within_the_tree_ends_the_program() -> None:
    answer = gen_program("hold", evidence(ONE), chain(HOLD1, AT1))
    assert answer == program("b := get(λb:block. true); π_hold(μ, b) until hold(b)")


def test_a_circular_node_becomes_a_loop_around_what_leads_to_it() -> None:
    tree = chain(HOLD1, node("at", AT, "b1", circular=True))
    rng = np.random.default_rng(0)
    shown = evidence(THREE, lambda goals: [int(i) for i in rng.permutation(3)])
    loop = "while ((b := get(λb:block. ¬(at(b)))) ≠ null) { π_hold(μ, b) until hold(b); π_at(μ, b, g(b)) until at(b) }"
    assert gen_program(ROOT, shown, tree) == program(loop)


def test_branches_come_in_the_order_of_the_demonstrations() -> None:
    shown = evidence(BOTH, lambda _: [1, 0])
    wanted = (
        "c := get(λc:cube. true); p := get(λp:peg. true); π_at2(μ, c, g(c)) until at(c); π_at(μ, p, g(p)) until at(p)"
    )
    assert gen_program(ROOT, shown, TWO_PATHS) == program(wanted)


def test_branches_of_varying_order_become_a_condition() -> None:
    answer = gen_program(ROOT, evidence(BOTH, bottom_up), TWO_PATHS)
    peg, cube = "π_at(μ, p, g(p)) until at(p)", "π_at2(μ, c, g(c)) until at(c)"
    gets = "p := get(λp:peg. true); c := get(λc:cube. true)"
    assert answer == program(f"{gets}; if (g(p)↓z < g(c)↓z) {{ {peg}; {cube} }} else {{ {cube}; {peg} }}")


def test_three_branches_of_varying_order_fail_with_the_reason() -> None:
    task = PointTask("toy", ("peg", "cube", "disc"))
    nodes = (PEG, CUBE, node("at3", AT, "d1"))
    edges = tuple(edge for n in nodes for edge in ((TRUE, n.name), (n.name, ROOT)))
    answer = gen_program(ROOT, evidence(task, bottom_up), Tree((*Tree().nodes, *nodes), edges))
    assert isinstance(answer, Fail)
    assert "in no consistent order" in answer.reason


def test_a_loop_that_nothing_explains_fails_with_the_reason() -> None:
    shown = evidence(THREE, lambda goals: bottom_up(goals)[:2])
    answer = gen_program(ROOT, shown, chain(node("at", AT, "b1", circular=True)))
    assert answer == Fail("no demonstration handles entities one after another until at")
