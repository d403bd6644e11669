"""A learned low-level controller: what it sees, and the weights of its network. Runs on numpy alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from roboscribe.errors import ArtifactError
from roboscribe.rl.observation import Encoder, ObservationSpec
from roboscribe.world.layout import FloatArray, IntArray, Layout

Float32Array: TypeAlias = NDArray[np.float32]
Layers: TypeAlias = tuple[tuple[Float32Array, Float32Array], ...]
"""Weight (out, in) and bias (out,) of each linear layer; ELU or ReLU between layers."""

CHUNK = 32
"""Rows multiplied at once. A fixed shape keeps one row's action independent, bit for bit, of the rows beside it."""
ACTIVATIONS = ("elu", "relu")


def forward(layers: Layers, inputs: Float32Array, activation: str = "elu") -> Float32Array:
    """Apply the network to inputs (R, O); returns pre-tanh means (R, A)."""
    rows = len(inputs)
    padded = np.zeros((-(-rows // CHUNK), CHUNK, inputs.shape[1]), np.float32)
    padded.reshape(-1, inputs.shape[1])[:rows] = inputs
    outputs = [_forward_chunk(layers, chunk, activation) for chunk in padded]
    means: Float32Array = np.concatenate([np.zeros((0, len(layers[-1][1])), np.float32), *outputs])[:rows]
    return means


def _forward_chunk(layers: Layers, hidden: Float32Array, activation: str) -> Float32Array:
    for rank, (weight, bias) in enumerate(layers):
        hidden = hidden @ weight.T + bias
        if rank < len(layers) - 1:
            rectified = np.maximum(hidden, 0)
            hidden = rectified if activation == "relu" else rectified + np.expm1(np.minimum(hidden, 0))
    return hidden


@dataclass(frozen=True, eq=False)
class Skill:
    """π_φ as a deterministic controller: the tanh of its network's mean.

    Args:
        name: the controller's name in the program.
        spec: what it sees.
        layers: weights.
        layout: meaning of the states it will be given; `on` moves it to another layout.
        activation: "elu", or "relu" as in the paper.
    """

    name: str
    spec: ObservationSpec
    layers: Layers
    layout: Layout
    activation: str = "elu"

    @cached_property
    def encoder(self) -> Encoder:
        """The spec bound to the layout."""
        return Encoder(self.spec, self.layout)

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return actions (R, A) in (-1, 1) for states (R, F) and bound entities (R, n)."""
        mean = forward(self.layers, self.encoder(states, entities), self.activation)
        return np.tanh(mean.astype(np.float64))

    def on(self, layout: Layout) -> Skill:
        """Return the same skill for a task with another number of objects."""
        return replace(self, layout=layout)

    def with_layers(self, layers: Layers) -> Skill:
        """Return the skill with other weights of the same shapes."""
        return replace(self, layers=layers)

    def to_parts(self) -> tuple[dict[str, object], dict[str, Float32Array]]:
        """Return a JSON description and named weights, as saved programs store them."""
        return {"observation": self.spec.to_json(), "activation": self.activation}, layer_arrays(self.layers)

    @staticmethod
    def from_parts(
        name: str, description: Mapping[str, object], arrays: Mapping[str, NDArray[np.generic]], layout: Layout
    ) -> Skill:
        """Read what `to_parts` wrote.

        Raises:
            ArtifactError: the description or the shapes of the weights do not fit together.
        """
        observation, activation = description.get("observation"), description.get("activation")
        if not isinstance(observation, Mapping) or activation not in ACTIVATIONS:
            msg = f"skill {name}: expected an observation spec and an activation of {ACTIVATIONS}, got {activation!r}"
            raise ArtifactError(msg)
        spec = ObservationSpec.from_json(observation)
        layers = layers_from(arrays, f"skill {name}")
        size = _input_size(name, spec, layout)
        if layers[0][0].shape[1] != size:
            msg = f"skill {name}: weights take {layers[0][0].shape[1]} inputs, its observation has {size}"
            raise ArtifactError(msg)
        return Skill(name, spec, layers, layout, str(activation))


def layer_arrays(layers: Layers) -> dict[str, Float32Array]:
    """Name every array `rank.weight` or `rank.bias`."""
    weights = {f"{rank}.weight": weight for rank, (weight, _) in enumerate(layers)}
    return weights | {f"{rank}.bias": bias for rank, (_, bias) in enumerate(layers)}


def _input_size(name: str, spec: ObservationSpec, layout: Layout) -> int:
    try:
        size = Encoder(spec, layout).size
    except (KeyError, StopIteration, IndexError) as error:
        msg = f"skill {name} sees {spec.parts} of types {spec.types}, which this task does not declare"
        raise ArtifactError(msg) from error
    if spec.mean and len(spec.mean) != len(spec.std):
        msg = f"skill {name}: {len(spec.mean)} means but {len(spec.std)} spreads"
        raise ArtifactError(msg)
    return size


def layers_from(arrays: Mapping[str, NDArray[np.generic]], owner: str) -> Layers:
    """Assemble the layers that `layer_arrays` named.

    Raises:
        ArtifactError: arrays are missing, do not chain, are not float32 or not finite; names the `owner`.
    """
    count = len(arrays) // 2
    expected = {f"{rank}.{kind}" for rank in range(count) for kind in ("weight", "bias")}
    if count == 0 or set(arrays) != expected:
        msg = f"{owner}: found arrays {sorted(arrays)}, expected 0.weight, 0.bias, 1.weight, ..."
        raise ArtifactError(msg)
    layers: list[tuple[Float32Array, Float32Array]] = []
    for rank in range(count):
        weight, bias = arrays[f"{rank}.weight"], arrays[f"{rank}.bias"]
        fits = weight.ndim == 2 and bias.shape == weight.shape[:1]
        chained = rank == 0 or weight.shape[1:] == layers[-1][1].shape
        finite = weight.dtype == bias.dtype == np.float32 and np.isfinite(weight).all() and np.isfinite(bias).all()
        if not (fits and chained and finite):
            msg = f"{owner}: layer {rank} has shapes {weight.shape}, {bias.shape} of {weight.dtype}, or is not finite"
            raise ArtifactError(msg)
        layers.append((weight.astype(np.float32), bias.astype(np.float32)))
    return tuple(layers)
