"""PREDICATESYNTHESIS: loop guards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from itertools import permutations

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.printer import text
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Not, Predicate, Truth
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.loop_guard import entity_choice, loop_examples, predicate_synthesis
from roboscribe.subtask_tree import Node
from roboscribe.world.layout import Attribute, BoolArray, FloatArray, Layout, ObjectType
from roboscribe.world.trajectory import Trajectory
from tests.handmade import AT, HOLD, Choice, bottom_up, chain, evidence, legs, nearest_first, node, state, top_down

TASK = PointTask("toy", ("block",) * 3)
AT_NODE = node("at", AT, "b1", circular=True)
TREE = chain(node("hold", HOLD, "b1"), AT_NODE)


def lowest_first(below: str) -> Predicate:
    """Eq. 4, or its mirror image."""
    at, other = AT.format("b1"), AT.format("o")
    return parse_predicate(f"¬({at}) ∧ ¬∃o:block. {below} ∧ ¬({other})")


def agree(one: Predicate, other: Predicate) -> bool:
    """Compare two guards on every order of goals with every first part of the blocks placed."""
    goals = np.array([[1.5, 0.0], [1.5, 0.2], [1.5, 0.4]])
    starts = np.array([[0.1, 0.7], [0.4, 0.1], [0.8, 0.5]])
    rows = [
        state(TASK.layout, np.zeros(2), np.where(np.array(placed)[:, None], heights, starts), heights)
        for heights in (goals[list(p)] for p in permutations(range(3)))
        for placed in np.ndindex(2, 2, 2)
    ]
    first, second = (
        [holds(p, np.stack(rows), {"b1": entity}, TASK.layout) for entity in range(3)] for p in (one, other)
    )
    return bool(np.array_equal(first, second))


def test_a_tower_built_bottom_up_gives_eq_4() -> None:
    guard = predicate_synthesis(evidence(TASK, bottom_up), TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    assert agree(guard, lowest_first("g(o)↓z < g(b1)↓z"))


def test_a_tower_built_top_down_gives_its_mirror_image() -> None:
    guard = predicate_synthesis(evidence(TASK, top_down), TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    assert agree(guard, lowest_first("g(b1)↓z < g(o)↓z"))


def test_of_two_the_last_one_is_admitted_too() -> None:
    """That another one has a higher goal tells the first of two as well, but would leave the second one to wait."""
    guard = predicate_synthesis(evidence(PointTask("toy", ("block",) * 2), bottom_up), TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    assert agree(guard, lowest_first("g(o)↓z < g(b1)↓z"))


def test_no_order_leaves_the_end_of_the_loop() -> None:
    rng = np.random.default_rng(1)
    shown = evidence(TASK, lambda goals: [int(i) for i in rng.permutation(len(goals))])
    assert predicate_synthesis(shown, TREE, AT_NODE) == Not(AT_NODE.predicate)


def test_an_order_among_some_is_kept() -> None:
    rng = np.random.default_rng(1)

    def by_lot_but_high_last(goals: FloatArray) -> list[int]:
        return [int(i) for i in np.lexsort((rng.random(len(goals)), goals[:, 1]))]

    shown = evidence(TASK, by_lot_but_high_last, episodes=50, levels=(0, 0, 1))
    guard = predicate_synthesis(shown, TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    assert agree(guard, lowest_first("g(o)↓z < g(b1)↓z"))


def test_every_entity_is_positive_exactly_while_it_is_handled() -> None:
    shown = evidence(TASK, episodes=1)
    (trajectory,) = shown.trajectories
    examples = loop_examples(shown, AT_NODE.predicate, "b1", shown.turns_to_loop(TREE, AT_NODE))
    ends = [int(shown.first_steps(parse_predicate(AT.format(name)))[0]) for name in ("b1", "b2", "b3")]
    for entity, begin, end in zip(range(3), [0, *ends], ends, strict=False):
        mine = examples[examples.entities == entity]
        steps = np.arange(len(trajectory))
        assert np.array_equal(mine.states, trajectory.states)
        assert np.array_equal(mine.positive, (begin <= steps) & (steps < end))
        assert np.array_equal(mine.done, steps >= end)
        assert np.array_equal(mine.choice, np.isin(steps, [0, *ends[:-1]]) & (steps < end))


def test_of_what_comes_before_the_loop_nothing_is_said() -> None:
    """A choice made where the hand came from is none that the loop makes."""
    shown = evidence(TASK, episodes=1)
    (trajectory,) = shown.trajectories
    examples = loop_examples(shown, AT_NODE.predicate, "b1", np.array([4]))
    first = examples[examples.entities == 0]
    assert np.array_equal(first.states, trajectory.states[4:])
    assert first.positive[0]
    assert first.choice[0]
    assert not first.choice[1:].any()


def test_the_last_entity_is_handled_until_the_end_where_it_never_arrives() -> None:
    """A demonstration may stop as soon as the task is solved, before the last one satisfies φ."""
    shown = evidence(TASK, lambda goals: bottom_up(goals)[:2], episodes=1)
    (trajectory,) = shown.trajectories
    examples = loop_examples(shown, AT_NODE.predicate, "b1", shown.turns_to_loop(TREE, AT_NODE))
    last = examples[examples.entities == 2]
    second = int(shown.first_steps(parse_predicate(AT.format("b2")))[0])
    assert np.array_equal(last.positive, np.arange(len(trajectory)) >= second)
    assert not last.done.any()


def test_demonstrations_that_leave_several_entities_out_show_nothing() -> None:
    shown = evidence(TASK, lambda goals: bottom_up(goals)[:1])
    assert len(loop_examples(shown, AT_NODE.predicate, "b1", shown.turns_to_loop(TREE, AT_NODE)).states) == 0
    assert predicate_synthesis(shown, TREE, AT_NODE) == Fail(
        "no demonstration handles entities one after another until at"
    )


class Weighed(PointTask):
    """Blocks that have a weight, too."""

    @cached_property
    def layout(self) -> Layout:
        """Add a weight to the blocks of the plain task."""
        plain = TASK.layout
        block = plain.entities[0]
        heavy = replace(block, attributes=(*block.attributes, Attribute("mass", ("mass",), "kg")))
        return Layout(plain.robot, (heavy,) * 3)


WEIGHED = Weighed("weighed", TASK.kinds)
Rule = Callable[[FloatArray], Choice]
"""From the blocks' masses (N,) to the choice among them."""
MASSES = [WEIGHED.layout.columns[i, "mass", False] for i in range(3)]


