"""Cloning: its loss by hand, and what it makes of clean and of contradictory demonstrations."""

import numpy as np
import pytest
import torch

from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.segmentation import segment
from roboscribe.rl.clone import CloningSamples, clone, foretelling_error, gaussian_loss
from roboscribe.rl.config import CloneConfig
from roboscribe.rl.observation import observation_spec
from roboscribe.rl.skill import Skill
from tests.rl.carry_world import PROGRAM, Carry, Direct, layout

QUICK = CloneConfig(steps=200, hidden=(32, 32), checkpoints=2)


def blank(samples: CloningSamples) -> Skill:
    spec = observation_spec(controllers(PROGRAM)[0], {"b": "block"}, layout())
    return Skill("hold", spec.fitted(layout(), samples.states, samples.entities), (), layout())


def reaching(count: int, seed: int) -> CloningSamples:
    states, entities = np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 6)), np.zeros((count, 1), np.int64)
    return CloningSamples(states, entities, Direct(carry=False).act(states, entities))


def test_loss_is_the_negative_log_likelihood_up_to_a_constant() -> None:
    output = torch.tensor([[0.5, -1.0, np.log(2.0), 0.0]])
    target = torch.tensor([[1.5, 1.0]])
    expected = 0.5 * (1 / 2) ** 2 + np.log(2.0) + 0.5 * 2**2
    assert gaussian_loss(output, target, -3.0).item() == pytest.approx(expected)


def test_loss_bounds_the_spread_from_below() -> None:
    output = torch.tensor([[0.0, -100.0]])
    assert gaussian_loss(output, torch.tensor([[0.0]]), -3.0).item() == pytest.approx(-3.0)


def test_clones_the_demonstrator() -> None:
    samples = reaching(400, 0)
    *_, (steps, cloned) = clone(blank(samples), samples, QUICK, 0)
    fresh = reaching(200, 1)
    error = np.abs(cloned.act(fresh.states, fresh.entities) - fresh.actions)
    assert steps == QUICK.steps
    assert error.mean() < 0.1


def test_few_demonstrations_are_foretold_best_by_what_matters_and_an_action_that_heeds_the_goal_by_the_goal() -> None:
    least, most = (
        observation_spec(controllers(PROGRAM)[0], {"b": "block"}, layout(), goals=goals) for goals in (False, True)
    )
    few, many = reaching(12, 0), reaching(200, 0)
    towards_goal = CloningSamples(many.states, many.entities, Direct(carry=True).act(many.states, many.entities))
    for samples, better, worse in ((few, least, most), (towards_goal, most, least)):
        skills = [
            Skill("hold", spec.fitted(layout(), samples.states, samples.entities), (), layout())
            for spec in (better, worse)
        ]
        errors = [foretelling_error(skill, samples, QUICK, 0) for skill in skills]
        assert errors[0] < errors[1]


def test_one_frame_foretells_no_other() -> None:
    samples = reaching(1, 0)
    assert foretelling_error(blank(samples), samples, QUICK, 0) == 0.0


def test_checkpoints_are_evenly_spaced() -> None:
    samples = reaching(50, 0)
    assert [steps for steps, _ in clone(blank(samples), samples, QUICK, 0)] == [100, 200]


def test_same_seed_same_weights_another_seed_others() -> None:
    samples = reaching(50, 0)
    one, same, other = (list(clone(blank(samples), samples, QUICK, seed))[-1][1].layers[0][0] for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, same)
    assert not (one == other).all()


def test_a_few_wild_frames_do_not_spoil_the_rest() -> None:
    samples = reaching(400, 0)
    actions = samples.actions.copy()
    wild = np.random.default_rng(1).choice(400, 20, replace=False)
    actions[wild] = -actions[wild]
    *_, (_, cloned) = clone(blank(samples), CloningSamples(samples.states, samples.entities, actions), QUICK, 0)
    fresh = reaching(200, 2)
    assert np.abs(cloned.act(fresh.states, fresh.entities) - fresh.actions).mean() < 0.15


def test_frames_without_an_action_are_left_out() -> None:
    samples = reaching(4, 0)
    samples.actions[1] = np.nan
    known = samples.known()
    assert len(known) == 3
    np.testing.assert_array_equal(known.states, samples.states[[0, 2, 3]])


def test_segments_of_demonstrations_split_at_hold() -> None:
    (demonstration,) = Carry().demonstrate(1, 0)
    ((first, second),) = segment(PROGRAM, [demonstration])
    gap = np.linalg.norm(demonstration.states[:, :2] - demonstration.states[:, 2:4], axis=1)
    assert (first.start, second.stop) == (0, len(demonstration) - 1)
    assert gap[second.start] < 0.04 <= gap[: first.stop].min()
