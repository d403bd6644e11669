"""Where attributes lie in a state."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from roboscribe.world.layout import NULL, ROBOT, Attribute, Layout, ObjectType
from roboscribe.world.trajectory import Trajectory

POSITION = Attribute("position", ("x", "y", "z"))
OPENING = Attribute("opening", ("opening",))
HAND = ObjectType("EE", (POSITION, OPENING))
BLOCK = ObjectType("block", (POSITION,), (POSITION,))
DRAWER = ObjectType("drawer", (POSITION, OPENING), (OPENING,))
BALL = ObjectType("ball", (POSITION,))
LAYOUT = Layout(HAND, (BLOCK, DRAWER, BLOCK))


def test_columns_tile_the_state_in_storage_order() -> None:
    places = list(LAYOUT.columns.values())
    assert places[0].start == 0
    assert all(one.stop == other.start for one, other in pairwise(places))
    assert places[-1].stop == LAYOUT.size == 4 + 6 + 5 + 6
    assert LAYOUT.columns[1, "opening", True] == slice(14, 15)


def test_names_are_a_letter_and_a_rank_and_a_word_where_letters_clash() -> None:
    assert LAYOUT.names == ("b1", "d1", "b2")
    assert Layout(HAND, (BLOCK, BALL, BALL)).names == ("block1", "ball1", "ball2")


def test_types_are_listed_in_order_of_first_appearance() -> None:
    assert list(LAYOUT.types) == ["block", "drawer"]
    assert LAYOUT.of_type("block") == (0, 2)
    assert LAYOUT.of_type("ball") == ()
    assert LAYOUT.type_of(ROBOT) == HAND


@pytest.mark.parametrize(
    ("field", "expected"), [("position", (0, 1, 2)), ("xyz", (0, 1, 2)), ("xz", (0, 2)), ("y", (1,)), ("opening", (0,))]
)
def test_fields_resolve_to_components(field: str, expected: tuple[int, ...]) -> None:
    found = HAND.find(field)
    assert found is not None
    assert found[1] == expected


@pytest.mark.parametrize("field", ["zx", "xx", "w", ""])
def test_what_is_no_field_is_not_found(field: str) -> None:
    assert BLOCK.find(field, goal=True) is None


def test_components_that_two_attributes_share_are_told_apart_by_the_attribute() -> None:
    place, handle = Attribute("position", ("x", "y")), Attribute("handle", ("x", "y"))
    door = ObjectType("door", (place, handle), (handle,))
    assert (door.spell(place), door.spell(place, (1,))) == ("xy", "y")
    assert (door.spell(handle), door.spell(handle, (1,))) == ("handle", "handle_y")
    assert door.spell(handle, (1,), goal=True) == "y", "its goal has but one attribute"
    assert door.find("handle_y") == (handle, (1,))
    assert door.find("handle_xy") == (handle, (0, 1))
    assert door.find("handle_z") is None


def test_what_cannot_be_spelled_is_not() -> None:
    place = Attribute("place", ("east", "north", "height"))
    assert ObjectType("tree", (place,)).spell(place, (0, 1)) is None
    assert ObjectType("tree", (place,)).spell(place) == "place"


@pytest.mark.parametrize(
    ("components", "unit", "plane"),
    [
        (("x", "y", "z"), "m", (0, 1)),
        (("u", "v"), "mm", (0, 1)),
        (("z", "y", "x"), "cm", (1, 2)),
        (("x", "z"), "m", ()),
        (("rx", "ry", "rz"), "rad", ()),
        (("opening",), "m", ()),
    ],
)
def test_the_plane_is_what_is_seen_from_above(components: tuple[str, ...], unit: str, plane: tuple[int, ...]) -> None:
    assert Attribute("place", components, unit).plane == plane


def test_a_field_is_located_for_every_entity_and_null() -> None:
    place = LAYOUT.place("opening")
    assert place.columns[:, 0].tolist() == [-1, 13, -1, -1]
    assert place.columns[NULL, 0] == -1
    assert LAYOUT.place("xz", robot=True).columns.tolist() == [[0, 2]]
    assert not LAYOUT.place("xz").contiguous


@pytest.mark.parametrize(("field", "goal"), [("w", False), ("velocity", False), ("opening", True)])
def test_fields_that_nobody_has_are_refused(field: str, goal: bool) -> None:
    layout = Layout(HAND, (BLOCK,))
    with pytest.raises(ValueError, match=rf"↓{field} of .*no such field"):
        layout.place(field, goal=goal)


def test_renaming_moves_attributes_and_goals_together() -> None:
    states = np.arange(2 * LAYOUT.size, dtype=np.float64).reshape(2, LAYOUT.size)
    moved = LAYOUT.permute(states, (2, 1, 0))
    for goal in (False, True):
        assert np.array_equal(
            moved[:, LAYOUT.columns[0, "position", goal]], states[:, LAYOUT.columns[2, "position", goal]]
        )
    assert np.array_equal(moved[:, :4], states[:, :4])
    assert np.array_equal(LAYOUT.permute(moved, (2, 1, 0)), states)


@pytest.mark.parametrize(
    ("order", "reason"), [((0, 1), "permutation"), ((0, 0, 2), "permutation"), ((1, 0, 2), "another type")]
)
def test_renamings_that_mix_types_are_refused(order: tuple[int, ...], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        LAYOUT.permute(np.zeros(LAYOUT.size), order)


def test_a_renamed_trajectory_keeps_actions_and_snapshots() -> None:
    states = np.random.default_rng(0).normal(size=(3, LAYOUT.size))
    trajectory = Trajectory(LAYOUT, states, np.zeros((2, 4)), states)
    renamed = trajectory.renamed((2, 1, 0))
    assert len(renamed) == 3
    assert np.array_equal(renamed.states, LAYOUT.permute(states, (2, 1, 0)))
    assert renamed.actions is trajectory.actions
    assert renamed.snapshots is trajectory.snapshots
