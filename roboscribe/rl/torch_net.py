"""Networks in torch, and the way from and to a skill's weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from roboscribe.rl.skill import Layers


def single_thread() -> None:
    """Keep torch on one thread: two threads were measured from 5 ms up to 400 ms per update under load."""
    torch.set_num_threads(1)


def mlp(sizes: Sequence[int], activation: type[nn.Module] = nn.ELU) -> nn.Sequential:
    """Build linear layers of the given sizes with an activation between them."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), activation()]
    return nn.Sequential(*layers[:-1])


def linears(network: nn.Module) -> list[nn.Linear]:
    """List a network's linear layers in order."""
    return [module for module in network.modules() if isinstance(module, nn.Linear)]


def layers_of(network: nn.Module) -> Layers:
    """Copy the weights out."""
    return tuple((_array(linear.weight), _array(linear.bias)) for linear in linears(network))


def _array(parameter: torch.Tensor) -> NDArray[np.float32]:
    return parameter.detach().numpy().astype(np.float32, copy=True)


def load_layers(network: nn.Module, layers: Layers) -> None:
    """Copy weights in; shapes must match."""
    with torch.no_grad():
        for linear, (weight, bias) in zip(linears(network), layers, strict=True):
            linear.weight.copy_(torch.from_numpy(weight))
            linear.bias.copy_(torch.from_numpy(bias))


def optimizer_arrays(optimizer: torch.optim.Optimizer) -> dict[str, NDArray[np.generic]]:
    """Copy an optimizer's moments out, named `rank of parameter/moment`."""
    state = optimizer.state_dict()["state"]
    return {
        f"{rank}/{name}": value.numpy().copy() for rank, moments in state.items() for name, value in moments.items()
    }


def load_optimizer(optimizer: torch.optim.Optimizer, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Copy moments in."""
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in arrays.items():
        rank, moment = name.split("/")
        state.setdefault(int(rank), {})[moment] = torch.from_numpy(value)
    groups = optimizer.state_dict()["param_groups"]
    optimizer.load_state_dict({"state": state, "param_groups": groups})
