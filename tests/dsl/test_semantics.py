"""Meaning of terms and predicates, by hand."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import (
    And,
    Arctan2,
    Const,
    Diff,
    Exists,
    Goal,
    Greater,
    Less,
    Norm,
    Not,
    NotNull,
    Or,
    Predicate,
    Proj,
    Solved,
    Truth,
    Var,
)
from roboscribe.world import Layout
from roboscribe.world.layout import NULL
from tests.dsl.kinematic import AT, FAUCET, GRIPPER, HOLD, LOWER_FIRST, MU, B, blocks

TWO = blocks(2)
# gripper at the origin, opening 0.1; b1 at (3, 0, 4), goal (3, 0, 4.01); b2 at (0, 0, 0.01), goal (1, 1, 1)
STATE = np.array([0, 0, 0, 0.1, 3, 0, 4, 3, 0, 4.01, 0, 0, 0.01, 1, 1, 1.0])


def test_norm_of_a_difference_is_a_distance_and_a_scalar_field_keeps_one_axis() -> None:
    distance = Norm(Diff(Proj(MU, "xyz"), Proj(B, "xyz")))
    assert evaluate(distance, STATE, {"b": 0}, TWO) == pytest.approx([5.0])
    assert evaluate(Proj(MU, "opening"), STATE, {}, TWO).shape == (1,)
    assert evaluate(Norm(Diff(Const(1.0), Const(3.5))), STATE[None], {}, TWO).tolist() == [[2.5]]


def test_components_may_be_picked_with_gaps() -> None:
    assert evaluate(Proj(B, "xz"), STATE, {"b": 0}, TWO).tolist() == [3.0, 4.0]
    assert evaluate(Proj(B, "xz"), STATE[None], {"b": np.array([1])}, TWO).tolist() == [[0.0, 0.01]]


def test_a_vector_of_bindings_picks_per_row_and_null_is_nan_and_false() -> None:
    states = np.stack([STATE, STATE, STATE])
    binding = {"b": np.array([0, 1, NULL])}
    height = evaluate(Proj(B, "z"), states, binding, TWO)
    assert height[:2, 0].tolist() == [4.0, 0.01]
    assert np.isnan(height[2, 0])
    assert holds(HOLD, states, binding, TWO).tolist() == [False, True, False]
    assert holds(Greater(Proj(B, "z"), Const(-99.0)), states, binding, TWO).tolist() == [True, True, False]
    assert holds(NotNull(B), states, binding, TWO).tolist() == [True, True, False]


def test_bindings_broadcast_against_the_leading_axes() -> None:
    trajectory = np.stack([STATE, STATE + 0.5, STATE])
    entities = np.array([[0], [1]])
    assert holds(HOLD, trajectory, {"b": entities}, TWO).shape == (2, 3)
    assert holds(Truth(), trajectory, {"b": np.array([0, 1, 1])}, TWO).tolist() == [True, True, True]
    assert holds(AT, STATE, {"b": np.array([0, 1])}, TWO).tolist() == [True, False]


def test_names_of_entities_stand_for_them_and_others_must_be_bound() -> None:
    assert evaluate(Proj(Var("b2"), "z"), STATE, {}, TWO).tolist() == [0.01]
    with pytest.raises(ValueError, match="variable c is not bound"):
        evaluate(Proj(Var("c"), "z"), STATE, {}, TWO)


def test_a_difference_of_angles_is_wrapped_and_one_of_lengths_is_not() -> None:
    layout = Layout(GRIPPER, (FAUCET,))
    states = np.array([[0, 0, 0, 0, -5, 0, 0, 3.0, -3.0], [0, 0, 0, 0, -5, 0, 0, 0.5, 0.25]])
    turn = Diff(Proj(Var("f"), "angle"), Proj(Goal(Var("f")), "angle"))
    assert evaluate(turn, states, {"f": 0}, layout)[:, 0] == pytest.approx([6 - 2 * pi, 0.25])
    far = Diff(Proj(MU, "x"), Proj(Var("f"), "x"))
    assert evaluate(far, states, {"f": 0}, layout)[:, 0].tolist() == [5.0, 5.0]
    heading = Arctan2(Diff(Proj(Var("f"), "xy"), Proj(MU, "xy")))
    assert evaluate(heading, states, {"f": 0}, layout)[:, 0] == pytest.approx([pi, pi])
    around = Norm(Diff(heading, Proj(Goal(Var("f")), "angle")))
    assert evaluate(around, states, {"f": 0}, layout)[0, 0] == pytest.approx(abs(pi + 3 - 2 * pi))


def test_connectives_and_the_quantifier() -> None:
    yes, no = Truth(), Not(Truth())
    table: list[Predicate] = [And(yes, no), Or(no, yes), Or(no, no), Not(no)]
    assert [bool(holds(p, STATE, {}, TWO)) for p in table] == [False, True, False, True]
    assert holds(Exists(B, "block", HOLD), STATE, {}, TWO)
    assert not holds(Exists(B, "block", Greater(Proj(B, "z"), Const(4.0))), STATE, {}, TWO)
    assert holds(Not(Exists(B, "drawer", Truth())), STATE, {}, TWO), "there is nothing of a type that no entity has"


def test_the_order_of_the_tower_picks_the_lowest_block_not_yet_placed() -> None:
    low_waits = STATE.copy()
    low_waits[[9, 15]] = 2.0, 1.0  # goals' heights: b2's is lower
    assert holds(LOWER_FIRST, low_waits, {"b": np.array([0, 1])}, TWO).tolist() == [False, True]
    placed = low_waits.copy()
    placed[10:13] = placed[13:16]
    assert holds(LOWER_FIRST, placed, {"b": np.array([0, 1])}, TWO).tolist() == [True, False]


def test_the_opaque_goal_is_asked_and_refuses_without_a_task() -> None:
    states = np.stack([STATE, STATE + 1])
    assert holds(Solved(), states, {}, TWO, lambda s: s[..., 0] > 0.5).tolist() == [False, True]
    with pytest.raises(ValueError, match="ψ_R was asked"):
        holds(Solved(), states, {}, TWO)


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (Diff(Proj(MU, "xyz"), Proj(B, "xy")), "subtracts 2 numbers from 3"),
        (Arctan2(Proj(B, "xyz")), "planar vector"),
        (Proj(B, "angle"), "no such field"),
    ],
)
def test_what_does_not_fit_is_refused(term: Diff | Arctan2 | Proj, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        evaluate(term, STATE, {"b": 0}, TWO)


def test_a_vector_is_never_compared_and_an_entity_without_the_field_is_named() -> None:
    with pytest.raises(ValueError, match="only a single number can be compared"):
        holds(Less(Proj(B, "xyz"), Const(0.0)), STATE, {"b": 0}, TWO)
    mixed = Layout(GRIPPER, (TWO.entities[0], FAUCET))
    states = np.zeros((2, mixed.size))
    with pytest.raises(ValueError, match="b1 of type block has no such field"):
        evaluate(Proj(B, "angle"), states, {"b": 0}, mixed)
    with pytest.raises(ValueError, match="entity 0 has no such field"):
        evaluate(Proj(B, "angle"), states, {"b": np.array([1, 0])}, mixed)
    assert evaluate(Proj(B, "angle"), states, {"b": np.array([1, NULL])}, mixed).shape == (2, 1)
