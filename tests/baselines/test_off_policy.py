"""The learner that DeepSet, GAIL, goalGAIL and RLPD share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from roboscribe.baselines.config import RECIPES, BaselineConfig, Method, OffPolicyConfig
from roboscribe.baselines.course import Course
from roboscribe.baselines.discriminator import Discriminator
from roboscribe.baselines.off_policy import Learned, learn_off_policy
from roboscribe.baselines.policy import SetPolicy, set_policy, to_parts
from roboscribe.baselines.set_sac import SetSacPolicy, policy_settings
from roboscribe.baselines.transitions import shown_transitions
from roboscribe.envs.catalogue import make_task
from roboscribe.errors import DemonstrationError
from tests.baselines.examples import TINY
from tests.baselines.reach import Reach, ReachWorld
from tests.baselines.test_cloning import success
from tests.rl.carry_world import Carry

LEARNERS = tuple(method for method, recipe in RECIPES.items() if recipe.rollouts)
REACH = Reach()


def never(policy: SetPolicy) -> float:
    return 0.0


def learn(method: Method, course: Course, task: Carry | Reach = REACH, config: BaselineConfig = TINY) -> Learned:
    """Run a method with few demonstrations and evaluations that see no success."""
    return learn_off_policy(task, method, task.demonstrate(8, 0), config, course, judge=never)


def weights(learned: Learned) -> Mapping[str, bytes]:
    return {name: array.tobytes() for name, array in to_parts(learned.policy)[1].items()}


def test_deepset_solves_a_planar_task() -> None:
    """Within 20,000 control steps, without demonstrations; the steps are the method's own."""
    settings = OffPolicyConfig(batch=256, learning_starts=1_000, evaluate_every=10_000)
    config = BaselineConfig(learner=settings)
    curve: list[tuple[int, float]] = []
    course = Course(10_000, log=lambda metrics, step: curve.append((step, metrics["success"])))
    learned = learn_off_policy(REACH, "deepset", (), config, course, judge=lambda policy: success(policy, REACH))
    assert learned.control_steps == 9_984
    assert curve == [(9_984, success(learned.policy, REACH))]
    assert success(learned.policy, REACH, episodes=300) >= 0.95


@pytest.mark.parametrize("method", LEARNERS)
def test_a_killed_run_goes_on_to_the_same_weights(method: Method, tmp_path: Path) -> None:
    """Weights, buffer, worlds and random numbers are those of a run that nobody killed, bit for bit."""
    told: list[int] = []

    def killed(metrics: Mapping[str, float], step: int) -> None:
        told.append(step)
        if told == [160, 320]:
            raise KeyboardInterrupt

    whole = learn(method, Course(480, seed=2))
    course = Course(480, 2, tmp_path / "c.safetensors", killed)
    with pytest.raises(KeyboardInterrupt):
        learn(method, course)
    torch.manual_seed(99)
    np.random.seed(99)  # noqa: NPY002 - whatever the process drew meanwhile
    assert weights(learn(method, course)) == weights(whole)
    assert told == [160, 320, 320, 480]
    assert weights(learn(method, Course(480, seed=3))) != weights(whole)


def numpy_state() -> list[int]:
    """Return the state of numpy's global generator, which the library uses."""
    state = np.random.get_state()  # noqa: NPY002
    assert isinstance(state, tuple)
    return [int(number) for number in state[1]]


def test_the_process_s_random_numbers_are_left_alone() -> None:
    before = torch.get_rng_state(), numpy_state()
    learn("deepset", Course(160))
    assert torch.equal(torch.get_rng_state(), before[0])
    assert numpy_state() == before[1]


@dataclass(frozen=True)
class Watched(Reach):
    """A reach whose worlds can be counted."""

    worlds: list[ReachWorld] = field(default_factory=list)

    def world(self, batch: int) -> ReachWorld:
        self.worlds.append(super().world(batch))
        return self.worlds[-1]


