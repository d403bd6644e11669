"""GENPROGRAM on trees made by hand."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from roboscribe.dsl.machine import Machine
from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.rewrite import controllers, walk
from roboscribe.dsl.syntax import Get, If, Program, Run, Seq, While
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.program_gen import gen_program
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree
from roboscribe.world.layout import FloatArray
from roboscribe.world.trajectory import Trajectory
from tests.handmade import AT, HOLD, bottom_up, chain, evidence, legs, nearest_first, node, state

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


def test_branches_in_any_order_are_run_in_one_without_a_condition() -> None:
    """Three times out of four the cube comes first, without a reason."""
    rng = np.random.default_rng(2)
    shown = evidence(BOTH, lambda _: [1, 0] if rng.random() < 0.75 else [0, 1], episodes=40)
    cube_first = (
        "c := get(λc:cube. true); p := get(λp:peg. true); π_at2(μ, c, g(c)) until at(c); π_at(μ, p, g(p)) until at(p)"
    )
    assert gen_program(ROOT, shown, TWO_PATHS) == program(cube_first)


TRIO = PointTask("toy", ("peg", "cube", "disc"))
DISC = node("at3", AT, "d1")
THREE_PATHS = Tree(
    (*Tree().nodes, PEG, CUBE, DISC),
    tuple(edge for n in (PEG, CUBE, DISC) for edge in ((TRUE, n.name), (n.name, ROOT))),
)


def test_three_branches_in_any_order_are_run_in_one() -> None:
    rng = np.random.default_rng(2)
    shown = evidence(TRIO, lambda goals: [int(i) for i in rng.permutation(3)], episodes=40)
    answer = gen_program(ROOT, shown, THREE_PATHS)
    assert not isinstance(answer, Fail)
    assert not [part for part in walk(answer) if isinstance(part, If | While)]
    assert sorted(run.controller for run in controllers(answer)) == ["at", "at2", "at3"]


def test_three_branches_whose_order_has_a_reason_become_guarded_branches() -> None:
    """A loop of `if ... else if ... else`: whatever is left, that with the lowest goal is next."""
    answer = gen_program(ROOT, evidence(TRIO, bottom_up, episodes=40), THREE_PATHS)
    assert not isinstance(answer, Fail)
    (loop,) = [part for part in walk(answer) if isinstance(part, While)]
    assert not isinstance(loop.guard, Get)
    assert isinstance(loop.body, If)
    assert isinstance(loop.body.otherwise, If)
    assert isinstance(loop.body.otherwise.otherwise, Run)
    acts = {kind: controller for controller, kind in (("at", 0), ("at2", 1), ("at3", 2))}
    for levels in permutations(range(3)):
        for placed in product((False, True), repeat=3):
            goals = np.array([[1.5, 0.2 * level] for level in levels])
            places = np.where(np.array(placed)[:, None], goals, [[0.1, 0.5], [0.4, 0.2], [0.7, 0.9]])
            left = [kind for kind in range(3) if not placed[kind]]
            lowest = min(left, key=lambda kind: levels[kind], default=None)
            wanted = None if lowest is None else acts[lowest]
            assert acting(answer, state(TRIO.layout, np.zeros(2), places, goals)) == wanted


def test_of_three_kinds_the_nearest_may_come_next() -> None:
    """What is nearest to the hand when it has brought something to its goal, not at the start."""
    rng = np.random.default_rng(0)

    def drawn() -> Trajectory:
        goals = np.column_stack([np.full(3, 1.5), rng.permutation([0.0, 0.3, 0.6])])
        states = legs(TRIO.layout, rng.uniform(0, 1, 2), rng.uniform(0, 1, (3, 2)), goals, nearest_first)
        return Trajectory(TRIO.layout, states)

    answer = gen_program(ROOT, Evidence.of([drawn() for _ in range(60)], TRIO.solved), THREE_PATHS)
    assert not isinstance(answer, Fail)
    acts = dict(enumerate(("at", "at2", "at3")))
    for _ in range(50):
        goals, places, hand = (
            np.array([[1.5, 0.0], [1.5, 0.3], [1.5, 0.6]]),
            rng.uniform(0, 1, (3, 2)),
            rng.uniform(0, 1, 2),
        )
        placed = rng.random(3) < 0.4
        places[placed] = goals[placed]
        left = [kind for kind in range(3) if not placed[kind]]
        wanted = acts[nearest_first(hand, places, goals, left)] if left else None
        assert acting(answer, state(TRIO.layout, hand, places, goals)) == wanted


@pytest.mark.parametrize("goal", ["at", "at2", "at3"])
def test_a_goal_among_three_branches_is_reached_in_any_order(goal: str) -> None:
    """Whatever may come before it is part of its program."""
    shown = evidence(TRIO, bottom_up, episodes=40)
    assert gen_program(goal, shown, THREE_PATHS) == gen_program(ROOT, shown, THREE_PATHS)


def test_a_goal_within_one_of_three_branches_is_reached_in_the_usual_order() -> None:
    """A guard that asks whether the branch is done would never let it end."""
    hold = node("hold", HOLD, "d1")
    others = (edge for edge in THREE_PATHS.edges if edge != (TRUE, "at3"))
    within = Tree((*THREE_PATHS.nodes, hold), (*others, (TRUE, "hold"), ("hold", "at3")))
    answer = gen_program("hold", evidence(TRIO, bottom_up, episodes=40), within)
    assert not isinstance(answer, Fail)
    assert not [part for part in walk(answer) if isinstance(part, While)]
    assert controllers(answer)[-1].controller == "hold"


def test_branches_that_some_reason_orders_and_others_not_go_by_what_is_known() -> None:
    """Peg and cube by height, the disc always last."""
    shown = evidence(TRIO, lambda goals: [*bottom_up(goals[:2]), 2], episodes=40)
    answer = gen_program(ROOT, shown, THREE_PATHS)
    assert not isinstance(answer, Fail)
    assert not [part for part in walk(answer) if isinstance(part, While)]
    assert isinstance(answer.body, Seq)
    assert isinstance(answer.body.parts[-2], If)
    assert answer.body.parts[-1] == controllers(answer)[-1]
    assert controllers(answer)[-1].controller == "at3"


def acting(written: Program, state: FloatArray) -> str | None:
    """Which controller a program runs first in a state; None where it is over at once."""
    machine = Machine(written, TRIO.layout, 1, limits={}, confirm=1)
    machine.advance(np.zeros(1, dtype=np.int64), state[None])
    return None if machine.ended[0] else controllers(written)[int(machine.run_index[0])].controller


def test_a_loop_that_nothing_explains_fails_with_the_reason() -> None:
    shown = evidence(THREE, lambda goals: bottom_up(goals)[:1])
    answer = gen_program(ROOT, shown, chain(node("at", AT, "b1", circular=True)))
    assert answer == Fail("no demonstration handles entities one after another until at")


LOW = Node("low", parse_predicate(AT.format("p1", "p1")), circular=True, only=parse_predicate("g(p1)↓z < 0.1"))
HIGH = Node("high", parse_predicate("p1↓z > 0.15"), circular=True, only=parse_predicate("g(p1)↓z > 0.1"))


def either(*nodes: Node) -> Tree:
    """Build the tree in which each node leads to ψ_R."""
    return Tree((*Tree().nodes, *nodes), tuple(edge for n in nodes for edge in ((TRUE, n.name), (n.name, ROOT))))


@pytest.mark.parametrize(
    ("nodes", "body"),
    [
        ((LOW,), "if (g(p)↓z < 0.1) { π_low(μ, p, g(p)) until at(p) }"),
        (
            (LOW, HIGH),
            "if (g(p)↓z < 0.1) { π_low(μ, p, g(p)) until at(p) } else { π_high(μ, p) until p↓z > 0.15 }",
        ),
    ],
    ids=["one way", "two ways"],
)
def test_what_is_done_to_the_only_one_of_its_type_is_no_loop(nodes: tuple[Node, ...], body: str) -> None:
    assert gen_program(ROOT, evidence(BOTH), either(*nodes)) == program(f"p := get(λp:peg. true); {body}")
