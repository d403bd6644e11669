"""The set policy as Stable-Baselines3's SAC takes it."""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.type_aliases import PyTorchObs
from stable_baselines3.sac.policies import SACPolicy
from torch import nn

from roboscribe.baselines.config import SetConfig
from roboscribe.baselines.set_network import SetActor, SetFeatures, SetScore, Tokenizer

CRITICS = 2


class SetExtractor(BaseFeaturesExtractor):
    """The actor up to the sum over tokens; the library puts mean and spread of actions behind it."""

    def __init__(self, observation_space: spaces.Box, tokenizer: Tokenizer, config: SetConfig) -> None:
        """Build the layers."""
        super().__init__(observation_space, config.units)
        self.tokenizer = tokenizer
        self.features = SetFeatures(tokenizer.spec.size, config.units, config.actor_layers)

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        """Turn states (B, F) into features (B, units)."""
        features: torch.Tensor = self.features(self.tokenizer(states))
        return features


class SetCritic(nn.Module):
    """Twin critics; the action is appended to every token."""

    optimizer: torch.optim.Optimizer

    def __init__(self, actions: int, tokenizer: Tokenizer, config: SetConfig) -> None:
        """Build the critics for actions of `actions` numbers."""
        super().__init__()
        self.tokenizer = tokenizer
        inputs = tokenizer.spec.size + actions
        scores = (SetScore(inputs, config, layer_norm=config.critic_norm) for _ in range(CRITICS))
        self.scores = nn.ModuleList(scores)

    def forward(self, states: torch.Tensor, actions: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return each critic's value (B, 1) of actions (B, A) in states (B, F)."""
        tokens = self.tokenizer(states)
        joined = torch.cat([tokens, actions[:, None].expand(-1, tokens.shape[1], -1)], dim=-1)
        return tuple(score(joined) for score in self.scores)

    def set_training_mode(self, mode: bool) -> None:
        """Do what the library asks of a critic."""
        self.train(mode)


class SetSacPolicy(SACPolicy):
    """Actor and critics of the set policy. The library is told the tokenizer and the sizes for its extractor."""

    def __init__(self, *arguments: Any, random_actions: float = 0.0, **options: Any) -> None:  # noqa: ANN401 - the library's
        """Build it; `random_actions` is the share of actions that are drawn evenly, unless they are deterministic."""
        self.random_actions = random_actions
        super().__init__(*arguments, **options)

    def _predict(self, observation: PyTorchObs, deterministic: bool = False) -> torch.Tensor:
        """Return actions (B, A) for observations (B, F)."""
        actions = super()._predict(observation, deterministic)
        if deterministic or not self.random_actions:
            return actions
        anywhere = 2 * torch.rand_like(actions) - 1
        return torch.where(torch.rand(len(actions), 1) < self.random_actions, anywhere, actions)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> SetCritic:  # type: ignore[override]  # all that SAC asks of one
        """Build the critics."""
        return SetCritic(self.action_space.shape[0], **self.features_extractor_kwargs)  # type: ignore[index]  # a box


def policy_settings(tokenizer: Tokenizer, config: SetConfig, random_actions: float) -> dict[str, object]:
    """Return what the library is told to build the policy."""
    return {
        "random_actions": random_actions,
        "net_arch": {"pi": [], "qf": []},
        "features_extractor_class": SetExtractor,
        "features_extractor_kwargs": {"tokenizer": tokenizer, "config": config},
        "optimizer_kwargs": {"fused": True},
    }


def copy_actor(policy: SACPolicy, network: SetActor) -> None:
    """Copy the weights that lead to the mean action; the tokenizer is the same."""
    extractor = policy.actor.features_extractor
    assert isinstance(extractor, SetExtractor)
    network.features.load_state_dict(extractor.features.state_dict())
    assert isinstance(policy.actor.mu, nn.Linear)
    network.head.load_state_dict(policy.actor.mu.state_dict())
