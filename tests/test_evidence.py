"""Demonstrations, read once for every entity that plays a role."""

from __future__ import annotations

import numpy as np

from roboscribe.dsl.semantics import holds
from roboscribe.envs.point_world import PointTask
from roboscribe.evidence import Evidence
from roboscribe.subtask_tree import ROOT, TRUE, Tree
from roboscribe.world.layout import FloatArray
from roboscribe.world.trajectory import NEVER, Trajectory
from tests.handmade import AT, HOLD, bottom_up, carry, chain, evidence, node

THREE = PointTask("toy", ("block",) * 3)
HOLD1, AT1 = node("hold", HOLD, "b1"), node("at", AT, "b1")
LOOP = chain(HOLD1, node("at", AT, "b1", circular=True))
STEPS = 12
"""Frames a leg: to a block, or with it to its goal."""


def some_placed(*placed: int) -> Evidence:
    """Demonstrations in which some blocks lie at their goals from the start."""
    rng = np.random.default_rng(0)
    return Evidence.of([carry(THREE, rng, bottom_up, STEPS, placed=placed) for _ in range(5)], THREE.solved)


def position(shown: Evidence, states: FloatArray, entity: int) -> FloatArray:
    """Where a block lies."""
    return states[..., shown.layout.columns[entity, "position", False]]


def test_outside_loops_every_demonstration_is_one_passage() -> None:
    shown = evidence(THREE, episodes=3)
    passages = shown.passages(chain(HOLD1, AT1), "hold")
    assert [(p.demonstration, p.begin, p.end) for p in passages] == [(d, 0, 6 * STEPS + 1) for d in range(3)]


def test_a_loop_has_a_turn_for_every_entity() -> None:
    shown = evidence(THREE, episodes=1)
    assert [shown.turns(LOOP.node(name)) for name in ("hold", "at")] == [1, 3]


def test_inside_a_loop_every_entity_gives_a_passage_from_takeover_to_its_service() -> None:
    shown = evidence(THREE, episodes=2)
    passages = shown.passages(LOOP, "at")
    assert [p.demonstration for p in passages] == [0, 0, 0, 1, 1, 1]
    served = [shown.first_steps(node("", AT, name).predicate) for name in ("b1", "b2", "b3")]
    for i, passage in enumerate(passages):
        d, turn = divmod(i, 3)
        assert passage.begin == (served[turn - 1][d] if turn else 0)
        assert passage.end == served[turn][d] + 1
        assert passage.order[0] == turn, "the one that is served goes by the name b1"
        assert sorted(passage.order) == [0, 1, 2]


def test_entities_satisfied_from_the_start_give_no_passage() -> None:
    shown = some_placed(0, 2)
    assert [p.demonstration for p in shown.passages(LOOP, "at")] == [0, 1, 2, 3, 4]
    assert some_placed(0, 1, 2).passages(LOOP, "at") == ()


def test_renaming_puts_the_served_entity_first() -> None:
    shown = evidence(THREE, episodes=1)
    (trajectory,) = shown.trajectories
    for turn, passage in enumerate(shown.passages(LOOP, "hold")):
        states = shown.states_of(passage)
        plain = trajectory.states[passage.begin : passage.end]
        assert np.array_equal(position(shown, states, 0), position(shown, plain, turn))
        assert np.array_equal(position(shown, states, turn), position(shown, plain, 0))


def test_crossings_of_a_loop_end_where_each_of_its_entities_is_first_dealt_with() -> None:
    shown = evidence(THREE, episodes=4)
    for name, legs in (("hold", 1), ("at", 2)):
        crossings = shown.crossings(LOOP, name)
        phi = LOOP.node(name).predicate
        assert len(crossings.passages) == 4 * 3
        assert holds(phi, crossings.reached, {}, shown.layout).all()
        assert not holds(phi, crossings.before, {}, shown.layout).any()
        assert (crossings.lengths <= legs * STEPS + 1).all()
        ends = np.append(crossings.starts[1:], len(crossings.frames))
        assert np.array_equal(crossings.starts + crossings.lengths, ends)


def test_what_holds_at_takeover_is_no_crossing() -> None:
    shown = some_placed(0)
    placed = {f"b{e + 1}" for e in range(3) if shown.first_steps(node("", AT, f"b{e + 1}").predicate)[0] == 0}
    assert len(placed) == 1
    for name in ("b1", "b2", "b3"):
        at = node("at", AT, name)
        assert len(shown.crossings(chain(at), "at").starts) == (0 if name in placed else 5)


