"""UPDATETREE and VALIDATE."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.syntax import Exists
from roboscribe.errors import Fail
from roboscribe.subtask_tree import NEVER, ROOT, TRUE, Tree, update_tree, validate
from tests.handmade import AT, HOLD, chain, node

HOLD1, AT1, AT2 = node("hold", HOLD, "b1"), node("at", AT, "b1"), node("at2", AT, "b2")


def steps(*values: int, of: int = 20) -> np.ndarray:
    """First steps in `of` demonstrations: the values given, then the last of them again."""
    return np.array([*values, *[values[-1]] * (of - len(values))], dtype=np.int64)


def test_the_first_subgoal_comes_between_true_and_the_goal() -> None:
    tree = update_tree(Tree(), AT1, ROOT)
    assert tree.edges == ((TRUE, "at"), ("at", ROOT))
    assert tree.predecessors(ROOT) == (AT1,)


def test_a_subgoal_about_the_same_entities_lengthens_their_path() -> None:
    tree = update_tree(chain(HOLD1), AT1, ROOT)
    assert tree.edges == ((TRUE, "hold"), ("hold", "at"), ("at", ROOT))


def test_a_subgoal_about_other_entities_starts_a_path_of_its_own() -> None:
    tree = update_tree(chain(AT1), AT2, ROOT)
    assert set(tree.edges) == {(TRUE, "at"), ("at", ROOT), (TRUE, "at2"), ("at2", ROOT)}


def test_a_subgoal_that_recurs_makes_its_node_circular() -> None:
    tree = update_tree(chain(HOLD1, AT1), node("again", AT, "b1"), ROOT)
    assert tree.edges == chain(HOLD1, AT1).edges
    at = tree.node("at")
    assert at.circular
    assert at.entities == ()
    assert isinstance(at.lifted({"b1": "block"}), Exists)
    assert not tree.node("hold").circular


def test_refining_a_subgoal_leaves_the_edge_behind_it() -> None:
    tree = update_tree(chain(AT1), HOLD1, "at")
    assert set(tree.edges) == {(TRUE, "hold"), ("hold", "at"), ("at", ROOT)}
    assert [n.name for n in tree.below(ROOT)] == ["at", "hold"]


def test_paths_that_advance_are_valid() -> None:
    first = {"hold": steps(5), "at": steps(9), ROOT: steps(10)}
    assert validate(chain(HOLD1, AT1), first) is None


@pytest.mark.parametrize(("disagreeing", "valid"), [(1, True), (2, False)])
def test_one_of_twenty_demonstrations_may_disagree_with_an_edge(disagreeing: int, valid: bool) -> None:
    first = {"hold": steps(*[9] * disagreeing, 5), "at": steps(9), ROOT: steps(10)}
    answer = validate(chain(HOLD1, AT1), first)
    assert (answer is None) == valid
    assert valid or answer == Fail("hold precedes at in only 90% of the demonstrations, expected 95%")


def test_reaching_both_in_the_same_step_is_no_advance() -> None:
    first = {"hold": steps(9), "at": steps(9), ROOT: steps(10)}
    assert validate(chain(HOLD1, AT1), first) == Fail("hold precedes at in only 0% of the demonstrations, expected 95%")


@pytest.mark.parametrize(("missing", "valid"), [(1, True), (2, False)])
def test_one_of_twenty_demonstrations_may_miss_a_goal(missing: int, valid: bool) -> None:
    first = {"hold": steps(5), "at": steps(*[int(NEVER)] * missing, 9), ROOT: steps(10)}
    answer = validate(chain(HOLD1, AT1), first)
    assert valid or answer == Fail("at is never reached in 10% of the demonstrations")


@pytest.mark.parametrize(("satisfied", "valid"), [(5, True), (6, False)])
def test_demonstrations_that_begin_with_the_goal_have_no_say_up_to_a_quarter(satisfied: int, valid: bool) -> None:
    first = {"at": steps(*[0] * satisfied, 9), ROOT: steps(10)}
    answer = validate(chain(AT1), first)
    assert valid or answer == Fail("at already holds at the start of 30% of the demonstrations")
    assert (answer is None) == valid