def lightest(masses: FloatArray) -> Choice:
    """Take the lightest block."""
    return lambda hand, places, goals, left: min(left, key=lambda i: masses[i])


def leftmost(masses: FloatArray) -> Choice:
    """Take the block with the least x."""
    return lambda hand, places, goals, left: min(left, key=lambda i: places[i, 0])


def nearest(masses: FloatArray) -> Choice:
    """Take the block nearest to the hand."""
    return nearest_first


def by_lot(masses: FloatArray) -> Choice:
    """Take any block, without a reason that shows."""
    return lambda hand, places, goals, left: left[int(1e6 * masses.sum()) % len(left)]


def weighed(rule: Rule, seed: int, episodes: int) -> Evidence:
    """Draw demonstrations in which goals lie in a row, on one level, and blocks are taken by a rule."""
    rng = np.random.default_rng(seed)
    shown = []
    for _ in range(episodes):
        masses, places, hand = rng.uniform(0.1, 1.0, 3), rng.uniform(0.0, 1.0, (3, 2)), rng.uniform(0.0, 1.0, 2)
        goals = np.array([[1.3, 0.0], [1.6, 0.0], [1.9, 0.0]])[rng.permutation(3)]
        states = legs(WEIGHED.layout, hand, places, goals, rule(masses))
        for column, mass in zip(MASSES, masses, strict=True):
            states[:, column] = mass
        shown.append(Trajectory(WEIGHED.layout, states))
    return Evidence.of(shown, WEIGHED.solved)