def test_first_steps_of_a_crossing_count_from_takeover() -> None:
    shown = evidence(THREE, episodes=4)
    crossings = shown.crossings(LOOP, "at")
    held = crossings.first_steps(HOLD1.predicate, shown.layout, shown.solved)
    assert (held == STEPS).sum() >= 4, "the hand reaches a block at the end of a leg"
    assert ((held > 0) & (held < crossings.lengths)).all()
    other = crossings.first_steps(node("", AT, "b1").predicate, shown.layout, shown.solved)
    assert np.array_equal(other, crossings.lengths - 1)


def test_an_edge_is_looked_at_in_every_crossing_into_its_end() -> None:
    shown = evidence(THREE, episodes=4)
    hold, at = shown.edge_steps(LOOP, HOLD1, "at")
    assert len(hold) == len(at) == 4 * 3
    assert (hold < at).all()
    one, root = shown.edge_steps(LOOP, LOOP.node("at"), ROOT)
    assert len(one) == len(root) == 4
    assert (one < root).all(), "the first of three blocks is placed before the task is solved"


def test_a_demonstration_turns_to_a_loop_where_what_comes_before_it_is_done() -> None:
    mixed = PointTask("toy", ("apple", "block", "block"))
    shown = evidence(mixed, lambda goals: [0, 1, 2], episodes=2)
    apple, loop = node("placed", AT, "a1"), node("at", AT, "b1", circular=True)
    tree = Tree((*Tree().nodes, apple, loop), ((TRUE, "placed"), ("placed", ROOT), (TRUE, "at"), ("at", ROOT)))
    placed = shown.first_steps(apple.predicate)
    assert (placed > 0).all()
    assert np.array_equal(shown.turns_to_loop(tree, loop), placed)
    last = evidence(mixed, lambda goals: [1, 2, 0], episodes=2)
    assert not last.turns_to_loop(tree, loop).any(), "what is done after it does not keep it waiting"


def test_demonstrations_that_never_reach_the_goal_are_left_out_and_listed() -> None:
    rng = np.random.default_rng(0)
    whole = [carry(THREE, rng, bottom_up) for _ in range(4)]
    given = [whole[0], unfinished(whole[1]), whole[2], unfinished(whole[3])]
    shown = Evidence.of(given, THREE.solved)
    assert shown.left_out == (1, 3)
    assert [len(t) for t in shown.trajectories] == [len(whole[0]), len(whole[2])]
    assert (shown.solved_at < NEVER).all()
    assert Evidence.of(whole, THREE.solved).left_out == ()


def test_where_no_demonstration_reaches_the_goal_all_are_kept() -> None:
    rng = np.random.default_rng(0)
    shown = Evidence.of([unfinished(carry(THREE, rng, bottom_up)) for _ in range(3)], THREE.solved)
    assert (len(shown.trajectories), shown.left_out) == (3, ())
    assert len(shown.crossings(Tree(), ROOT).starts) == 0


def unfinished(trajectory: Trajectory) -> Trajectory:
    """Stop a demonstration half-way."""
    return Trajectory(trajectory.layout, trajectory.states[: len(trajectory) // 2])


def test_what_jitters_about_its_place_has_not_moved() -> None:
    """Sensors are noisy; a coaster that nobody touches stays where it is."""
    rng = np.random.default_rng(0)
    task = PointTask("toy", ("mug", "coaster"))
    shown = []
    for _ in range(5):
        states = carry(task, rng, lambda goals: [0], STEPS, placed=(1,)).states.copy()
        noise = rng.normal(0.0, 1e-4, states.shape)
        goals = [place for (_, _, goal), place in task.layout.columns.items() if goal]
        for place in goals:
            noise[:, place] = 0.0
        shown.append(Trajectory(task.layout, states + noise))
    assert Evidence.of(shown, task.solved).moved == {"m1"}


def test_crossings_can_be_cut_from_later_on() -> None:
    """What is over by then is left out."""
    shown = evidence(THREE, episodes=2)
    whole = shown.crossings(chain(HOLD1, AT1), ROOT)
    late = shown.cut(whole, np.array([10, int(whole.lengths[1]) - 1]))
    assert [p.demonstration for p in late.passages] == [0]
    assert np.array_equal(late.frames, whole.frames[10 : whole.lengths[0]])
    assert late.starts.tolist() == [0]
