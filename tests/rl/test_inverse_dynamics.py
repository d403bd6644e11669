"""Actions inferred from states alone."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.segmentation import segment
from roboscribe.rl.config import CloneConfig, InverseConfig, TrainConfig
from roboscribe.rl.inverse_dynamics import explore, fit_inverse, probe, random_actions
from roboscribe.rl.observation import observation_spec
from roboscribe.rl.pool import StartPool
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import SkillEvaluator
from roboscribe.rl.subtask import Subtask
from roboscribe.rl.warm_start import Frames, clone_states, frames_of, joined
from roboscribe.world import Trajectory
from tests.rl.carry_world import HOLD, PROGRAM, Carry, Direct, layout

TASK = Carry()
QUICK = InverseConfig(steps=400, hidden=(32, 32), tries=4)
SPEC = observation_spec(controllers(PROGRAM)[1], {"b": "block"}, layout(), speeds=True)


def snapshots(count: int, seed: int) -> NDArray[np.floating[Any]]:
    states = np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 6))
    return np.concatenate([states, np.zeros((count, 1))], axis=1)


def stateful(demonstration: Trajectory) -> Trajectory:
    return replace(demonstration, snapshots=np.pad(demonstration.states, ((0, 0), (0, 1))))


def demonstrated(count: int, *, actions: bool, stored: bool) -> Frames:
    shown = [stateful(each) if stored else each for each in TASK.demonstrate(count, 0)]
    cut = zip(shown, segment(PROGRAM, shown), strict=True)
    parts = [(part, each) for each, parts in cut for part in parts if part.run_index == 0]
    return joined([frames_of(part, each, 2, actions, 2) for part, each in parts])


def test_probing_takes_one_step_from_each_state() -> None:
    starts = snapshots(7, 0)
    actions = np.random.default_rng(1).uniform(-1, 1, (1, 7, 2))
    data = probe(TASK.world(3), starts, np.zeros((7, 1), np.int64), actions)
    np.testing.assert_array_equal(data.before, starts[:, :6])
    np.testing.assert_allclose(data.after[:, :2] - data.before[:, :2], 0.05 * actions[0])
    np.testing.assert_array_equal(data.actions, actions[0])


def test_probing_goes_on_for_several_steps_and_leaves_diverged_rows_out() -> None:
    starts = np.array([[0.0, 0.2, 0.5, 0.5, 0.5, 0.5, 0], [0.98, 0.2, 0.5, 0.5, 0.5, 0.5, 0]])
    data = probe(TASK.world(2), starts, np.zeros((2, 1), np.int64), np.ones((3, 2, 2)))
    np.testing.assert_allclose(data.before[:, 0], [0.0, 0.05, 0.1])
    np.testing.assert_allclose(data.after[:, 0], [0.05, 0.1, 0.15])


def test_random_actions_reach_the_bounds_and_are_correlated() -> None:
    actions = random_actions(200, 50, 2, np.random.default_rng(0))
    assert np.abs(actions).max() == 1
    assert (np.abs(actions) == 1).mean() > 0.2
    assert (actions[1:] == actions[:-1]).mean() > 0.6


def test_recovers_the_actions_that_were_taken() -> None:
    rng = np.random.default_rng(0)
    none = np.zeros((600, 1), np.int64)
    data = probe(TASK.world(64), snapshots(600, 0), none, rng.uniform(-1, 1, (1, 600, 2)))
    model = fit_inverse(SPEC, layout(), data, QUICK, 0)
    fresh = probe(TASK.world(64), snapshots(100, 1), none[:100], rng.uniform(-1, 1, (1, 100, 2)))
    assert np.abs(model.infer(fresh.before, fresh.after, fresh.entities) - fresh.actions).mean() < 0.1


@pytest.mark.parametrize("stored", [True, False])
def test_clones_demonstrations_without_actions(stored: bool) -> None:
    frames = demonstrated(15, actions=False, stored=stored)
    starts = snapshots(60, 5)
    pool = StartPool(starts, starts[:, :6], np.zeros((60, 1), np.int64), np.zeros(60, np.int64), np.arange(60))
    held_out, training = pool.take(np.arange(30)), pool.take(np.arange(30, 60))
    evaluator = SkillEvaluator(Subtask(TASK, HOLD, ("b",), 25), held_out, TASK.world(30))
    config = TrainConfig(profile="states", target=0.9, inverse=QUICK, clone=CloneConfig(steps=250, hidden=(32, 32)))
    spec = observation_spec(controllers(PROGRAM)[0], {"b": "block"}, layout())
    fresh = Skill("hold", spec.fitted(layout(), frames.states, frames.entities), (), layout())
    found = clone_states([fresh], frames, training, SPEC, evaluator, config, 0)
    assert found is not None
    skill, rate = found
    assert rate >= 0.8
    assert rate == evaluator(skill).rate


def test_exploring_runs_the_skill_with_noise() -> None:
    starts = snapshots(5, 0)
    pool = StartPool(starts, starts[:, :6], np.zeros((5, 1), np.int64), np.zeros(5, np.int64), np.arange(5))
    data = explore(TASK.world(2), pool, Direct(carry=False), QUICK, np.random.default_rng(0))
    assert len(data) == 5 * QUICK.rollout_steps
    meant = Direct(carry=False).act(data.before, data.entities)
    assert 0 < np.abs(data.actions - meant).mean() < QUICK.noise
    assert np.abs(data.actions).max() <= 1


def test_demonstrated_actions_are_not_looked_at_unless_allowed() -> None:
    assert np.isnan(demonstrated(2, actions=False, stored=False).actions).all()
    assert not np.isnan(demonstrated(2, actions=True, stored=False).actions).any()


def test_frames_carry_the_state_that_follows() -> None:
    frames = demonstrated(3, actions=True, stored=True)
    np.testing.assert_allclose(frames.following[:, :2] - frames.states[:, :2], 0.05 * frames.actions, atol=1e-12)
    assert frames.snapshots.shape == (len(frames), 7)


def test_snapshots_are_dropped_where_some_demonstrations_lack_them() -> None:
    with_, without = (demonstrated(1, actions=True, stored=stored) for stored in (True, False))
    assert joined([with_, without]).snapshots.shape == (len(with_) + len(without), 0)
