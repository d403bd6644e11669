"""Chunks of actions: a small transformer over the tokens that says what to do for the next control steps."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from roboscribe.baselines.config import ChunkConfig
from roboscribe.baselines.set_network import Tokenizer
from roboscribe.rl.torch_net import mlp
from roboscribe.world.layout import FloatArray, IntArray


class Questions(nn.Module):
    """A decoder layer whose queries are the same for every state: one per action of the chunk.

    What they ask each other, and how, is computed once for a whole batch; only what they find in the tokens differs.
    """

    def __init__(self, config: ChunkConfig) -> None:
        """Build the layer."""
        super().__init__()
        width, self.heads = config.units, config.heads
        self.queries = nn.Parameter(torch.randn(config.actions, width) / width**0.5)
        self.among = nn.MultiheadAttention(width, config.heads, batch_first=True)
        self.asked, self.shown, self.given = (
            nn.Linear(width, width),
            nn.Linear(width, 2 * width),
            nn.Linear(width, width),
        )
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in range(3))
        self.each = nn.Sequential(*mlp([width, 2 * width, width], nn.ReLU))

    def forward(self, tokens: torch.Tensor) -> torch.Tensor:
        """Return (B, C, units) for tokens (B, N, units)."""
        batch, count, width = tokens.shape
        own = self.norms[0](self.queries)[None]
        queries = self.queries + self.among(own, own, own, need_weights=False)[0]
        asked = self.asked(self.norms[1](queries)).view(1, -1, self.heads, width // self.heads).transpose(1, 2)
        shown = self.shown(tokens).view(batch, count, 2, self.heads, width // self.heads).permute(2, 0, 3, 1, 4)
        found = nn.functional.scaled_dot_product_attention(asked.expand(batch, -1, -1, -1), shown[0], shown[1])
        answers = queries + self.given(found.transpose(1, 2).reshape(batch, -1, width))
        told: torch.Tensor = answers + self.each(self.norms[2](answers))
        return told


class ChunkActor(nn.Module):
    """Self-attention between tokens, then one query per action of the chunk that looks at them.

    Tokens carry no rank, so that their order does not matter.

    Source: ACT, without its variational part and on states instead of pictures.
    """

    def __init__(self, tokenizer: Tokenizer, actions: int, config: ChunkConfig) -> None:
        """Build the network for actions of `actions` numbers."""
        super().__init__()
        self.tokenizer = tokenizer
        self.embed = nn.Linear(tokenizer.spec.size, config.units)
        width, heads, hidden = config.units, config.heads, 2 * config.units
        layer = nn.TransformerEncoderLayer(width, heads, hidden, dropout=0.0, batch_first=True, norm_first=True)
        self.encoder = nn.TransformerEncoder(layer, config.layers, enable_nested_tensor=False)
        self.questions = Questions(config)
        self.norm = nn.LayerNorm(config.units)
        self.head = nn.Linear(config.units, actions)

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        """Return chunks (B, C, A) of actions in (-1, 1) for states (B, F)."""
        return self.decide(self.tokenizer(states))

    def decide(self, tokens: torch.Tensor) -> torch.Tensor:
        """Return chunks (B, C, A) of actions in (-1, 1) for tokens (B, N, size)."""
        return torch.tanh(self.head(self.norm(self.questions(self.encoder(self.embed(tokens))))))


class Ensemble:
    """What was predicted for the present by the chunks of the last steps, averaged (temporal ensembling).

    The present prediction weighs 1, the one before exp(-decay), and so on.

    Departs: in ACT the oldest weighs most (0.01); here that reached 84.5 % where this reaches 95 (docs/lab-notes.md).
    """

    def __init__(self, batch: int, decay: float) -> None:
        """Remember nothing yet of `batch` rows."""
        self._decay = decay
        self._steps = np.zeros(batch, np.int64)
        self._chunks: FloatArray = np.zeros((batch, 0, 0, 0))

    def forget(self, rows: IntArray) -> None:
        """Begin anew in some rows."""
        self._steps[rows] = 0

    def add(self, rows: IntArray, chunks: FloatArray) -> FloatArray:
        """Take the chunks (R, C, A) predicted now for `rows`; return the actions (R, A) to take."""
        if not self._chunks.size:
            self._chunks = np.zeros((len(self._steps), chunks.shape[1], *chunks.shape[1:]))
        size = chunks.shape[1]
        steps = self._steps[rows]
        self._chunks[rows, steps % size] = chunks
        ages = np.arange(size)  # steps since a prediction was made, which is also its place in its chunk
        made = (steps[:, None] - ages) % size
        predicted = self._chunks[rows[:, None], made, ages]
        weights = np.where(ages <= steps[:, None], np.exp(-self._decay * ages), 0.0)
        self._steps[rows] += 1
        actions: FloatArray = np.einsum("rc,rca->ra", weights / weights.sum(1, keepdims=True), predicted)
        return actions
