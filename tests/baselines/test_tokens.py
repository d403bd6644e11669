"""What baselines see: one token per entity, normalised inside the network, of any number of entities."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch

from roboscribe.baselines.set_network import CLIP, Tokenizer
from roboscribe.baselines.tokens import ABSENT, Field, TokenSpec
from roboscribe.errors import ArtifactError
from roboscribe.world import Attribute, Layout, ObjectType
from tests.baselines.examples import ARM, CUBE, DRAWER, KITCHEN, states_of

SPEC = TokenSpec.of(KITCHEN)


def test_a_token_holds_robot_entity_goal_and_type() -> None:
    assert SPEC.robot == (Field("position", 2), Field("opening", 1))
    assert SPEC.entity == (
        Field("position", 2), Field("velocity", 2, unit="m/s"), Field("position", 2, True),
        Field("opening", 1), Field("opening", 1, True),
    )  # fmt: skip
    assert (SPEC.types, SPEC.width) == (("cube", "drawer"), 11)


def test_a_token_holds_differences_of_positions_named_alike() -> None:
    """Of robot, entity and goal: three of `position` (2 numbers), three of `opening` (1), none of the velocity."""
    hand, own, goal = slice(0, 2), slice(3, 5), slice(7, 9)
    assert SPEC.pairs == (
        (own, hand), (goal, hand), (slice(9, 10), slice(2, 3)), (slice(10, 11), slice(2, 3)), (goal, own),
        (slice(10, 11), slice(9, 10)),
    )  # fmt: skip
    assert SPEC.differences == 9
    assert SPEC.size == 11 + 9 * (1 + len(SPEC.fine)) + 2


def test_fine_copies_tell_centimetres() -> None:
    """The first cube lies 1 cm from the hand along x and 1 m along y; the finest scale is 1.25 cm, the bound is 2."""
    tokenizer, states = Tokenizer(SPEC, KITCHEN), states_of(KITCHEN, 1)
    states[0, 3:5] = states[0, 0:2] + [0.01, 1.0]
    tokens = tokenizer(torch.from_numpy(states).float())
    finest = 11 + 9 * len(SPEC.fine)
    assert SPEC.fine[-1] == 0.0125
    assert tokens[0, 0, finest : finest + 2].tolist() == pytest.approx([0.8, 2.0], abs=1e-4)


def test_columns_lead_to_attributes() -> None:
    """The state is robot 0-2, cube 3-8, drawer 9-10, cube 11-16, cube 17-22."""
    columns = SPEC.columns(KITCHEN)
    assert columns[0].tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 8, ABSENT, ABSENT]
    assert columns[1].tolist() == [0, 1, 2, *[ABSENT] * 6, 9, 10]
    assert columns[3].tolist() == [0, 1, 2, 17, 18, 19, 20, 21, 22, ABSENT, ABSENT]
    assert SPEC.kinds(KITCHEN).tolist() == [[1, 0], [0, 1], [1, 0], [1, 0]]


def test_what_a_type_lacks_is_0() -> None:
    tokenizer = Tokenizer(SPEC, KITCHEN)
    tokenizer.observe(5 + states_of(KITCHEN, 50))
    tokens = tokenizer(torch.full((1, KITCHEN.size), 7.0))[0]
    assert (tokens[0, 9:11] == 0).all()
    assert (tokens[1, 3:9] == 0).all()
    assert (tokens[0, :9] != 0).all()


def test_statistics_run_along() -> None:
    """Shown in parts, mean and spread are those of all that was shown, over all entities that have the attribute."""
    tokenizer = Tokenizer(SPEC, KITCHEN)
    states = 3 * states_of(KITCHEN, 300) + 2
    for part in np.split(states, [1, 50, 51]):
        tokenizer.observe(part)
    cubes = np.concatenate([states[:, 3:5], states[:, 11:13], states[:, 17:19]])
    assert tokenizer.mean[3:5].numpy() == pytest.approx(cubes.mean(0))
    assert tokenizer.variance[3:5].sqrt().numpy() == pytest.approx(cubes.std(0))
    seen = tokenizer(torch.from_numpy(states).float())[:, 0, 3]
    assert seen.numpy() == pytest.approx((states[:, 3] - cubes[:, 0].mean()) / cubes[:, 0].std(), abs=1e-5)
    assert tokenizer(torch.full((1, KITCHEN.size), 1e6))[0, 0, :9].tolist() == [CLIP] * 9


def test_a_goal_that_was_not_given_is_0() -> None:
    tokenizer, states = Tokenizer(SPEC, KITCHEN), states_of(KITCHEN, 20)
    states[:, KITCHEN.columns[0, "position", True]] = np.nan
    tokenizer.observe(states)
    tokens = tokenizer(torch.from_numpy(states).float())
    assert (tokens[:, 0, 7:9] == 0).all()
    assert tokens.isfinite().all()


def test_a_spec_outlives_its_layout() -> None:
    spec = TokenSpec.from_json(json.loads(json.dumps(SPEC.to_json())))
    assert spec == SPEC
    assert spec.columns(Layout(ARM, (CUBE,) * 9)).shape == (9, 11)


@pytest.mark.parametrize(
    ("layout", "said"),
    [
        (Layout(ARM, (CUBE, ObjectType("peg", CUBE.attributes))), "type peg"),
        (Layout(ARM, (ObjectType("cube", (*CUBE.attributes, Attribute("heat", ("heat",)))),)), "heat"),
        (Layout(ObjectType("EE", ARM.attributes[:1]), (CUBE,)), "robot"),
    ],
)
def test_other_objects_are_refused(layout: Layout, said: str) -> None:
    with pytest.raises(ArtifactError, match=said):
        SPEC.columns(layout)


@pytest.mark.parametrize(
    "spec", [None, [], {"robot": []}, {"robot": [["x", "2", False, "m"]], "entity": [], "types": [], "fine": []}]
)
def test_what_is_no_spec_is_refused(spec: object) -> None:
    with pytest.raises(ArtifactError, match="token spec cannot be read"):
        TokenSpec.from_json(spec)


def test_a_part_of_the_types_is_enough() -> None:
    assert SPEC.columns(Layout(ARM, (DRAWER,))).shape == (1, 11)
