"""Adam by torch's own update, without its optimizer classes, which load its compiler: two seconds of a short run."""

from __future__ import annotations

from math import cos, pi

import torch
from torch import nn
from torch.optim.adam import adam


class Adam:
    """Updates a network from its gradients, at a rate that falls to nothing by half a cosine.

    Args:
        network: whose parameters are updated; all of them have a gradient at each step.
        learning_rate: of the first step.
        steps: to be taken.
    """

    def __init__(self, network: nn.Module, learning_rate: float, steps: int) -> None:
        """Start without momentum."""
        self._parameters: list[torch.Tensor] = list(network.parameters())
        self._means = [torch.zeros_like(weight) for weight in self._parameters]
        self._squares = [torch.zeros_like(weight) for weight in self._parameters]
        self._taken = [torch.zeros(()) for _ in self._parameters]
        self._rates = iter([learning_rate * (1 + cos(pi * step / steps)) / 2 for step in range(steps)])

    @torch.no_grad()
    def step(self) -> None:
        """Update once, and forget the gradients."""
        adam(
            self._parameters,
            [weight.grad for weight in self._parameters if weight.grad is not None],
            self._means,
            self._squares,
            [],
            self._taken,
            fused=True,
            amsgrad=False,
            beta1=0.9,
            beta2=0.999,
            lr=next(self._rates),
            weight_decay=0.0,
            eps=1e-8,
            maximize=False,
        )
        for weight in self._parameters:
            weight.grad = None