def admitted(guard: Predicate, shown: Evidence) -> list[list[int]]:
    """Which blocks a guard admits, whenever a demonstrator turns to the next one; blocks go by the order of service."""
    found = []
    named = {name: i for i, name in enumerate(shown.layout.names)}
    for trajectory, steps in zip(shown.trajectories, served_at(shown), strict=True):
        for step in (0, *steps[:-1]):
            state = trajectory.states[step]
            found.append([e for e in range(3) if holds(guard, state, {**named, "b1": e}, shown.layout)])
    return found


def served_at(shown: Evidence) -> list[list[int]]:
    """List the steps at which the blocks are placed, ascending, by demonstration."""
    return [sorted(row) for row in shown.each_first_steps(AT_NODE.predicate, "b1").tolist()]


@pytest.mark.parametrize("rule", [lightest, leftmost, nearest])
def test_an_order_by_what_is_no_goal_is_found(rule: Rule) -> None:
    """On fresh demonstrations the guard admits the block that is served next, and no other."""
    guard = predicate_synthesis(weighed(rule, 0, 40), TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    right = [chosen == [i % 3] for i, chosen in enumerate(admitted(guard, weighed(rule, 1, 30)))]
    assert np.mean(right) >= 0.95


MARKED = Layout(TASK.layout.robot, (*TASK.layout.entities, ObjectType("marker", TASK.layout.entities[0].attributes)))
"""Blocks, and a marker that never moves."""


def placed(states: FloatArray) -> BoolArray:
    """Tell where all blocks are at their goals."""
    return TASK.solved(states[..., : TASK.layout.size])


def nearest_to(place: FloatArray, places: FloatArray) -> Choice:
    """Take the block first that lay nearest to a place."""
    distances = np.linalg.norm(places - place, axis=1)
    return lambda hand, now, goals, left: min(left, key=lambda i: distances[i])


def marked(seed: int, episodes: int) -> Evidence:
    """Draw demonstrations in which the block nearest to the marker is taken first."""
    rng = np.random.default_rng(seed)
    shown = []
    for _ in range(episodes):
        places, marker, hand = rng.uniform(0.0, 1.0, (3, 2)), rng.uniform(0.0, 1.0, 2), rng.uniform(0.0, 1.0, 2)
        goals = np.array([[1.3, 0.0], [1.6, 0.0], [1.9, 0.0]])[rng.permutation(3)]
        states = legs(MARKED, hand, places, goals, nearest_to(marker, places))
        states[:, MARKED.columns[3, "position", False]] = marker
        shown.append(Trajectory(MARKED, states))
    return Evidence.of(shown, placed)


def test_an_order_by_the_distance_to_something_without_like_is_found() -> None:
    guard = predicate_synthesis(marked(0, 40), TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    assert "‖m1↓xz − " in str(guard)
    right = [chosen == [i % 3] for i, chosen in enumerate(admitted(guard, marked(1, 30)))]
    assert np.mean(right) >= 0.95


def test_a_loop_may_bring_entities_to_another_one() -> None:
    """What it brings about is about two entities; one of them is the one that a guard is about."""
    into = Node("into", parse_predicate("norm(b1.xz - m1.xz) < 0.2"), circular=True, over="b1")
    rng = np.random.default_rng(0)
    shown = []
    for _ in range(20):
        places, goals = rng.uniform(0.0, 1.0, (3, 2)), np.array([[2.0, 0.1], [2.1, 0.0], [2.0, 0.0]])
        states = legs(MARKED, np.zeros(2), places, goals, leftmost(places))
        states[:, MARKED.columns[3, "position", False]] = goals[-1]
        shown.append(Trajectory(MARKED, states))
    guard = predicate_synthesis(Evidence.of(shown, placed), chain(into), into)
    assert not isinstance(guard, Fail)
    assert "¬∃b':block. b'↓x < b1↓x" in text(guard)


@pytest.mark.parametrize("seed", range(5))
def test_two_demonstrations_show_no_order_by_accident(seed: int) -> None:
    """So few choices are explained by some comparison or other."""
    assert predicate_synthesis(weighed(by_lot, seed, 2), TREE, AT_NODE) == Not(AT_NODE.predicate)


def farthest_goal(masses: FloatArray) -> Choice:
    """Take the block whose goal has the greatest x."""
    return lambda hand, places, goals, left: max(left, key=lambda i: goals[i, 0])


@pytest.mark.parametrize("begin", [54, 40])
def test_what_is_undone_in_passing_waits_again(begin: int) -> None:
    """While the third block is carried, the first one is brushed aside for a while: nobody else may be chosen then.

    Where it is when the third block is turned to, that is no choice against it.
    """
    shown = weighed(farthest_goal, 0, 20)
    first = WEIGHED.layout.columns[0, "position", False]
    for trajectory in shown.trajectories:
        trajectory.states[begin:68, first] += 0.2
    guard = predicate_synthesis(Evidence.of(shown.trajectories, WEIGHED.solved), TREE, AT_NODE)
    at, other = AT.format("b1"), AT.format("b'")
    assert guard == parse_predicate(f"¬({at}) ∧ ¬∃b':block. g(b1)↓x < g(b')↓x ∧ ¬({other})")


def mostly_farthest(seed: int) -> Rule:
    """Take the block with the longest way, but for one choice in thirty."""
    rng = np.random.default_rng(seed)

    def rule(masses: FloatArray) -> Choice:
        def choose(hand: FloatArray, places: FloatArray, goals: FloatArray, left: list[int]) -> int:
            ranked = sorted(left, key=lambda i: -float(np.linalg.norm(places[i] - goals[i])))
            return ranked[-1 if rng.uniform() < 1 / 30 else 0]

        return choose

    return rule


@pytest.mark.parametrize("seed", range(3))
def test_an_order_with_exceptions_stays_an_order(seed: int) -> None:
    """Two comparisons more would explain the exceptions, and leave nobody to be taken elsewhere."""
    guard = predicate_synthesis(weighed(mostly_farthest(seed), seed, 50), TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    right = [chosen == [i % 3] for i, chosen in enumerate(admitted(guard, weighed(farthest, seed + 10, 30)))]
    assert np.mean(right) >= 0.95


def farthest(masses: FloatArray) -> Choice:
    """Take the block with the longest way."""
    return lambda hand, places, goals, left: max(left, key=lambda i: float(np.linalg.norm(places[i] - goals[i])))


@pytest.mark.parametrize("rule", [lightest, leftmost, nearest, farthest])
def test_an_order_admits_somebody_wherever_somebody_waits(rule: Rule) -> None:
    """Also while a block is under way: what was let go there has to be taken again."""
    shown = weighed(rule, 0, 40)
    guard = predicate_synthesis(shown, TREE, AT_NODE)
    assert not isinstance(guard, Fail)
    named = {name: i for i, name in enumerate(shown.layout.names)}
    admitting = np.stack([holds(guard, shown.states, {**named, "b1": e}, shown.layout) for e in range(3)]).any(axis=0)
    waiting = np.stack(
        [~holds(AT_NODE.predicate, shown.states, {**named, "b1": e}, shown.layout) for e in range(3)]
    ).any(axis=0)
    assert admitting[waiting].mean() >= 0.98


def test_the_first_block_of_a_tower_is_the_one_with_the_lowest_goal() -> None:
    choice = entity_choice(evidence(TASK), "b1")
    assert agree(choice, parse_predicate("¬∃o:block. g(o)↓z < g(b1)↓z"))


def test_any_entity_will_do_where_the_demonstrations_prefer_none() -> None:
    rng = np.random.default_rng(1)
    shown = evidence(TASK, lambda goals: [int(i) for i in rng.permutation(len(goals))])
    assert entity_choice(shown, "b1") == Truth()
    assert entity_choice(evidence(PointTask("toy", ("block",)), episodes=20), "b1") == Truth()
