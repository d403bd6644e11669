"""LEARNCLASSIFIER: comparing demonstrations with failures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roboscribe.classifier import Refinement, learn_classifier
from roboscribe.dsl.rewrite import rename
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import Const, Less, Predicate
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.world.layout import FloatArray
from tests.handmade import AT, HOLD, carry, chain, evidence, node, state

ONE = PointTask("toy", ("block",))
TWO = PointTask("toy", ("block",) * 2)
SHOWN = evidence(ONE, episodes=20)
HOLD1, AT1 = node("hold", HOLD, "b1"), node("at", AT, "b1")


def wandering(task: PointTask, episodes: int = 20, seed: int = 1) -> FloatArray:
    """States of a hand that never touches anything."""
    rng = np.random.default_rng(seed)
    starts = [carry(task, rng, lambda _: []).states[0] for _ in range(episodes)]
    moved = np.repeat(np.stack(starts), 30, axis=0)
    moved[:, :2] = rng.uniform(0.0, 1.5, (len(moved), 2))
    return moved


def clutching(task: PointTask, seed: int = 2) -> FloatArray:
    """States of a hand that holds the first block somewhere."""
    states = wandering(task, seed=seed)
    place = task.layout.columns[0, "position", False]
    states[:, place] = states[:, :2]
    return states


def learned(answer: Refinement | Fail) -> Refinement:
    """Require a refinement."""
    assert isinstance(answer, Refinement), answer.reason
    return answer


def share(predicate: Predicate, states: FloatArray, shown: Evidence) -> float:
    """Share of states in which a predicate holds."""
    return float(holds(predicate, states, {}, shown.layout).mean())


def test_what_wandering_lacks_is_the_block_in_hand() -> None:
    answer = learned(learn_classifier(wandering(ONE), SHOWN, Tree(), ROOT))
    assert str(answer.node.predicate).startswith("‖μ↓xz − b1↓xz‖ < ")
    assert (answer.node.name, answer.psi, answer.reused, answer.positives) == ("hold", ROOT, False, 20)


def test_what_clutching_lacks_is_the_block_at_its_goal() -> None:
    answer = learned(learn_classifier(clutching(ONE), SHOWN, chain(HOLD1), ROOT))
    assert str(answer.node.predicate).startswith("‖b1↓xz − g(b1)↓xz‖ < ")
    assert answer.node.name == "at"


def test_a_predicate_holds_just_before_the_goal_and_hardly_ever_in_failures() -> None:
    failures = wandering(ONE)
    answer = learned(learn_classifier(failures, SHOWN, Tree(), ROOT))
    assert share(answer.node.predicate, SHOWN.states_before(Tree().node(ROOT).predicate), SHOWN) == 1.0
    assert share(answer.node.predicate, failures, SHOWN) < 0.01


def test_the_table_is_ranked_and_its_first_row_is_the_answer() -> None:
    answer = learned(learn_classifier(wandering(ONE), SHOWN, Tree(), ROOT))
    ranks = [candidate.rank for candidate in answer.table]
    assert ranks == sorted(ranks)
    assert answer.table[0].predicate == answer.node.predicate
    assert dict(answer.table[0].scales) == answer.node.scales


def test_placing_the_next_block_reuses_what_was_learned_about_the_first() -> None:
    shown = evidence(TWO, steps=120)
    failures = wandering(TWO)
    place, goal = (TWO.layout.columns[0, "position", is_goal] for is_goal in (False, True))
    failures[:, place] = failures[:, goal]
    answer = learned(learn_classifier(failures, shown, chain(HOLD1, AT1), ROOT))
    assert answer.reused
    assert answer.node == AT1
    assert answer.table == ()


def test_a_reused_threshold_is_widened_to_where_it_holds_for_the_others() -> None:
    shown = evidence(TWO, steps=120)
    failures = wandering(TWO)
    place, goal = (TWO.layout.columns[0, "position", is_goal] for is_goal in (False, True))
    failures[:, place] = failures[:, goal]
    before = shown.states_before(Tree().node(ROOT).predicate)
    assert isinstance(AT1.predicate, Less)
    second = rename(AT1.predicate.left, {"b1": "b2"})
    worst = np.sort(evaluate(second, before, {}, TWO.layout)[..., 0])[-2:]
    tight = replace(AT1, predicate=replace(AT1.predicate, right=Const(float(worst.mean()))))
    answer = learned(learn_classifier(failures, shown, chain(HOLD1, tight), ROOT))
    assert answer.reused
    assert answer.node.name == "at"
    assert share(rename(answer.node.predicate, {"b1": "b2"}), before, shown) == 1.0
    assert share(rename(answer.node.predicate, {"b1": "b2"}), failures, shown) < 0.05


def test_nothing_is_reused_where_the_failures_handle_the_next_block_too() -> None:
    shown = evidence(TWO, steps=120)
    failures = wandering(TWO)
    for i in (0, 1):
        place, goal = (TWO.layout.columns[i, "position", is_goal] for is_goal in (False, True))
        failures[:, place] = failures[:, goal] + 0.02
    answer = learn_classifier(failures, shown, chain(HOLD1, AT1), ROOT)
    assert isinstance(answer, Fail) or not answer.reused


def test_a_goal_that_no_demonstration_reaches_cannot_be_explained() -> None:
    cut = Evidence(tuple(type(t)(t.layout, t.states[:3]) for t in SHOWN.trajectories), ONE.solved)
    answer = learn_classifier(wandering(ONE), cut, Tree(), ROOT)
    assert answer == Fail("no demonstration reaches ψ_R, so there is nothing to compare failures with")


def test_failures_that_look_like_success_cannot_be_told_apart() -> None:
    before = SHOWN.states_before(Tree().node(ROOT).predicate)
    answer = learn_classifier(before, SHOWN, Tree(), ROOT)
    assert isinstance(answer, Fail)
    assert answer.reason.startswith("no predicate separates the states before ψ_R from the failing rollouts")


def test_after_a_loop_its_entities_have_no_names() -> None:
    shown = evidence(TWO)
    finished = np.repeat(np.stack([t.states[-1] for t in shown.trajectories]), 30, axis=0)
    looped = chain(HOLD1, node("at", AT, "b1", circular=True))
    task = PointTask("leave", TWO.kinds)
    left = Evidence(
        tuple(type(t)(t.layout, np.vstack([t.states, _hand_away(task, t.states[-1])])) for t in shown.trajectories),
        lambda states: states[..., 0] > 3.0,
    )
    answer = learned(learn_classifier(finished, left, looped, ROOT))
    assert "b1" not in str(answer.node.predicate)
    assert "b2" not in str(answer.node.predicate)


def _hand_away(task: PointTask, last: FloatArray) -> FloatArray:
    """Move the hand off to the right, ten steps, until x > 3."""
    columns = [task.layout.columns[i, "position", is_goal] for is_goal in (False, True) for i in range(2)]
    places, goals = last[np.r_[columns[0], columns[1]]].reshape(2, 2), last[np.r_[columns[2], columns[3]]].reshape(2, 2)
    hands = np.linspace(last[:2], (3.1, 0.5), 11)[1:]
    return np.stack([state(task.layout, hand, places, goals) for hand in hands])
