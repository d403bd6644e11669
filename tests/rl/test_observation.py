"""What a controller sees, by hand."""

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import controllers
from roboscribe.errors import ArtifactError
from roboscribe.rl.observation import FINE_CLIP, TURNED_SCALES, Encoder, ObservationSpec, Part, observation_spec
from roboscribe.world import Attribute, Layout, ObjectType
from roboscribe.world.layout import ROBOT
from tests.rl.carry_world import PROGRAM, layout

HOLD, AT = controllers(PROGRAM)
STATE = np.array([[0.1, 0.2, 0.4, 0.8, 0.41, 0.0, 5.0, 6.0, 7.0, 8.0]])


def test_a_controller_sees_its_arguments_and_nothing_else() -> None:
    spec = observation_spec(HOLD, {"b": "block"}, layout(2))
    assert spec.parts == (Part(ROBOT, "position"), Part(0, "position"))
    goal = observation_spec(AT, {"b": "block"}, layout(2))
    assert goal.parts == (*spec.parts, Part(0, "position", goal=True))
    assert goal.pairs == ((0, 1), (0, 2), (1, 2))


def test_in_a_loop_goals_are_seen_too() -> None:
    spec = observation_spec(HOLD, {"b": "block"}, layout(2), goals=True)
    assert spec.parts == (Part(ROBOT, "position"), Part(0, "position"), Part(0, "position", goal=True))
    assert spec.pairs == ((0, 1), (0, 2)), "the robot's distance alone"
    assert observation_spec(AT, {"b": "block"}, layout(2), goals=True) == observation_spec(
        AT, {"b": "block"}, layout(2)
    ), "a goal among the arguments is not seen twice"


def test_where_the_robot_may_have_to_leave_is_seen_from_near_by_alone() -> None:
    """The goal lies 0.1 m from the robot, or further off than is seen; what it holds to the block stays as it is."""
    spec = observation_spec(HOLD, {"b": "block"}, layout(1), goals=True, near=True)
    assert spec.nearby == (1,)
    assert spec.turned == ()
    states = np.array([[0.1, 0.2, 0.3, 0.4, 0.1, 0.3], [0.1, 0.2, 0.3, 0.4, 0.1, 5.0], [0.1, 0.2, 0.3, 0.4, -9.0, 0.2]])
    bound = np.zeros((3, 1), np.int64)
    near, far, farther = Encoder(spec.fitted(layout(1), states, bound), layout(1))(states, bound)
    seen = np.flatnonzero(near != far)
    np.testing.assert_array_equal(far, farther)
    assert (far[seen] == 0).all()
    assert near[-1] == np.float32(0.5 * -FINE_CLIP), "half of it is seen from half the way"
    assert {*far[far != 0]} <= {*near}


def test_positions_are_seen_as_differences() -> None:
    encoder = Encoder(observation_spec(AT, {"b": "block"}, layout(2)), layout(2))
    raw = encoder.raw(STATE, np.array([[0]]))
    np.testing.assert_allclose(raw, [[0.1 - 0.4, 0.2 - 0.8, 0.1 - 0.41, 0.2, 0.4 - 0.41, 0.8]])


def test_what_has_no_counterpart_is_seen_itself() -> None:
    spec = ObservationSpec(("block",), (Part(ROBOT, "position"), Part(0, "position"), Part(0, "position", True)), ())
    assert spec.alone == (0, 1, 2)
    raw = Encoder(spec, layout(2)).raw(STATE, np.array([[1]]))
    np.testing.assert_allclose(raw, [[0.1, 0.2, 5.0, 6.0, 7.0, 8.0]])


def test_moving_everything_alike_changes_nothing() -> None:
    spec = observation_spec(AT, {"b": "block"}, layout(2)).fitted(layout(2), STATE, np.array([[0]]))
    encoder = Encoder(spec, layout(2))
    np.testing.assert_allclose(encoder(STATE + 0.3, np.array([[0]])), encoder(STATE, np.array([[0]])), atol=1e-5)


def test_each_row_sees_the_entity_bound_there() -> None:
    encoder = Encoder(observation_spec(HOLD, {"b": "block"}, layout(2)), layout(2))
    raw = encoder.raw(np.repeat(STATE, 2, axis=0), np.array([[1], [0]]))
    np.testing.assert_allclose(raw, [[0.1 - 5.0, 0.2 - 6.0], [0.1 - 0.4, 0.2 - 0.8]])


def test_fine_copies_magnify_and_clip_differences() -> None:
    spec = ObservationSpec(("block",), (Part(0, "position"), Part(0, "position", True)), ((0, 1),), (0.05, 0.01))
    known = np.array([[0, 0, 0.0, 0, 0, 0], [0, 0, 1.0, 1, 1, 1.0]])
    fitted = spec.fitted(layout(1), known, np.zeros((2, 1), np.int64))
    inputs = Encoder(fitted, layout(1))(np.array([[0, 0, 0.5, 0.5, 0.51, 0.5 - 1.0]]), np.zeros((1, 1), np.int64))
    np.testing.assert_allclose(inputs[0, 2:], [-0.2, FINE_CLIP, -1.0, FINE_CLIP], rtol=1e-5)


