"""Conditions of Section 4.5: when one branch comes before another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from roboscribe.branch_condition import order_condition
from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.program_gen import gen_program
from roboscribe.subtask_tree import ROOT, TRUE, Tree
from roboscribe.world.layout import BoolArray, FloatArray
from roboscribe.world.trajectory import Trajectory
from tests.handmade import AT, bottom_up, carry, evidence, legs, nearest_first, node

PEG, CUBE = node("at", AT, "p1"), node("at2", AT, "c1")
BELL = PointTask("toy", ("peg", "cube", "bell"))


def with_bell(peg_first: Callable[[FloatArray], bool], episodes: int = 20) -> Evidence:
    """Demonstrate peg and cube in an order that goes by the goals (3, 2); the bell hangs at one of three heights."""
    rng = np.random.default_rng(0)

    def order(goals: FloatArray) -> list[int]:
        return [0, 1] if peg_first(goals) else [1, 0]

    return Evidence.of([carry(BELL, rng, order, placed=(2,)) for _ in range(episodes)], BELL.solved)


def test_the_height_of_a_bell_that_nobody_touches_decides() -> None:
    shown = with_bell(lambda goals: bool(goals[2, 1] > 0.3))
    assert order_condition(shown, PEG, CUBE) == parse_predicate("b1↓z > 0.3")
    assert order_condition(shown, CUBE, PEG) == parse_predicate("b1↓z < 0.3")


def without_bell(states: FloatArray) -> BoolArray:
    """Tell where peg and cube are at their goals."""
    two = PointTask("toy", ("peg", "cube"))
    return two.solved(states[..., : two.layout.size])


def test_a_threshold_has_as_many_digits_as_it_takes() -> None:
    """Readings of 300.1 and 300.4 are told apart by 300.2, not by 300."""
    height = BELL.layout.columns[2, "position", False].start + 1
    shown = []
    for each in with_bell(lambda goals: bool(goals[2, 1] > 0.3)).trajectories:
        states = each.states.copy()
        states[:, height] = np.where(states[:, height] > 0.3, 300.4, 300.1)
        shown.append(Trajectory(BELL.layout, states))
    answer = order_condition(Evidence(tuple(shown), without_bell), PEG, CUBE)
    assert str(answer) == "b1↓z > 300.2"


def test_a_condition_may_be_about_what_no_branch_is_about() -> None:
    tree = Tree((*Tree().nodes, PEG, CUBE), ((TRUE, "at"), ("at", ROOT), (TRUE, "at2"), ("at2", ROOT)))
    program = gen_program(ROOT, with_bell(lambda goals: bool(goals[2, 1] > 0.3)), tree)
    at, at2 = (f"π_{name}(μ, {v}, g({v})) until {AT.format(v)}" for name, v in (("at", "p"), ("at2", "c")))
    gets = "; ".join(f"{v} := get(λ{v}:{kind}. true)" for v, kind in (("c", "cube"), ("p", "peg"), ("b", "bell")))
    branches = f"if (b↓z < 0.3) {{ {at2}; {at} }} else {{ {at}; {at2} }}"
    assert program == parse_program(f"def P(μ : EE): {gets}; {branches}")


def test_what_a_demonstration_changes_is_no_condition() -> None:
    """Where the peg lies tells which comes first, but once the peg was moved it tells nothing any more."""
    rng = np.random.default_rng(0)
    goals, task = np.array([[1.5, 0.0], [1.5, 0.0]]), PointTask("toy", ("peg", "cube"))

    def far_peg_first(hand: FloatArray, places: FloatArray, goals: FloatArray, left: list[int]) -> int:
        return left[0] if len(left) == 1 or places[0, 0] > 0.5 else left[1]

    def drawn() -> FloatArray:
        places = np.column_stack([rng.uniform(0.0, 1.0, 2), rng.permutation([0.3, 0.7])])
        return legs(task.layout, rng.uniform(0.0, 1.0, 2), places, goals, far_peg_first)

    shown = Evidence.of([Trajectory(task.layout, drawn()) for _ in range(40)], task.solved)
    answer = order_condition(shown, PEG, CUBE)
    assert answer == Fail("no comparison of attributes explains why at sometimes comes before at2")


def test_the_kind_nearer_to_the_hand_may_come_first() -> None:
    rng = np.random.default_rng(0)
    task = PointTask("toy", ("peg", "cube"))

    def shown(episodes: int) -> Evidence:
        goals = np.array([[1.5, 0.0], [1.5, 0.4]])
        drawn = [
            legs(task.layout, rng.uniform(0, 1, 2), rng.uniform(0, 1, (2, 2)), goals, nearest_first)
            for _ in range(episodes)
        ]
        return Evidence.of([Trajectory(task.layout, states) for states in drawn], task.solved)

    assert order_condition(shown(30), PEG, CUBE) == parse_predicate("‖μ↓xz − p1↓xz‖ < ‖μ↓xz − c1↓xz‖")
    assert order_condition(shown(30), PEG, CUBE, np.full(30, 10**6)) != parse_predicate(
        "‖μ↓xz − p1↓xz‖ < ‖μ↓xz − c1↓xz‖"
    )
    assert isinstance(order_condition(shown(6), PEG, CUBE), Fail), "some distance would by accident"


def test_the_lower_goal_decides_between_two_kinds() -> None:
    task = PointTask("toy", ("peg", "cube"))
    peg, cube = node("at", AT, "p1"), node("at2", AT, "c1")
    shown = evidence(task, bottom_up)
    assert order_condition(shown, peg, cube) == parse_predicate("g(p1)↓z < g(c1)↓z")
    assert order_condition(shown, cube, peg) in (
        parse_predicate("g(c1)↓z < g(p1)↓z"),
        parse_predicate("¬(g(p1)↓z < g(c1)↓z)"),
    )


def test_an_order_drawn_by_lot_has_no_condition() -> None:
    task = PointTask("toy", ("peg", "cube"))
    rng = np.random.default_rng(0)
    shown = evidence(task, lambda goals: [int(i) for i in rng.permutation(2)])
    answer = order_condition(shown, node("at", AT, "p1"), node("at2", AT, "c1"))
    assert answer == Fail("no comparison of attributes explains why at sometimes comes before at2")


def test_few_demonstrations_do_not_tell_why_branches_come_in_their_order() -> None:
    """Some comparison explains two demonstrations by accident."""
    shown = evidence(PointTask("toy", ("peg", "cube")), bottom_up, episodes=2)
    answer = order_condition(shown, node("at", AT, "p1"), node("at2", AT, "c1"))
    assert answer == Fail("too few demonstrations to tell why at sometimes comes before at2")


def test_what_is_seldom_turned_round_is_no_condition_of_a_number_that_lies_far_off_by_accident() -> None:
    """Of 40 demonstrations three place the cube first, the one with the highest bell among them."""
    shown = list(with_bell(lambda goals: True, 40).trajectories)
    height = BELL.layout.columns[2, "position", False].start + 1
    rare = with_bell(lambda goals: False, 3).trajectories
    rng = np.random.default_rng(0)
    drawn = []
    for each, z in zip([*rare, *shown[3:]], [0.99, *rng.uniform(0.1, 0.9, 39)], strict=True):
        states = each.states.copy()
        states[:, height] = z
        drawn.append(Trajectory(BELL.layout, states))
    answer = order_condition(Evidence(tuple(drawn), without_bell), CUBE, PEG)
    assert answer == Fail("no comparison of attributes explains why at2 sometimes comes before at")
