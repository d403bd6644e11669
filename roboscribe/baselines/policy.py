"""Baselines as controllers: what runs them, saves them and loads them. A baseline is a program of one controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from roboscribe.baselines.chunk_network import ChunkActor, Ensemble
from roboscribe.baselines.config import METHODS, ChunkConfig, Method, SetConfig
from roboscribe.baselines.set_network import SetActor, Tokenizer
from roboscribe.baselines.tokens import TokenSpec
from roboscribe.dsl.syntax import Program, Robot, Run, Solved
from roboscribe.errors import ArtifactError
from roboscribe.rl.torch_net import single_thread
from roboscribe.world.layout import FloatArray, IntArray, Layout

ROWS = 32
"""Rows computed at once. A fixed shape keeps one row's action independent, bit for bit, of the rows beside it."""
BASELINE = "baseline"
"""Key that tells a baseline's description from that of a program's controller; its value is the method."""
LARGEST = 4096
"""Greatest size of a layer that is built for a saved baseline."""
Arrays: TypeAlias = dict[str, NDArray[np.generic]]


@torch.no_grad()
def outputs(network: nn.Module, states: FloatArray) -> FloatArray:
    """Apply a network to states (R, F), `ROWS` at a time."""
    single_thread()
    padded = np.zeros((-(-len(states) // ROWS) * ROWS, states.shape[1]), np.float32)
    padded[: len(states)] = states
    parts = [network(torch.from_numpy(padded[start : start + ROWS])).numpy() for start in range(0, len(padded), ROWS)]
    found: FloatArray = np.concatenate(parts)[: len(states)].astype(np.float64)
    return found


@dataclass(frozen=True, eq=False)
class SetPolicy:
    """A policy that looks at the present state alone.

    Args:
        method: how it was learned.
        config: sizes of its network.
        network: gives actions.
    """

    method: Method
    config: SetConfig
    network: SetActor

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return actions (R, A) for states (R, F); what is bound to variables does not matter."""
        return outputs(self.network, states)


@dataclass(frozen=True, eq=False)
class ChunkPolicy:
    """A policy that averages what it predicted for the present in earlier steps.

    Args:
        method: how it was learned.
        config: sizes of its network, and how fast predictions lose weight.
        network: gives chunks of actions.
    """

    method: Method
    config: ChunkConfig
    network: ChunkActor

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return actions (R, A) for states (R, F) of which nothing came before."""
        return outputs(self.network, states)[:, 0]

    def remember(self, batch: int) -> ChunkMemory:
        """Return what acts in `batch` rows and remembers their episodes."""
        return ChunkMemory(self, Ensemble(batch, self.config.decay))


@dataclass(frozen=True, eq=False)
class ChunkMemory:
    """A chunk policy at work."""

    policy: ChunkPolicy
    ensemble: Ensemble

    def forget(self, rows: IntArray) -> None:
        """Begin episodes in some rows."""
        self.ensemble.forget(rows)

    def act(self, rows: IntArray, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return actions (R, A) for states (R, F) of `rows`."""
        return self.ensemble.add(rows, outputs(self.policy.network, states))


Policy: TypeAlias = SetPolicy | ChunkPolicy


def set_policy(method: Method, layout: Layout, actions: int, config: SetConfig) -> SetPolicy:
    """Build a set policy with fresh weights for a layout."""
    return SetPolicy(method, config, SetActor(Tokenizer(TokenSpec.of(layout), layout), actions, config))


def chunk_policy(method: Method, layout: Layout, actions: int, config: ChunkConfig) -> ChunkPolicy:
    """Build a chunk policy with fresh weights for a layout."""
    return ChunkPolicy(method, config, ChunkActor(Tokenizer(TokenSpec.of(layout), layout), actions, config))


def name_of(method: Method) -> str:
    """Name a method's controller as programs name controllers."""
    return method.replace("-", "_")


def as_program(method: Method) -> Program:
    """Write the program that a baseline is: one controller until the task is solved.

    Departs: other controllers see their arguments alone, a baseline's sees the whole state.
    """
    run = Run(name_of(method), (Robot(),), Solved())
    return Program(name_of(method).upper(), run)


def to_parts(policy: Policy) -> tuple[dict[str, object], Arrays]:
    """Return a JSON description and named weights, as saved programs store them."""
    network, sizes = policy.network, policy.config
    kept = ("units", "actor_layers", "actions", "layers", "heads", "decay")
    about: dict[str, object] = {
        BASELINE: policy.method,
        "tokens": network.tokenizer.spec.to_json(),
        "outputs": network.head.out_features,
        "network": {name: getattr(sizes, name) for name in kept if hasattr(sizes, name)},
    }
    return about, {name: tensor.numpy().copy() for name, tensor in network.state_dict().items()}


def from_parts(description: Mapping[str, object], arrays: Mapping[str, NDArray[np.generic]], layout: Layout) -> Policy:
    """Read what `to_parts` wrote, for a layout with any number of entities.

    Raises:
        ArtifactError: description and weights do not fit together, or not the layout.
    """
    method, actions, shape = (description.get(name) for name in (BASELINE, "outputs", "network"))
    if method not in METHODS or not isinstance(actions, int) or not isinstance(shape, Mapping):
        msg = f"baseline {method!r}: found {actions!r} outputs and network {shape!r}, expected one of {METHODS}"
        raise ArtifactError(msg)
    if not all(isinstance(size, int | float) and 0 <= size <= LARGEST for size in (actions, *shape.values())):
        msg = f"baseline {method}: found {actions} outputs and network {dict(shape)}, expected sizes up to {LARGEST}"
        raise ArtifactError(msg)
    tokenizer = Tokenizer(TokenSpec.from_json(description.get("tokens")), layout)
    try:
        with torch.random.fork_rng():
            policy = _empty(method, shape, tokenizer, actions)
        weights = {name: torch.from_numpy(np.array(array)) for name, array in arrays.items()}
        policy.network.load_state_dict(weights)
    except (TypeError, ValueError, RuntimeError, AssertionError) as error:
        msg = f"baseline {method}: network {dict(shape)} and its weights do not fit ({str(error).splitlines()[0]})"
        raise ArtifactError(msg) from error
    if not all(bool(tensor.isfinite().all()) for tensor in policy.network.state_dict().values()):
        msg = f"baseline {method}: found weights that are not finite"
        raise ArtifactError(msg)
    return policy


def _empty(method: Method, shape: Mapping[str, object], tokenizer: Tokenizer, actions: int) -> Policy:
    """Build a policy whose weights are still to come."""
    sizes = {str(name): value for name, value in shape.items()}
    if method == "chunked-bc":
        chunks = ChunkConfig(**sizes)  # type: ignore[arg-type]  # a wrong one raises when the network is built
        return ChunkPolicy(method, chunks, ChunkActor(tokenizer, actions, chunks))
    network = SetConfig(**sizes)  # type: ignore[arg-type]  # as above
    return SetPolicy(method, network, SetActor(tokenizer, actions, network))
