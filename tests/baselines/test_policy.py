"""Policies: the order of entities does not matter, their number neither, and what is saved acts as before."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from roboscribe.baselines.config import METHODS, SetConfig
from roboscribe.baselines.discriminator import Discriminator
from roboscribe.baselines.policy import Policy, as_program, chunk_policy, from_parts, set_policy, to_parts
from roboscribe.baselines.set_network import SetScore
from roboscribe.baselines.set_sac import SetCritic
from roboscribe.baselines.transitions import Batch
from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import pretty
from roboscribe.errors import ArtifactError
from roboscribe.world import Layout
from roboscribe.world.layout import FloatArray
from tests.baselines.examples import ARM, CUBE, KITCHEN, TINY, only_controller, states_of
from tests.rl.carry_world import Carry

NOBODY = np.zeros((40, 0), np.int64)
ORDERS = [(2, 1, 0, 3), (3, 1, 2, 0), (2, 1, 3, 0)]


def build(kind: str, layout: Layout = KITCHEN, seed: int = 0) -> Policy:
    """Build a policy with random weights that has seen some states."""
    torch.manual_seed(seed)
    if kind == "set":
        policy: Policy = set_policy("bc", layout, 3, TINY.network)
    else:
        policy = chunk_policy("chunked-bc", layout, 3, TINY.chunks)
    policy.network.tokenizer.observe(states_of(layout, 100, seed=1))
    return policy


@pytest.mark.parametrize("kind", ["set", "chunk"])
@pytest.mark.parametrize("order", ORDERS)
def test_shuffled_entities_change_no_action(kind: str, order: tuple[int, ...]) -> None:
    policy, states = build(kind), states_of(KITCHEN, 40)
    actions = policy.act(states, NOBODY)
    assert actions.std(axis=0).min() > 0.01
    assert policy.act(KITCHEN.permute(states, order), NOBODY) == pytest.approx(actions, abs=1e-6)


@pytest.mark.parametrize("order", ORDERS)
def test_shuffled_entities_change_no_value_and_no_reward(order: tuple[int, ...]) -> None:
    tokenizer, states, after = build("set").network.tokenizer, states_of(KITCHEN, 40), states_of(KITCHEN, 40, 2)
    actions = torch.rand(40, 3)
    critic = SetCritic(3, tokenizer, TINY.network)
    judge = Discriminator(tokenizer, TINY.network, TINY.discriminator)

    def answers(order: tuple[int, ...]) -> tuple[NDArray[np.generic], NDArray[np.generic]]:
        now, later = KITCHEN.permute(states, order), KITCHEN.permute(after, order)
        values = critic(torch.from_numpy(now).float(), actions)
        batch = Batch(now, actions.double().numpy(), later, np.zeros(40, bool), np.zeros(40, bool))
        return torch.cat(values, 1).detach().numpy(), judge.reward(batch)

    (values, rewards), (shuffled, again) = answers((0, 1, 2, 3)), answers(order)
    assert values.std(axis=0).min() > 1e-3
    assert rewards.std() > 1e-4
    assert shuffled == pytest.approx(values, abs=1e-5)
    assert again == pytest.approx(rewards, abs=1e-6)


def test_tokens_are_added_up() -> None:
    """Two entities of which each gives 2 x 3 = 6, negative ones nothing; the rest of the score is linear here."""
    score = SetScore(1, SetConfig(units=1, critic_layers=1))
    weights = {"features.each.0.weight": 2.0, "score.1.weight": 1.0, "score.4.weight": 5.0}
    state = {name: torch.full_like(value, weights.get(name, 0.0)) for name, value in score.state_dict().items()}
    score.load_state_dict(state)
    assert score(torch.tensor([[[3.0], [3.0], [-4.0]]])).item() == pytest.approx(60.0)


@pytest.mark.parametrize("kind", ["set", "chunk"])
def test_a_row_does_not_depend_on_the_rows_beside_it(kind: str) -> None:
    policy, states = build(kind), states_of(KITCHEN, 40)
    together = policy.act(states, NOBODY)
    assert (policy.act(states[7:8], NOBODY[:1]) == together[7]).all()
    assert (policy.act(states[5:], NOBODY[5:]) == together[5:]).all()


@pytest.mark.parametrize("kind", ["set", "chunk"])
def test_what_is_saved_acts_as_before(kind: str) -> None:
    policy, states = build(kind), states_of(KITCHEN, 40)
    description, arrays = to_parts(policy)
    again = from_parts(json.loads(json.dumps(description)), arrays, KITCHEN)
    assert (again.act(states, NOBODY) == policy.act(states, NOBODY)).all()
    assert again.method == policy.method


@pytest.mark.parametrize("kind", ["set", "chunk"])
@pytest.mark.parametrize("count", [1, 9])
def test_any_number_of_objects(kind: str, count: int) -> None:
    """Learned on three cubes, it acts on one and on nine, and looks at each of them."""
    layout = Layout(ARM, (CUBE,) * count)
    policy = from_parts(*to_parts(build(kind, Layout(ARM, (CUBE,) * 3))), layout)
    states = states_of(layout, 4)
    actions = policy.act(states, NOBODY[:4])
    assert actions.shape == (4, 3)
    for entity in range(count):
        other = states.copy()
        other[:, layout.columns[entity, "position", False]] += 1.0
        assert (policy.act(other, NOBODY[:4]) != actions).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"baseline": "telepathy"}, "expected one of"),
        ({"outputs": 10**9}, "expected sizes up to 4096"),
        ({"network": {"units": 10**9}}, "expected sizes up to 4096"),
        ({"network": {"units": 17}}, "do not fit"),
        ({"network": {"size": 16}}, "do not fit"),
        ({"network": {"units": 0.5}}, "do not fit"),
        ({"tokens": {}}, "token spec"),
    ],
)
def test_damaged_descriptions_are_refused(change: dict[str, object], said: str) -> None:
    description, arrays = to_parts(build("set"))
    with pytest.raises(ArtifactError, match=said):
        from_parts({**description, **change}, arrays, KITCHEN)


def test_weights_that_are_not_finite_are_refused() -> None:
    description, arrays = to_parts(build("set"))
    with pytest.raises(ArtifactError, match="not finite"):
        from_parts(description, {**arrays, "head.bias": np.full(3, np.nan, np.float32)}, KITCHEN)


def test_loading_draws_no_random_numbers() -> None:
    parts = to_parts(build("set"))
    before = torch.get_rng_state()
    from_parts(*parts, KITCHEN)
    assert torch.equal(torch.get_rng_state(), before)


@pytest.mark.parametrize("method", METHODS)
def test_a_baseline_is_a_program_of_one_controller(method: str) -> None:
    program = as_program(method)  # type: ignore[arg-type]  # one of them
    assert parse_program(pretty(program)) == program


@pytest.mark.parametrize("kind", ["set", "chunk"])
def test_an_episode_depends_on_its_seed_alone(kind: str) -> None:
    """Rows that begin new episodes forget the old ones."""
    task, seeds = replace(Carry(2), horizon=12), np.arange(7)
    torch.manual_seed(0)
    policy = set_policy("bc", task.layout, 2, TINY.network)
    if kind == "chunk":
        policy = chunk_policy("chunked-bc", task.layout, 2, TINY.chunks)  # type: ignore[assignment]  # another kind
    program = as_program(policy.method)

    def states(batch: int) -> list[FloatArray]:
        done = execute(program, {only_controller(program): policy}, task, seeds, limits={}, batch=batch)
        return [trajectory.states for trajectory in done.trajectories]

    for one, many in zip(states(1), states(3), strict=True):
        assert (one == many).all()
