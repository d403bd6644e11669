"""Which expressions the grammar offers."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.rewrite import free_vars
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.types import check_predicate
from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.search.features import Feature, enumerate_features, relations
from roboscribe.world.layout import Attribute, Layout, ObjectType

POSITION = Attribute("position", ("x", "y", "z"))
SPEED = Attribute("velocity", ("vx", "vy", "vz"), "m/s")
HAND, BLOCK = ObjectType("EE", (POSITION, SPEED)), ObjectType("block", (POSITION, SPEED), (POSITION,))
ONE, THREE = Layout(HAND, (BLOCK,)), Layout(HAND, (BLOCK,) * 3)


def texts(layout: Layout, *named: str) -> set[str]:
    """Texts of all plain features."""
    return {str(f.term) for f in enumerate_features(layout, named) if f.over is None}


@pytest.mark.parametrize(
    "expected",
    [
        "b1↓z",
        "g(b1)↓x",
        "μ↓z − b1↓z",
        "‖μ↓xyz − b1↓xyz‖",
        "‖b1↓xy − g(b1)↓xy‖",
        "arctan2(μ↓xy − b1↓xy)",
        "arctan2(μ↓xy − b1↓xy) − arctan2(g(b1)↓xy − b1↓xy)",
        "‖arctan2(μ↓xy − b1↓xy) − arctan2(g(b1)↓xy − b1↓xy)‖",
    ],
)
def test_expressions_of_the_paper_are_offered(expected: str) -> None:
    assert expected in texts(ONE, "b1")


def test_speeds_are_no_subgoals() -> None:
    assert not any("v" in text for text in texts(ONE, "b1"))


def test_only_named_entities_are_mentioned_and_no_more_than_two() -> None:
    assert not any("b2" in text for text in texts(THREE, "b1", "b3"))
    features = enumerate_features(THREE, THREE.names)
    assert max(f.entities for f in features) == 2


def test_types_with_several_entities_are_quantified_over() -> None:
    over = {f.over for f in enumerate_features(THREE, []) if f.over is not None}
    assert [kind for _, kind in over] == ["block"]
    assert {f.over for f in enumerate_features(ONE, ["b1"])} == {None}


@pytest.mark.parametrize("name", sorted(POINT_TASKS))
def test_every_feature_type_checks_and_comes_once(name: str) -> None:
    layout = POINT_TASKS[name].layout
    features = enumerate_features(layout, layout.names)
    types = dict(zip(layout.names, (kind.name for kind in layout.entities), strict=True))
    assert len(set(features)) == len(features)
    for feature in features:
        check_predicate(feature.below(0.5), layout, types)


@pytest.mark.parametrize("greatest", [False, True])
def test_thresholds_mean_what_values_say(greatest: bool) -> None:
    states = np.random.default_rng(0).uniform(-1.0, 1.0, (200, THREE.size))
    for plain in (f for f in enumerate_features(THREE, ["b1"]) if f.over is None or f.greatest == greatest):
        values = plain.values(states, THREE)
        assert np.array_equal(holds(plain.below(0.3), states, {}, THREE), values < 0.3)
        assert np.array_equal(holds(plain.above(0.3), states, {}, THREE), values > 0.3)


def test_two_attributes_of_one_object_that_measure_the_same_are_compared() -> None:
    """How far a block is from where it began, but not how a share compares with a flag."""
    begun = Attribute("start", ("x0", "y0", "z0"))
    shares = (Attribute("filled", ("filled",), "1"), Attribute("pressed", ("pressed",), "1"))
    found = texts(Layout(HAND, (ObjectType("block", (POSITION, begun, *shares)),)), "b1")
    assert {"b1↓x − b1↓x0", "b1↓y − b1↓y0", "b1↓z − b1↓z0", "‖b1↓position − b1↓start‖"} <= found
    assert "b1↓filled − b1↓pressed" not in found


def test_projections_of_one_difference_are_one_family() -> None:
    families: dict[str, set[str]] = {}
    for feature in enumerate_features(ONE, ["b1"]):
        families.setdefault(feature.family, set()).add(str(feature.term))
    assert families["μ−b1.position"] == {
        "‖μ↓xyz − b1↓xyz‖",
        "‖μ↓xy − b1↓xy‖",
        *(f"μ↓{c} − b1↓{c}" for c in "xyz"),
    }


def test_every_feature_of_a_named_entity_mentions_it() -> None:
    mentioned = [f for f in enumerate_features(ONE, ["b1"]) if "b1" in str(f.term)]
    assert all(free_vars(f.below(1.0)) == ("b1",) for f in mentioned)
    assert isinstance(mentioned[0], Feature)


@pytest.mark.parametrize(("unit", "names"), [("mm", ("x", "y")), ("ft", ("u", "v")), ("m", ("east", "north"))])
def test_directions_are_offered_in_any_unit_of_length_and_by_any_name(unit: str, names: tuple[str, ...]) -> None:
    place = Attribute("position", names, unit)
    layout = Layout(ObjectType("EE", (place,)), (ObjectType("puck", (place,), (place,)),))
    whole = "".join(names) if len(names[0]) == 1 else "position"
    terms = {str(feature.term) for feature in enumerate_features(layout, ("p1",))}
    assert f"arctan2(μ↓{whole} − p1↓{whole}) − arctan2(g(p1)↓{whole} − p1↓{whole})" in terms


def test_two_attributes_with_the_same_components_are_both_on_offer() -> None:
    place, handle = Attribute("position", ("x", "y")), Attribute("handle", ("x", "y"))
    layout = Layout(ObjectType("EE", (place,)), (ObjectType("door", (place, handle), (handle,)),))
    terms = {str(feature.term) for feature in enumerate_features(layout, ("d1",))}
    assert {"d1↓x", "d1↓handle_x", "‖d1↓handle − g(d1)↓xy‖", "‖μ↓xy − d1↓xy‖"} <= terms
    assert "‖d1↓xy − g(d1)↓xy‖" not in terms


def test_an_entity_may_be_near_any_one_of_another_type() -> None:
    """It may lie in one of several bins; how it lies to others of its own type is said elsewhere."""
    bins = Layout(HAND, (BLOCK, BLOCK, ObjectType("bin", (POSITION,)), ObjectType("bin", (POSITION,))))
    found = [f for f in relations(bins, "block1") if str(f.term) == "‖block1↓xyz − bin'↓xyz‖"]
    assert [str(f.below(0.1)) for f in found] == ["∃bin':bin. ‖block1↓xyz − bin'↓xyz‖ < 0.1"]
    states = np.zeros((1, bins.size))
    states[0, bins.columns[0, "position", False]] = 0.3
    states[0, bins.columns[3, "position", False]] = 0.3
    np.testing.assert_allclose(found[0].values(states, bins), 0.0)
    assert all(f.over is not None and f.over[1] == "bin" for f in relations(bins, "block1"))
    assert not list(relations(THREE, "b1"))
