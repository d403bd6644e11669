"""A skill acts by its network, row by row, wherever its rows stand, and survives being saved."""

import json
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import controllers
from roboscribe.errors import ArtifactError
from roboscribe.rl.clone import initial_skill
from roboscribe.rl.observation import observation_spec
from roboscribe.rl.skill import CHUNK, Skill
from roboscribe.rl.torch_net import linears, load_layers, mlp
from tests.rl.carry_world import PROGRAM, layout


def skill(blocks: int = 1, seed: int = 0) -> Skill:
    states = np.random.default_rng(1).uniform(-1, 1, (50, layout(blocks).size))
    spec = observation_spec(controllers(PROGRAM)[1], {"b": "block"}, layout(blocks))
    fitted = spec.fitted(layout(blocks), states, np.zeros((50, 1), np.int64))
    return initial_skill(Skill("at", fitted, (), layout(blocks)), 2, (16, 8), seed)


def test_acts_as_the_same_network_in_torch() -> None:
    made = skill()
    states, entities = np.random.default_rng(0).uniform(-1, 1, (7, 6)), np.zeros((7, 1), np.int64)
    network = mlp([made.encoder.size, 16, 8, 2])
    load_layers(network, made.layers)
    with torch.no_grad():
        expected = torch.tanh(network(torch.from_numpy(made.encoder(states, entities)))).numpy()
    np.testing.assert_allclose(made.act(states, entities), expected, atol=1e-6)


def test_a_row_acts_alike_bit_for_bit_in_every_company() -> None:
    made = skill()
    states = np.random.default_rng(0).uniform(-1, 1, (2 * CHUNK + 5, 6))
    entities = np.zeros((len(states), 1), np.int64)
    together = made.act(states, entities)
    alone = [made.act(states[i : i + 1], entities[i : i + 1])[0] for i in range(len(states))]
    np.testing.assert_array_equal(together, alone)
    np.testing.assert_array_equal(made.act(states[::-1], entities)[::-1], together)


def test_no_rows_give_no_actions() -> None:
    assert skill().act(np.zeros((0, 6)), np.zeros((0, 1), np.int64)).shape == (0, 2)


def test_works_on_more_blocks_than_it_was_built_for() -> None:
    made = skill()
    states = np.random.default_rng(0).uniform(-1, 1, (3, 14))
    alone = np.concatenate([states[:, :2], states[:, 10:14]], axis=1)
    moved = made.on(layout(3)).act(states, np.full((3, 1), 2))
    np.testing.assert_array_equal(moved, made.act(alone, np.zeros((3, 1), np.int64)))


def test_saved_and_read_it_acts_alike() -> None:
    made = skill()
    description, arrays = made.to_parts()
    read = Skill.from_parts("at", json.loads(json.dumps(description)), arrays, layout(1))
    states = np.random.default_rng(0).uniform(-1, 1, (4, 6))
    np.testing.assert_array_equal(read.act(states, np.zeros((4, 1), int)), made.act(states, np.zeros((4, 1), int)))


def test_relu_skills_round_trip_too() -> None:
    made = Skill("at", skill().spec, skill().layers, layout(1), "relu")
    description, arrays = made.to_parts()
    assert Skill.from_parts("at", description, arrays, layout(1)).activation == "relu"


Array: TypeAlias = NDArray[np.floating[Any]]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("0.weight", lambda array: array[:, :-1]),
        ("1.weight", lambda array: array[:, :-1]),
        ("1.bias", lambda array: array[:-1]),
        ("2.weight", lambda array: array * np.float32("nan")),
        ("2.weight", lambda array: array.astype(np.float64)),
    ],
)
def test_weights_that_do_not_fit_are_refused(name: str, change: Callable[[Array], Array]) -> None:
    description, arrays = skill().to_parts()
    with pytest.raises(ArtifactError, match="at"):
        Skill.from_parts("at", description, arrays | {name: change(arrays[name])}, layout(1))


def test_missing_weights_and_unknown_activations_are_refused() -> None:
    description, arrays = skill().to_parts()
    with pytest.raises(ArtifactError, match=r"0\.weight"):
        Skill.from_parts("at", description, {"1.weight": arrays["1.weight"]}, layout(1))
    with pytest.raises(ArtifactError, match="activation"):
        Skill.from_parts("at", description | {"activation": "sine"}, arrays, layout(1))


def test_weights_follow_the_seed() -> None:
    assert all((a == b).all() for a, b in zip(skill().layers[0], skill().layers[0], strict=True))
    assert not (skill(seed=1).layers[0][0] == skill().layers[0][0]).all()
    assert len(linears(mlp([3, 4, 2]))) == 2
