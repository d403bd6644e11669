"""One name, one role: naming by displacement and by binding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roboscribe.world.layout import ROBOT, Attribute, Layout, ObjectType
from roboscribe.world.naming import Movements, by_binding, by_displacement, first_displacements
from roboscribe.world.trajectory import Trajectory

POSITION = Attribute("position", ("x", "y"))
ANGLE = Attribute("angle", ("angle",), "rad")
BLOCK, KNOB = ObjectType("block", (POSITION,), (POSITION,)), ObjectType("knob", (POSITION, ANGLE))
LAYOUT = Layout(ObjectType("EE", (POSITION,)), (BLOCK, KNOB, BLOCK, BLOCK, KNOB))


def episode(moves: dict[tuple[int, str], tuple[int, float]], length: int = 20) -> Trajectory:
    """Draw an episode in which attributes of entities jump at a step by an amount."""
    states = np.random.default_rng(0).uniform(0.0, 1.0, LAYOUT.size) * np.ones((length, 1))
    for (entity, attribute), (step, amount) in moves.items():
        states[step:, LAYOUT.columns[entity, attribute, False].start] += amount
    return Trajectory(LAYOUT, states)


def test_entities_of_a_type_are_named_in_the_order_in_which_they_move() -> None:
    moved = episode({(3, "position"): (2, 0.5), (0, "position"): (9, 0.4), (4, "position"): (5, 0.3)})
    assert first_displacements(moved).tolist() == [9, 20, 20, 2, 5]
    assert by_displacement(moved) == (3, 4, 0, 2, 1)


def test_untouched_entities_come_last_in_their_own_order() -> None:
    assert by_displacement(episode({})) == (0, 1, 2, 3, 4)
    assert by_displacement(episode({(2, "position"): (4, 0.5)})) == (2, 1, 0, 3, 4)


def test_a_turn_is_a_displacement() -> None:
    turned = episode({(4, "angle"): (3, 1.0)})
    assert first_displacements(turned).tolist() == [20, 20, 20, 20, 3]


@pytest.mark.parametrize(("attribute", "small"), [("position", 0.009), ("angle", 0.4)])
def test_trembling_is_no_displacement(attribute: str, small: float) -> None:
    assert first_displacements(episode({(1, attribute): (3, small)})).tolist() == [20] * 5


def test_what_is_small_beside_the_largest_change_of_the_type_does_not_count() -> None:
    nudged = episode({(0, "position"): (3, 0.04), (2, "position"): (8, 0.5)})
    assert by_displacement(nudged)[0] == 2


def test_the_gripper_does_not_count() -> None:
    states = episode({}).states.copy()
    states[5:, LAYOUT.columns[ROBOT, "position", False]] += 1.0
    assert by_displacement(Trajectory(LAYOUT, states)) == (0, 1, 2, 3, 4)


def test_binding_orders_entities_of_each_type_by_when_they_were_first_bound() -> None:
    assert by_binding(LAYOUT, [3, 4, 0, 3]) == (3, 4, 0, 2, 1)
    assert by_binding(LAYOUT, []) == (0, 1, 2, 3, 4)
    assert by_binding(LAYOUT, [2]) == (2, 1, 0, 3, 4)


@settings(deadline=None)
@given(st.permutations([0, 2, 3]), st.permutations([1, 4]), st.permutations(range(5)))
def test_names_do_not_depend_on_indices(blocks: list[int], knobs: list[int], steps: list[int]) -> None:
    order = list(range(5))
    for places, entities in (((0, 2, 3), blocks), ((1, 4), knobs)):
        for place, entity in zip(places, entities, strict=True):
            order[place] = entity
    plain = episode({(i, "position"): (3 * steps[i] + 1, 0.5) for i in range(5)})
    mixed = plain.renamed(tuple(order))
    assert np.array_equal(plain.renamed(by_displacement(plain)).states, mixed.renamed(by_displacement(mixed)).states)


def test_what_is_done_for_unknown_entities_first_is_another_matter() -> None:
    """b1 is moved on frames 2 to 5, b2 on frames 8 to 11: a part about b2 begins where b1 lies still."""
    place = Attribute("position", ("x", "y"))
    kind = ObjectType("block", (place,), (place,))
    layout = Layout(ObjectType("EE", (place,)), (kind, kind))
    states = np.zeros((14, layout.size))
    states[:, layout.columns[0, "position", False]] = np.clip((np.arange(14) - 1) / 4, 0, 1)[:, None]
    states[:, layout.columns[1, "position", False]] = np.clip((np.arange(14) - 7) / 4, 0, 1)[:, None]
    moves = Movements(Trajectory(layout, states))
    assert moves.attended_from(0, 14, (1,), {1}) == 5
    assert moves.attended_from(0, 14, (1,), {0, 1}) == 0
    assert moves.attended_from(0, 14, (0,), {0}) == 0
