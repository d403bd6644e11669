"""Actions for demonstrations that have none: which action leads from one state to the next? (Profile `states`.).

The finger command on a grasped block leaves a trace only in contact, which random motion from initial states never
meets. So actions are tried out where the demonstrations have been: from their stored simulator states, one step each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from roboscribe.dsl.interpreter import Controller
from roboscribe.rl.adam import Adam
from roboscribe.rl.clone import gaussian_loss
from roboscribe.rl.config import InverseConfig
from roboscribe.rl.observation import CLIP, Encoder, ObservationSpec
from roboscribe.rl.pool import StartPool
from roboscribe.rl.torch_net import mlp, single_thread
from roboscribe.world.layout import FloatArray, IntArray, Layout
from roboscribe.world.rows import Rows
from roboscribe.world.task import World

OVERSHOOT = 1.5
"""Random actions are drawn from ± this and clipped to [-1, 1], so that one component in three is at a bound."""
KEEP = 0.7
"""Share of steps on which a random component stays as it was: it lasts for 3 steps on average, and leads somewhere."""
LEAST_CHANGE = 1e-6
"""Least standard deviation, in its own unit, by which a change is divided, lest what never changes is divided by 0."""


@dataclass(frozen=True)
class Transitions(Rows):
    """Control steps: states before and after (M, F), bound entities (M, n), actions (M, A) in [-1, 1]."""

    before: FloatArray
    after: FloatArray
    entities: IntArray
    actions: FloatArray


def probe(world: World, snapshots: FloatArray, entities: IntArray, actions: FloatArray) -> Transitions:
    """Try actions out from stored simulator states.

    Args:
        world: any world of the task; its present contents are lost.
        snapshots: (M, S) states to start from.
        entities: (M, n) bound there.
        actions: (T, M, A) in [-1, 1]; T steps are taken from each state.

    Returns:
        T x M transitions, fewer where physics diverged.
    """
    return _run(world, snapshots, entities, len(actions), lambda step, part, states: actions[step, part])


def explore(
    world: World, pool: StartPool, skill: Controller, config: InverseConfig, rng: np.random.Generator
) -> Transitions:
    """Run a skill from its start states with noise on its actions, which here are known."""

    def act(step: int, part: IntArray, states: FloatArray) -> FloatArray:
        meant = skill.act(states, pool.entities[part])
        return np.clip(meant + config.noise * rng.standard_normal(meant.shape), -1.0, 1.0)

    return _run(world, pool.snapshots, pool.entities, config.rollout_steps, act)


def _run(
    world: World,
    snapshots: FloatArray,
    entities: IntArray,
    steps: int,
    act: Callable[[int, IntArray, FloatArray], FloatArray],
) -> Transitions:
    """Take `steps` steps from each snapshot; `act` is told the step, which snapshots, and the present states."""
    found: list[Transitions] = []
    for first in range(0, len(snapshots), world.batch):
        part = np.arange(first, min(first + world.batch, len(snapshots)))
        rows = np.arange(len(part))
        before = world.load(rows, snapshots[part]).copy()
        for step in range(steps):
            done = act(step, part, before)
            after = world.step(rows, done).copy()
            sound = ~world.diverged(rows)
            found.append(Transitions(before[sound], after[sound], entities[part][sound], done[sound]))
            before = after
    empty = np.zeros((0, 0))
    return Transitions.concatenated(found) if found else Transitions(empty, empty, entities[:0], empty)


def random_actions(steps: int, count: int, size: int, rng: np.random.Generator) -> FloatArray:
    """Draw actions (steps, count, size) that reach the bounds often and change slowly."""
    noise = rng.uniform(-OVERSHOOT, OVERSHOOT, (steps, count, size))
    for step in range(1, steps):
        keep = rng.random((count, size)) < KEEP
        noise[step] = np.where(keep, noise[step - 1], noise[step])
    return np.clip(noise, -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class InverseModel:
    """A network from a state and its change to the action in between."""

    encoder: Encoder
    change_mean: FloatArray
    change_std: FloatArray
    network: nn.Sequential

    def inputs(self, before: FloatArray, after: FloatArray, entities: IntArray) -> torch.Tensor:
        """Encode transitions as network inputs (M, I)."""
        change = self.encoder.raw(after, entities) - self.encoder.raw(before, entities)
        normal = np.clip((change - self.change_mean) / self.change_std, -CLIP, CLIP)
        return torch.from_numpy(np.concatenate([self.encoder(before, entities), normal], axis=1).astype(np.float32))

    def infer(self, before: FloatArray, after: FloatArray, entities: IntArray) -> FloatArray:
        """Return the likeliest actions (M, A) that lead from one state to the next."""
        with torch.no_grad():
            mean, _ = self.network(self.inputs(before, after, entities)).chunk(2, dim=-1)
        actions: NDArray[np.float64] = np.tanh(mean.numpy().astype(np.float64))
        return actions


def fit_inverse(
    spec: ObservationSpec, layout: Layout, data: Transitions, config: InverseConfig, seed: int
) -> InverseModel:
    """Fit the action between two states by Gaussian log-likelihood, before the tanh.

    Args:
        spec: what of the states is seen; fitted here.
        layout: meaning of the states.
        data: transitions with known actions.
        config: settings.
        seed: decides weights and the order of samples.
    """
    single_thread()
    encoder = Encoder(spec.fitted(layout, data.before, data.entities), layout)
    change = encoder.raw(data.after, data.entities) - encoder.raw(data.before, data.entities)
    actions = data.actions.shape[1]
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = mlp([encoder.size + change.shape[1], *config.hidden, 2 * actions])
    model = InverseModel(encoder, change.mean(axis=0), np.maximum(change.std(axis=0), LEAST_CHANGE), network)
    inputs = model.inputs(data.before, data.after, data.entities)
    reach = float(np.tanh(config.limit))
    targets = torch.from_numpy(np.arctanh(np.clip(data.actions, -reach, reach)).astype(np.float32))
    generator = torch.Generator().manual_seed(seed)
    optimizer = Adam(network, config.learning_rate, config.steps)
    for _ in range(config.steps):
        batch = torch.randint(len(inputs), (config.batch,), generator=generator)
        loss = gaussian_loss(network(inputs[batch]), targets[batch], config.least_log_std)
        torch.autograd.backward(loss)
        optimizer.step()
    return model
