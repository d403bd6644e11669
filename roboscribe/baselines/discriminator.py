"""The discriminator of GAIL and goalGAIL: does a transition come from a demonstration? It sees no actions."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn
from torch.nn.functional import logsigmoid

from roboscribe.baselines.config import DiscriminatorConfig, SetConfig
from roboscribe.baselines.set_network import SetScore, Tokenizer
from roboscribe.baselines.transitions import Batch
from roboscribe.world.layout import FloatArray


class Discriminator(nn.Module):
    """A set network on the tokens of a state and of the state after; its score is a logit.

    Source: goalGAIL, on (s, s', g). Departs: tanh units as there, in the set architecture of the paper.
    """

    def __init__(self, tokenizer: Tokenizer, network: SetConfig, config: DiscriminatorConfig) -> None:
        """Build the network and its optimizer."""
        super().__init__()
        self.config = config
        self.tokenizer = tokenizer
        self.score = SetScore(2 * tokenizer.spec.size, network, nn.Tanh)
        self.optimizer = torch.optim.Adam(self.score.parameters(), lr=config.learning_rate, fused=True)

    def tokens(self, batch: Batch) -> torch.Tensor:
        """Return the tokens (R, N, 2 size) of transitions."""
        states, following = (torch.from_numpy(part.astype(np.float32)) for part in (batch.states, batch.following))
        return torch.cat([self.tokenizer(states), self.tokenizer(following)], dim=-1)

    @torch.no_grad()
    def reward(self, batch: Batch) -> FloatArray:
        """Return the reward (R,) of transitions: never positive, the higher the more they look demonstrated."""
        rewards: FloatArray = imitation_reward(self.score(self.tokens(batch)), self.config.scale)[:, 0].double().numpy()
        return rewards

    def update(self, own: Batch, shown: Batch) -> float:
        """Take one gradient step; returns the loss."""
        mine, theirs = self.tokens(own), self.tokens(shown)
        share = torch.rand(len(mine), 1, 1)
        penalty = gradient_penalty(self.score, share * mine + (1 - share) * theirs)
        loss = gan_loss(self.score(theirs), self.score(mine)) + self.config.penalty * penalty
        self.optimizer.zero_grad()
        torch.autograd.backward(loss)
        self.optimizer.step()
        return float(loss.detach())


def imitation_reward(logits: torch.Tensor, scale: float) -> torch.Tensor:
    """Return scale · log D of logits."""
    return scale * logsigmoid(logits)


def gan_loss(shown: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
    """Return the mean of −log D over logits of demonstrated transitions plus that of −log(1 − D) over own ones."""
    return -logsigmoid(shown).mean() - logsigmoid(-own).mean()


def gradient_penalty(score: nn.Module, tokens: torch.Tensor) -> torch.Tensor:
    """Return the mean over tokens (R, N, D) of how far the score's gradient is from norm 1, squared."""
    tokens = tokens.detach().requires_grad_()
    (gradient,) = torch.autograd.grad(score(tokens).sum(), tokens, create_graph=True)
    away: torch.Tensor = gradient.flatten(1).norm(dim=1) - 1
    return (away**2).mean()