def test_a_skill_that_nothing_was_seen_of_has_numbers_all_the_same() -> None:
    spec = observation_spec(HOLD, {"b": "block"}, layout(1))
    fitted = spec.fitted(layout(1), np.zeros((0, 6)), np.zeros((0, 1), np.int64))
    assert {*fitted.mean} == {0.0}
    assert {*fitted.std} == {1.0}
    assert np.isfinite(Encoder(fitted, layout(1))(np.ones((1, 6)), np.zeros((1, 1), np.int64))).all()


def test_fitted_features_have_mean_zero_and_spread_one() -> None:
    rng = np.random.default_rng(0)
    states, entities = rng.uniform(1, 5, (500, 10)), rng.integers(2, size=(500, 1))
    spec = observation_spec(HOLD, {"b": "block"}, layout(2)).fitted(layout(2), states, entities)
    inputs = Encoder(spec, layout(2))(states, entities)[:, :2]
    np.testing.assert_allclose(inputs.mean(axis=0), 0, atol=1e-5)
    np.testing.assert_allclose(inputs.std(axis=0), 1, atol=1e-3)


def test_what_no_demonstration_came_near_is_seen_at_the_bound() -> None:
    """A hand a metre away is seen where it would be a few spreads away, on the same side."""
    rng = np.random.default_rng(0)
    spec = observation_spec(HOLD, {"b": "block"}, layout(1))
    spec = spec.fitted(layout(1), rng.uniform(-0.1, 0.1, (500, 6)), np.zeros((500, 1), int))
    far = np.zeros((2, 6))
    far[0, :2], far[1, :2] = 1.0, 100.0
    near, further = Encoder(spec, layout(1))(far, np.zeros((2, 1), int))
    np.testing.assert_array_equal(near, further)


def test_a_constant_feature_does_not_explode() -> None:
    spec = observation_spec(HOLD, {"b": "block"}, layout(1)).fitted(layout(1), np.ones((9, 6)), np.zeros((9, 1), int))
    assert np.isfinite(Encoder(spec, layout(1))(np.zeros((1, 6)), np.zeros((1, 1), int))).all()


def test_a_feature_that_hardly_varies_is_not_magnified() -> None:
    turned = Attribute("rotation", ("rz",), "rad")
    place = Attribute("position", ("x", "y"))
    scene = Layout(ObjectType("EE", (place,)), (ObjectType("block", (place, turned), (place,)),))
    states = np.random.default_rng(0).normal(0, 1e-4, (100, scene.size))
    spec = observation_spec(HOLD, {"b": "block"}, scene).fitted(scene, states, np.zeros((100, 1), int))
    assert spec.std == (0.1, 0.01, 0.01), "radians, then metres of the difference"


def test_what_hardly_varies_of_an_entity_is_not_seen() -> None:
    """Blocks tilt by a degree where nobody turns them; of one that lies on its side nothing else was shown."""
    turned, place = Attribute("rotation", ("rz",), "rad"), Attribute("position", ("x", "y"))
    scene = Layout(ObjectType("EE", (place, turned)), (ObjectType("block", (place, turned), (place,)),))
    still = np.random.default_rng(0).normal(0, 0.01, (100, scene.size))
    entities = np.zeros((100, 1), int)
    spec = observation_spec(AT, {"b": "block"}, scene)
    seen = spec.without_still(scene, still, entities)
    assert [part for part in spec.parts if part not in seen.parts] == [Part(0, "rotation")], "the robot's own is seen"
    named = [(spec.parts[i], spec.parts[j]) for i, j in spec.pairs]
    assert [(seen.parts[i], seen.parts[j]) for i, j in seen.pairs] == named
    still[:, scene.columns[0, "rotation", False]] *= 10
    assert spec.without_still(scene, still, entities) == spec


def test_speeds_of_entities_are_left_out_unless_asked_for() -> None:
    fast = Attribute("velocity", ("vx", "vy"), "m/s")
    place = Attribute("position", ("x", "y"))
    wide = Layout(ObjectType("EE", (place, fast)), (ObjectType("block", (place, fast), (place,)),))
    usual = observation_spec(HOLD, {"b": "block"}, wide)
    assert Part(0, "velocity") not in usual.parts
    more = observation_spec(HOLD, {"b": "block"}, wide, speeds=True)
    assert Part(0, "velocity") in more.parts
    assert more.pairs == ((0, 2),), "velocities are not subtracted"


