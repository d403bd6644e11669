"""The set network: every token passes through the same layers, the results are added up."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from roboscribe.baselines.config import SetConfig
from roboscribe.baselines.tokens import ABSENT, TokenSpec
from roboscribe.rl.observation import FINE_CLIP
from roboscribe.rl.torch_net import mlp
from roboscribe.world.layout import FloatArray, Layout

CLIP = 5.0
"""Bound of a normalised attribute or difference, in standard deviations."""
LEAST_SPREAD = 0.01
"""Least standard deviation by which an attribute is divided, in its unit."""


class Tokenizer(nn.Module):
    """Cuts states into normalised tokens. Mean and spread run along with what `observe` is shown.

    What a type lacks, and a goal that was not given (NaN), is 0, the mean.
    """

    columns: torch.Tensor
    kinds: torch.Tensor
    count: torch.Tensor
    mean: torch.Tensor
    variance: torch.Tensor
    metres: torch.Tensor

    def __init__(self, spec: TokenSpec, layout: Layout) -> None:
        """Bind a spec to a layout; the statistics, but not the layout, are part of the weights."""
        super().__init__()
        self.spec = spec
        columns = spec.columns(layout)
        found = np.where(columns == ABSENT, layout.size, columns)  # the column behind the last one holds NaN
        self.register_buffer("columns", torch.from_numpy(found), persistent=False)
        self.register_buffer("kinds", torch.from_numpy(spec.kinds(layout)).float(), persistent=False)
        self.register_buffer("metres", torch.tensor(spec.metres), persistent=False)
        for name, value in (("count", 0.0), ("mean", 0.0), ("variance", 1.0)):
            self.register_buffer(name, torch.full((spec.width + spec.differences,), value, dtype=torch.float64))

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        """Turn states (B, F) into tokens (B, N, size)."""
        raw = self.raw(states)
        spread = self.variance.sqrt().clamp(min=LEAST_SPREAD).float()
        normal = ((raw - self.mean.float()) / spread).clamp(-CLIP, CLIP)
        differences = raw[..., self.spec.width :] * self.metres
        fine = [(differences / scale).clamp(-FINE_CLIP, FINE_CLIP) for scale in self.spec.fine]
        seen = torch.cat([normal, *fine], dim=-1)
        kinds = self.kinds.expand(len(states), *self.kinds.shape)
        return torch.cat([torch.where(seen.isnan(), 0.0, seen), kinds], dim=-1)

    def raw(self, states: torch.Tensor) -> torch.Tensor:
        """Gather attributes and differences (B, N, width + differences) of states (B, F), in their units.

        NaN where there is none.
        """
        padded = torch.cat([states, torch.full_like(states[:, :1], torch.nan)], dim=1)
        found = padded[:, self.columns.flatten()].view(len(states), *self.columns.shape)
        return torch.cat([found, *(found[..., here] - found[..., there] for here, there in self.spec.pairs)], dim=-1)

    @torch.no_grad()
    def observe(self, states: FloatArray) -> None:
        """Add states (B, F) to the statistics."""
        raw = self.raw(torch.as_tensor(states, dtype=torch.float64)).flatten(0, 1)
        count = (~raw.isnan()).sum(0).double()
        mean = raw.nanmean(0).nan_to_num()
        variance = ((raw - mean) ** 2).nanmean(0).nan_to_num()
        total = (self.count + count).clamp(min=1.0)
        shift = mean - self.mean
        spread = self.variance * self.count + variance * count + shift**2 * self.count * count / total
        seen = self.count + count > 0
        self.mean.copy_(torch.where(seen, self.mean + shift * count / total, self.mean))
        self.variance.copy_(torch.where(seen, spread / total, self.variance))
        self.count.add_(count)


class SetFeatures(nn.Module):
    """The sum over tokens of what hidden layers make of each; all layers end in ReLU."""

    def __init__(self, inputs: int, units: int, layers: int, activation: type[nn.Module] = nn.ReLU) -> None:
        """Build `layers` layers of `units`."""
        super().__init__()
        self.each = nn.Sequential(*mlp([inputs] + [units] * layers, activation), activation())

    def forward(self, tokens: torch.Tensor) -> torch.Tensor:
        """Turn tokens (B, N, inputs) into features (B, units)."""
        features: torch.Tensor = self.each(tokens).sum(dim=1)
        return features


class SetActor(nn.Module):
    """The set policy's deterministic part: token layers, sum, linear, tanh."""

    def __init__(self, tokenizer: Tokenizer, actions: int, config: SetConfig) -> None:
        """Build the network for actions of `actions` numbers."""
        super().__init__()
        self.tokenizer = tokenizer
        self.features = SetFeatures(tokenizer.spec.size, config.units, config.actor_layers)
        self.head = nn.Linear(config.units, actions)

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        """Return actions (B, A) in (-1, 1) for states (B, F)."""
        return self.decide(self.tokenizer(states))

    def decide(self, tokens: torch.Tensor) -> torch.Tensor:
        """Return actions (B, A) in (-1, 1) for tokens (B, N, size)."""
        return torch.tanh(self.head(self.features(tokens)))


class SetScore(nn.Module):
    """A number for a set: token layers, sum, one more hidden layer, linear."""

    def __init__(
        self, inputs: int, config: SetConfig, activation: type[nn.Module] = nn.ReLU, *, layer_norm: bool = False
    ) -> None:
        """Build the network for tokens of `inputs` numbers; `layer_norm` after the sum and after the hidden layer."""
        super().__init__()
        self.features = SetFeatures(inputs, config.units, config.critic_layers, activation)
        norms = [nn.LayerNorm(config.units) if layer_norm else nn.Identity() for _ in range(2)]
        hidden = nn.Linear(config.units, config.units)
        self.score = nn.Sequential(norms[0], hidden, norms[1], activation(), nn.Linear(config.units, 1))

    def forward(self, tokens: torch.Tensor) -> torch.Tensor:
        """Return (B, 1) for tokens (B, N, inputs)."""
        score: torch.Tensor = self.score(self.features(tokens))
        return score