@pytest.mark.parametrize("method", LEARNERS)
@pytest.mark.parametrize("name", ["pick-place-1", "tower-2", "pick-place-cond", "table-top", "place-cubes-drawer-1"])
def test_every_method_learns_in_every_family_of_tasks(name: str, method: Method) -> None:
    """Past the random actions of the beginning, on real physics, goals replaced and discriminators taught."""
    task = make_task(name)
    shown = task.demonstrate(1, 0) if RECIPES[method].states else []
    learned = learn_off_policy(task, method, shown, TINY, Course(160), judge=never)
    assert weights(learned) != weights(learn_off_policy(task, method, shown, TINY, Course(0), judge=never))


@pytest.mark.parametrize(("budget", "used"), [(0, 0), (7, 0), (8, 8), (250, 248), (480, 480)])
def test_budgets_are_kept(budget: int, used: int) -> None:
    task = Watched()
    learned = learn("deepset", Course(budget), task)
    assert learned.control_steps == used
    assert [world.control_steps for world in task.worlds if world.batch == TINY.learner.worlds] == [used]


def test_a_hopeless_run_is_given_up_where_there_are_several_objects() -> None:
    config = replace(TINY, learner=replace(TINY.learner, hopeless_after=200))
    assert learn("deepset", Course(800), Carry(2), config).hopeless
    assert learn("deepset", Course(800), Carry(2), config).control_steps == 320
    assert learn("deepset", Course(800), Carry(1), config).control_steps == 800
    once = learn_off_policy(Carry(2), "deepset", (), config, Course(800), judge=lambda policy: 0.01)
    assert (once.control_steps, once.hopeless) == (800, False)


def test_rlpd_needs_actions() -> None:
    without_actions = [replace(shown, actions=None) for shown in REACH.demonstrate(3, 0)]
    with pytest.raises(DemonstrationError, match="rlpd learns from actions"):
        learn_off_policy(REACH, "rlpd", without_actions, TINY, Course(160), judge=never)
    learn_off_policy(REACH, "gail", without_actions, TINY, Course(160), judge=never)


def test_a_discriminator_learns_to_tell() -> None:
    """Demonstrations move 5 cm at most; a hand that jumps is told from them."""
    shown = shown_transitions(REACH.demonstrate(60, 0), REACH)
    jumping = replace(shown.batch, following=shown.batch.states + np.array([0.5, 0.0, 0.5, 0.0, 0.0, 0.0]))
    torch.manual_seed(0)
    tokenizer = set_policy("gail", REACH.layout, 2, TINY.network).network.tokenizer
    tokenizer.observe(shown.batch.states)
    judge = Discriminator(tokenizer, replace(TINY.network, units=64), TINY.discriminator)
    rng = np.random.default_rng(0)
    for _ in range(300):
        rows = rng.integers(len(jumping), size=128)
        judge.update(jumping.take(rows), shown.draw(rng, 128, 0.0, REACH))
    true, false = judge.reward(shown.batch), judge.reward(jumping)
    assert true.max() <= 0
    assert true.mean() > false.mean() + 0.02


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, 0, 0), (0.3, 240, 360), (1.0, 1000, 1000)])
def test_a_share_of_exploring_actions_is_drawn_evenly(share: float, least: int, most: int) -> None:
    """Of a policy that would always do the same."""
    tokenizer = set_policy("deepset", REACH.layout, 2, TINY.network).network.tokenizer
    box, actions = spaces.Box(-np.inf, np.inf, (6,)), spaces.Box(-1.0, 1.0, (2,))
    settings: dict[str, Any] = policy_settings(tokenizer, TINY.network, share)
    policy = SetSacPolicy(box, actions, lambda _: 1e-3, **settings)
    assert isinstance(policy.actor.log_std, torch.nn.Linear)
    torch.nn.init.constant_(policy.actor.log_std.bias, -20.0)
    torch.nn.init.zeros_(policy.actor.log_std.weight)
    states = torch.ones(1000, 6)
    usual = policy._predict(states, deterministic=True)
    found = policy._predict(states)
    others = int(((found - usual).abs().max(dim=1).values > 1e-3).sum())
    assert least <= others <= most
    assert (usual == policy._predict(states, deterministic=True)).all()
