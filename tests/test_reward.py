"""R_φ: values by hand, and its law: a positive reward means φ, a negative one means not φ."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roboscribe.dsl.semantics import holds
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
    Robot,
    Solved,
    Truth,
    Var,
)
from roboscribe.reward import FALSE_MARGIN, atoms, reward
from roboscribe.world import Attribute, Layout, ObjectType
from roboscribe.world.layout import NULL, BoolArray, FloatArray

PLACE = Attribute("position", ("x", "y", "z"))
BLOCK = ObjectType("block", (PLACE,), (PLACE,))
LAYOUT = Layout(ObjectType("EE", (PLACE, Attribute("angle", ("angle",), "rad"))), (BLOCK, BLOCK))
B, MU = Var("b"), Robot()
X = Proj(B, "x")


def state(**columns: float) -> FloatArray:
    """Return a zero state with some columns set: hand x, block 0 x, block 1 x, angle."""
    found = np.zeros(LAYOUT.size)
    places = {"hand": 0, "angle": 3, "first": 4, "second": 10}
    for name, value in columns.items():
        found[places[name]] = value
    return found[None]


def score(predicate: Predicate, states: FloatArray, entity: int = 0, **options: Any) -> float:  # noqa: ANN401 - any argument of `reward`
    return float(reward(predicate, states, {"b": np.array([entity])}, LAYOUT, **options)[0])


def test_atoms_are_signed_margins() -> None:
    near = Less(Norm(Diff(Proj(MU, "xyz"), Proj(B, "xyz"))), Const(0.5))
    assert score(near, state(hand=0.2, first=0.5)) == pytest.approx(0.2)
    assert score(near, state(hand=-0.5, first=0.5)) == pytest.approx(-0.5)
    assert score(Greater(X, Const(1.0)), state(first=0.75)) == pytest.approx(-0.25)


def test_atom_of_two_terms_is_right_minus_left() -> None:
    lower = Less(X, Proj(Goal(B), "x"))
    assert score(lower, state(first=-0.25)) == pytest.approx(0.25)


def test_margin_is_divided_by_the_scale_of_its_left_term() -> None:
    far = Greater(X, Const(1.0))
    assert score(far, state(first=3.0), scales={str(X): 4.0}) == pytest.approx(0.5)
    assert score(far, state(first=3.0), scales={"something else": 4.0}) == pytest.approx(2.0)


def test_and_is_min_or_is_max_not_flips() -> None:
    low, high = Less(X, Const(1.0)), Greater(X, Const(0.25))
    at = state(first=0.5)
    assert score(And(low, high), at) == pytest.approx(0.25)
    assert score(Or(low, high), at) == pytest.approx(0.5)
    assert score(Not(And(low, high)), at) == pytest.approx(-0.25)
    assert score(Not(Not(low)), at) == pytest.approx(0.5)


def test_exists_is_the_best_instantiation() -> None:
    someone = Exists(Var("c"), "block", Greater(Proj(Var("c"), "x"), Const(1.0)))
    assert score(someone, state(first=0.5, second=3.0)) == pytest.approx(2.0)
    assert score(Not(someone), state(first=0.5, second=3.0)) == pytest.approx(-2.0)


def test_exists_over_a_type_without_entities_does_not_hold() -> None:
    lonely = Layout(LAYOUT.robot, ())
    found = reward(Exists(B, "block", Truth()), np.zeros((2, lonely.size)), {}, lonely)
    np.testing.assert_array_equal(found, [FALSE_MARGIN, FALSE_MARGIN])


def test_true_is_zero_and_solved_is_one_or_zero() -> None:
    assert score(Truth(), state()) == 0
    assert score(Solved(), state(first=2.0), solved=lambda states: states[..., 4] > 1) == 1
    assert score(Solved(), state(first=0.0), solved=lambda states: states[..., 4] > 1) == 0


def test_solved_needs_a_test() -> None:
    with pytest.raises(ValueError, match="solved"):
        score(Solved(), state())


def test_null_objects_satisfy_no_atom() -> None:
    assert score(Less(X, Const(1.0)), state(), NULL) == FALSE_MARGIN
    assert score(NotNull(B), state(), NULL) < 0 < score(NotNull(B), state(), 1)


def test_entities_are_bound_row_by_row() -> None:
    states = np.repeat(state(first=1.0, second=2.0), 2, axis=0)
    found = reward(Greater(X, Const(0.0)), states, {"b": np.array([0, 1])}, LAYOUT)
    np.testing.assert_allclose(found, [1.0, 2.0])


def test_atoms_are_listed_in_order() -> None:
    low, high = Less(X, Const(1.0)), Greater(X, Const(0.25))
    assert atoms(Or(Not(high), Exists(Var("c"), "block", And(low, Truth())))) == (high, low)


NUMBERS = st.floats(-2, 2, allow_nan=False).map(lambda value: round(value, 3))
TERMS = st.sampled_from(
    [
        X,
        Proj(MU, "angle"),
        Norm(Diff(Proj(MU, "xyz"), Proj(B, "xyz"))),
        Diff(Arctan2(Proj(B, "xy")), Arctan2(Proj(Goal(B), "xy"))),
        Diff(Proj(Goal(B), "z"), Proj(MU, "z")),
    ]
)
CONSTANTS = st.builds(Const, NUMBERS)
ATOMS = st.one_of(st.builds(Less, TERMS, CONSTANTS), st.builds(Greater, TERMS, CONSTANTS))
LEAVES = st.one_of(ATOMS, st.just(Truth()), st.just(Solved()), st.just(NotNull(B)), st.builds(Less, TERMS, TERMS))
PREDICATES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.builds(And, inner, inner),
        st.builds(Or, inner, inner),
        st.builds(Not, inner),
        st.builds(Exists, st.sampled_from([B, Var("c")]), st.just("block"), inner),
    ),
    max_leaves=8,
)


@given(PREDICATES, st.integers(0, 2**32 - 1), st.integers(NULL, 1), NUMBERS)
def test_sign_agrees_with_the_predicate(predicate: Predicate, seed: int, entity: int, scale: float) -> None:
    states = np.random.default_rng(seed).uniform(-2, 2, (16, LAYOUT.size))
    binding = {"b": np.full(16, entity)}

    def solved(found: FloatArray) -> BoolArray:
        return found[..., 0] > 0

    margin = reward(predicate, states, binding, LAYOUT, {str(X): 0.1 + abs(scale)}, solved)
    truth = holds(predicate, states, binding, LAYOUT, solved)
    assert margin.shape == truth.shape == (16,)
    assert truth[margin > 0].all()
    assert not truth[margin < 0].any()


@given(ATOMS, st.integers(0, 2**32 - 1))
def test_reward_is_zero_only_on_the_boundary(atom: Less | Greater, seed: int) -> None:
    states = np.random.default_rng(seed).uniform(-2, 2, (16, LAYOUT.size))
    margin = reward(atom, states, {"b": np.zeros(16, np.int64)}, LAYOUT)
    np.testing.assert_array_equal(margin > 0, holds(atom, states, {"b": np.zeros(16, np.int64)}, LAYOUT))
