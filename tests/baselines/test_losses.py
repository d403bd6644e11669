"""Losses and rewards equal values worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch import nn

from roboscribe.baselines.chunk_network import Ensemble
from roboscribe.baselines.cloning import absolute_error, squared_error
from roboscribe.baselines.discriminator import gan_loss, gradient_penalty, imitation_reward
from roboscribe.baselines.replay import task_reward
from roboscribe.baselines.transitions import Batch

LOG2 = math.log(2.0)


def test_squared_error_of_actions() -> None:
    found, wanted = torch.tensor([[0.5, -1.0], [0.0, 0.0]]), torch.tensor([[0.0, 1.0], [0.0, 1.0]])
    assert squared_error(found, wanted).item() == pytest.approx((0.25 + 4.0 + 0.0 + 1.0) / 4)


def test_absolute_error_of_chunks_counts_known_actions_only() -> None:
    found = torch.tensor([[[1.0, 0.0], [0.0, 0.0]], [[0.5, 0.5], [9.0, 9.0]]])
    wanted = torch.tensor([[[0.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.0]]])
    known = torch.tensor([[1.0, 1.0], [1.0, 0.0]])
    assert absolute_error(found, wanted, known).item() == pytest.approx((0.5 + 0.5 + 0.5) / 3)


def test_gan_loss() -> None:
    """An undecided discriminator pays log 2 twice; log D of logit log 3 is log 3/4, log(1 − D) is log 1/4."""
    nought, three = torch.zeros(4, 1), torch.full((4, 1), math.log(3.0))
    assert gan_loss(nought, nought).item() == pytest.approx(2 * LOG2)
    assert gan_loss(three, three).item() == pytest.approx(-math.log(0.75) - math.log(0.25))
    assert gan_loss(three, -three).item() == pytest.approx(-2 * math.log(0.75))


def test_imitation_reward_is_never_positive() -> None:
    rewards = imitation_reward(torch.tensor([0.0, math.log(3.0), 40.0]), 0.1)
    assert rewards.tolist() == pytest.approx([-0.1 * LOG2, 0.1 * math.log(0.75), 0.0], abs=1e-7)


class Slope(nn.Module):
    """A score with the same gradient everywhere."""

    def forward(self, tokens: torch.Tensor) -> torch.Tensor:
        return (tokens * torch.tensor([3.0, 4.0])).sum((1, 2))[:, None]


@pytest.mark.parametrize(("entities", "norm"), [(1, 5.0), (4, 10.0)])
def test_gradient_penalty(entities: int, norm: float) -> None:
    """The gradient of 3 x + 4 y has norm 5; over four tokens it has norm 5 times the root of 4."""
    assert gradient_penalty(Slope(), torch.randn(6, entities, 2)).item() == pytest.approx((norm - 1) ** 2)


def test_the_task_s_reward_is_success() -> None:
    truth = np.array([True, False, False])
    batch = Batch(np.zeros((3, 2)), np.zeros((3, 1)), np.zeros((3, 2)), truth, np.array([False, True, False]))
    assert task_reward(batch).tolist() == [1.0, 0.0, 0.0]
    assert batch.ended.tolist() == [True, True, False]


def test_temporal_ensembling() -> None:
    """Chunks of three: the present prediction weighs 1, the one before e^-d, that of two steps ago e^-2d."""
    decay, row = 0.5, np.array([0])
    ensemble = Ensemble(1, decay)
    first, second, third, fourth = (
        np.array([[[base], [base + 1.0], [base + 2.0]]]) for base in (0.0, 10.0, 20.0, 30.0)
    )
    w, v = math.exp(-decay), math.exp(-2 * decay)
    assert ensemble.add(row, first).item() == pytest.approx(0.0)
    assert ensemble.add(row, second).item() == pytest.approx((10.0 + w * 1.0) / (1 + w))
    assert ensemble.add(row, third).item() == pytest.approx((20.0 + w * 11.0 + v * 2.0) / (1 + w + v))
    assert ensemble.add(row, fourth).item() == pytest.approx((30.0 + w * 21.0 + v * 12.0) / (1 + w + v))
    ensemble.forget(row)
    assert ensemble.add(row, third).item() == pytest.approx(20.0)
