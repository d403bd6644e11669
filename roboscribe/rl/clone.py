"""Warm start: clone a skill from the demonstrated actions of its segments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import nn

from roboscribe.rl.adam import Adam
from roboscribe.rl.config import CloneConfig
from roboscribe.rl.skill import Layers, Skill
from roboscribe.rl.torch_net import layers_of, mlp, single_thread
from roboscribe.world.layout import FloatArray, IntArray
from roboscribe.world.rows import Rows

MAX_GRADIENT = 10.0
"""Norm to which a step's gradient is clipped: lets ordinary steps through and takes the sting out of a rare outlier."""
MOST_LOG_STD = 2.0
"""Upper clip of the predicted log standard deviation, pre-tanh: e² is more than the whole range of targets."""


@dataclass(frozen=True)
class CloningSamples(Rows):
    """Demonstrated frames of one skill: states (M, F), bound entities (M, n), actions (M, A) in [-1, 1]."""

    states: FloatArray
    entities: IntArray
    actions: FloatArray

    def known(self) -> CloningSamples:
        """Leave out frames whose action is unknown (NaN)."""
        return self.take(~np.isnan(self.actions).any(axis=1))


def initial_skill(skill: Skill, action_size: int, hidden: tuple[int, ...], seed: int) -> Skill:
    """Return a skill with fresh weights.

    Args:
        skill: gives name, spec and layout.
        action_size: A.
        hidden: units of each hidden layer.
        seed: decides the weights.
    """
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return skill.with_layers(layers_of(mlp([skill.encoder.size, *hidden, action_size])))


def clone(skill: Skill, samples: CloningSamples, config: CloneConfig, seed: int) -> Iterator[tuple[int, Skill]]:
    """Fit a skill's network to demonstrated actions, yielding it at several numbers of gradient steps.

    The loss is the Gaussian log-likelihood of the pre-tanh action with a predicted, state-dependent variance: frames
    on which demonstrators disagree weigh less, which a squared error cannot do. Noise on the normalised inputs keeps
    a clone from hanging where no demonstration has been. Training loss says little about the success of the clone, so
    the caller chooses among the yielded skills by rollouts.

    Args:
        skill: gives spec, layout and sizes; its weights are not used.
        samples: demonstrated frames.
        config: settings.
        seed: decides initial weights and the order of samples.

    Yields:
        Gradient steps done, and the skill then.
    """
    single_thread()
    generator = torch.Generator().manual_seed(seed)
    inputs = torch.from_numpy(skill.encoder(samples.states, samples.entities))
    reach = float(np.tanh(config.limit))
    targets = torch.from_numpy(np.arctanh(np.clip(samples.actions, -reach, reach)).astype(np.float32))
    actions = targets.shape[1]
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = mlp([inputs.shape[1], *config.hidden, 2 * actions])
    steps = min(config.steps, max(config.least_steps, len(samples)))
    optimizer = Adam(network, config.learning_rate, steps)
    stops = {steps * (rank + 1) // config.checkpoints for rank in range(config.checkpoints)}
    for step in range(1, steps + 1):
        batch = torch.randint(len(inputs), (config.batch,), generator=generator)
        blurred = inputs[batch] + config.input_noise * torch.randn(config.batch, inputs.shape[1], generator=generator)
        loss = gaussian_loss(network(blurred), targets[batch], config.least_log_std)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(network.parameters(), MAX_GRADIENT)
        optimizer.step()
        if step in stops:
            yield step, skill.with_layers(_mean_layers(layers_of(network), actions))


def foretelling_error(skill: Skill, samples: CloningSamples, config: CloneConfig, seed: int) -> float:
    """Return how far a short clone of either half of the frames is from the actions of the other half.

    What it sees that does not matter misleads it about demonstrations that it was not fitted to.

    Args:
        skill: as in `clone`.
        samples: demonstrated frames, one demonstration after the other.
        config: settings.
        seed: decides everything.

    Returns:
        Mean squared distance of actions; 0 of a single frame.
    """
    halves = [samples.take(half) for half in np.array_split(np.arange(len(samples)), 2)]
    if not all(len(half) for half in halves):
        return 0.0
    short = replace(config, steps=min(config.steps, config.least_steps), checkpoints=1)
    errors = []
    for shown, other in (halves, reversed(halves)):
        ((_, fitted),) = clone(skill, shown, short, seed)
        errors.append(((fitted.act(other.states, other.entities) - other.actions) ** 2).sum(axis=1).mean())
    return float(np.mean(errors))


def gaussian_loss(output: torch.Tensor, target: torch.Tensor, least_log_std: float) -> torch.Tensor:
    """Return the mean negative log-likelihood of targets (M, A) under outputs (M, 2A): means, then log spreads."""
    mean, log_std = output.chunk(2, dim=-1)
    log_std = log_std.clamp(least_log_std, MOST_LOG_STD)
    return (0.5 * ((target - mean) / log_std.exp()) ** 2 + log_std).sum(-1).mean()


def _mean_layers(layers: Layers, actions: int) -> Layers:
    """Drop the outputs for the spread."""
    weight, bias = layers[-1]
    return (*layers[:-1], (weight[:actions].copy(), bias[:actions].copy()))