def test_the_robots_own_velocity_is_seen() -> None:
    fast = Attribute("velocity", ("vx", "vy"), "m/s")
    place = Attribute("position", ("x", "y"))
    wide = Layout(ObjectType("EE", (place, fast)), (ObjectType("block", (place, fast), (place,)),))
    spec = observation_spec(HOLD, {"b": "block"}, wide)
    assert spec.parts == (Part(ROBOT, "position"), Part(ROBOT, "velocity"), Part(0, "position"))


def test_size_counts_what_the_network_is_given() -> None:
    spec = observation_spec(AT, {"b": "block"}, layout(1)).fitted(layout(1), np.zeros((3, 6)), np.zeros((3, 1), int))
    encoder = Encoder(spec, layout(1))
    assert encoder(np.zeros((3, 6)), np.zeros((3, 1), int)).shape == (3, encoder.size)
    turned = 3 * 2 * 2 * len(TURNED_SCALES) + 3 * 2
    assert encoder.size == 3 * 2 * (1 + len(spec.fine)) + turned


def test_a_difference_is_seen_along_and_across_another() -> None:
    """The hand is 3 cm behind b1 and 1 cm to the right, as seen on the way from b1 to its goal along y."""
    state = np.array([[0.01, -0.03, 0.0, 0.0, 0.0, 0.2]])
    spec = observation_spec(AT, {"b": "block"}, layout(1)).fitted(layout(1), state, np.zeros((1, 1), int))
    parts = ((ROBOT, 0), (0, 0), (0, 1))
    assert [(part.slot, int(part.goal)) for part in spec.parts] == list(parts)
    hand_to_block, block_to_goal = spec.pairs.index((0, 1)), spec.pairs.index((1, 2))
    rank = spec.turned.index((hand_to_block, block_to_goal))
    seen = Encoder(spec, layout(1))(state, np.zeros((1, 1), int))[0]
    start = len(seen) - 3 * 2 - len(TURNED_SCALES) * 2 * len(spec.turned)
    along, across = seen[start + 2 * rank : start + 2 * rank + 2] * TURNED_SCALES[0]
    assert (along, across) == pytest.approx((0.03, -0.01))
    assert seen[-2:] == pytest.approx((0.0, -1.0)), "b1 is behind its goal"


def test_a_saved_spec_without_turned_differences_has_none() -> None:
    spec = observation_spec(AT, {"b": "block"}, layout(2))
    old = {name: value for name, value in spec.to_json().items() if name != "turned"}
    assert ObservationSpec.from_json(old).turned == ()


def test_json_round_trip() -> None:
    spec = observation_spec(AT, {"b": "block"}, layout(2)).fitted(layout(2), STATE, np.array([[1]]))
    assert ObservationSpec.from_json(json.loads(json.dumps(spec.to_json()))) == spec


@pytest.mark.parametrize(
    "damage",
    [
        {"mean": ["a"]},
        {"parts": [[0, "position"]]},
        {"pairs": [[0, "1"]]},
        {"types": "block"},
        {"std": [float("nan")]},
        {"nearby": [9]},
        {"nearby": ["1"]},
        {"turned": [[0, 9]]},
    ],
)
def test_damaged_json_is_refused(damage: dict[str, object]) -> None:
    spec = observation_spec(AT, {"b": "block"}, layout(1)).to_json()
    with pytest.raises(ArtifactError, match="observation spec"):
        ObservationSpec.from_json(spec | damage)


def test_missing_field_is_refused() -> None:
    with pytest.raises(ArtifactError, match="types"):
        ObservationSpec.from_json({})


def test_lengths_in_millimetres_are_seen_as_those_in_metres() -> None:
    def scene(unit: str) -> Layout:
        place = Attribute("position", ("x", "y"), unit)
        return Layout(ObjectType("EE", (place,)), (ObjectType("block", (place,), (place,)),))

    states = np.random.default_rng(0).uniform(0.0, 0.1, (9, 6))
    entities = np.zeros((9, 1), int)

    def seen(unit: str, factor: float) -> NDArray[np.float32]:
        layout, shown = scene(unit), states * factor
        return Encoder(observation_spec(AT, {"b": "block"}, layout).fitted(layout, shown, entities), layout)(
            shown, entities
        )

    metres, millimetres = seen("m", 1.0), seen("mm", 1000.0)
    np.testing.assert_allclose(metres, millimetres, rtol=1e-5, atol=1e-5)


def test_readings_in_other_units_are_seen() -> None:
    force = Attribute("force", ("force",), "N")
    place = Attribute("position", ("x", "y"))
    scene = Layout(ObjectType("EE", (place, force)), (ObjectType("block", (place, force), (place,)),))
    assert {Part(0, "force"), Part(-2, "force")} <= set(observation_spec(HOLD, {"b": "block"}, scene).parts)
