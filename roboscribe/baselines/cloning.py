"""Behaviour cloning: of single actions by the set policy, and of chunks of actions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi
from typing import TypeAlias

import numpy as np
import torch
from torch import nn

from roboscribe.baselines.config import ChunkConfig, CloningConfig, SetConfig
from roboscribe.baselines.course import Course
from roboscribe.baselines.policy import ChunkPolicy, SetPolicy, chunk_policy, set_policy
from roboscribe.baselines.set_network import Tokenizer
from roboscribe.baselines.transitions import check_actions, cut
from roboscribe.rl.checkpoint import prefixed, under
from roboscribe.rl.torch_net import load_optimizer, optimizer_arrays, single_thread
from roboscribe.world import Task, Trajectory
from roboscribe.world.layout import FloatArray

Loss: TypeAlias = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
"""Gives the loss of what is seen of some frames, tokens (M, N, size), and of the frames (M,)."""
GENERATOR = "generator"


def clone_actions(
    task: Task, shown: Sequence[Trajectory], network: SetConfig, config: CloningConfig, course: Course
) -> SetPolicy:
    """Fit the set policy to demonstrated actions; the last weights are kept, no rollouts choose them.

    Args:
        task: tells where demonstrations succeed first, and are cut.
        shown: demonstrations with actions.
        network: sizes.
        config: settings.
        course: gradient steps, seed, checkpoint, log.

    Raises:
        DemonstrationError: demonstrations without actions.
        ArtifactError: the checkpoint cannot be used.

    Source: BC of Sec. 5: squared error of actions, the state is the whole scene.
    Departs: tokens hold differences of positions, too, their numbers are blurred, and the learning rate falls; without
        these, 48.5 % of pick-place-1 instead of the paper's 84.8 % (docs/lab-notes.md).
    """
    check_actions(shown, "bc")
    parts = [cut(trajectory, task) for trajectory in shown]
    states, actions = _frames(parts), np.concatenate([part.actions for part in parts if part.actions is not None])
    with torch.random.fork_rng():
        torch.manual_seed(course.seed)
        policy = set_policy("bc", task.layout, task.action_size, network)
    targets = _tensor(np.clip(actions, -1.0, 1.0))

    def loss(tokens: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        return squared_error(policy.network.decide(tokens), targets[rows])

    _descend(policy.network, _seen(policy.network.tokenizer, states), loss, config, course)
    return policy


def clone_chunks(task: Task, shown: Sequence[Trajectory], config: ChunkConfig, course: Course) -> ChunkPolicy:
    """Fit the chunk policy to demonstrated actions; arguments as of `clone_actions`.

    Source: ACT, without its variational part.
    """
    check_actions(shown, "chunked-bc")
    parts = [cut(trajectory, task) for trajectory in shown]
    states = _frames(parts)
    chunks, known = chunks_of(parts, config.actions)
    with torch.random.fork_rng():
        torch.manual_seed(course.seed)
        policy = chunk_policy("chunked-bc", task.layout, task.action_size, config)
    targets, mask = _tensor(chunks), _tensor(known)

    def loss(tokens: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        return absolute_error(policy.network.decide(tokens), targets[rows], mask[rows])

    _descend(policy.network, _seen(policy.network.tokenizer, states), loss, config.cloning, course)
    return policy


def squared_error(found: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """Return the mean squared error of actions (M, A)."""
    return ((found - wanted) ** 2).mean()


def absolute_error(found: torch.Tensor, wanted: torch.Tensor, known: torch.Tensor) -> torch.Tensor:
    """Return the mean absolute error of chunks (M, C, A) where actions are known (M, C)."""
    errors = (found - wanted).abs().mean(-1) * known
    return errors.sum() / known.sum()


def chunks_of(trajectories: Sequence[Trajectory], size: int) -> tuple[FloatArray, FloatArray]:
    """Cut the chunk of every frame: its action and those that follow in the demonstration.

    Returns:
        Chunks (M, size, A), and 1 where a demonstration has such an action, 0 beyond its end (M, size).
    """
    chunks: list[FloatArray] = []
    known: list[FloatArray] = []
    for trajectory in trajectories:
        assert trajectory.actions is not None
        places = np.arange(len(trajectory.actions))[:, None] + np.arange(size)
        last = len(trajectory.actions) - 1
        chunks.append(np.clip(trajectory.actions, -1.0, 1.0)[np.minimum(places, last)])
        known.append((places <= last).astype(np.float64))
    return np.concatenate(chunks), np.concatenate(known)


def _frames(parts: Sequence[Trajectory]) -> FloatArray:
    """Gather the states (M, F) in which an action was taken."""
    return np.concatenate([part.states[:-1] for part in parts])


def _tensor(array: FloatArray) -> torch.Tensor:
    return torch.from_numpy(array.astype(np.float32))


@dataclass(frozen=True)
class Seen:
    """What is seen of all frames.

    Args:
        tokens: (M, N, size).
        numbers: how many of a token's numbers are attributes and differences; the rest tells its type.
    """

    tokens: torch.Tensor
    numbers: int

    def blurred(self, rows: torch.Tensor, noise: float, generator: torch.Generator) -> torch.Tensor:
        """Return the tokens of some frames with noise of a standard deviation on their numbers."""
        tokens = self.tokens[rows]
        if noise > 0:
            tokens[..., : self.numbers] += noise * torch.randn(tokens[..., : self.numbers].shape, generator=generator)
        return tokens


def _seen(tokenizer: Tokenizer, states: FloatArray) -> Seen:
    """Take mean and spread from states (M, F), and turn them into tokens once for all."""
    tokenizer.observe(states)
    return Seen(tokenizer(_tensor(states)), tokenizer.spec.size - len(tokenizer.spec.types))


def learning_rate(config: CloningConfig, step: int, steps: int) -> float:
    """Return the rate of a gradient step (from 1), falling along a cosine from the first to almost 0 at the last."""
    return config.learning_rate * (1 + cos(pi * (step - 1) / steps)) / 2


def _descend(network: nn.Module, seen: Seen, loss: Loss, config: CloningConfig, course: Course) -> None:
    """Take the gradient steps, or those that a killed run had left; the weights are the same bit for bit."""
    single_thread()
    generator = torch.Generator().manual_seed(course.seed)
    optimizer = torch.optim.Adam(network.parameters(), lr=config.learning_rate, fused=True)
    first = 1 + _resume(network, optimizer, generator, course)
    total = 0.0
    for step in range(first, course.steps + 1):
        optimizer.param_groups[0]["lr"] = learning_rate(config, step, course.steps)
        rows = torch.randint(len(seen.tokens), (config.batch,), generator=generator)
        found = loss(seen.blurred(rows, config.input_noise, generator), rows)
        optimizer.zero_grad()
        torch.autograd.backward(found)
        optimizer.step()
        total += float(found.detach())
        if step % config.checkpoint_every == 0 or step == course.steps:
            course.log({"loss": total / ((step - 1) % config.checkpoint_every + 1)}, step)
            total = 0.0
            _keep(network, optimizer, generator, step, course)


def _keep(
    network: nn.Module, optimizer: torch.optim.Optimizer, generator: torch.Generator, step: int, course: Course
) -> None:
    """Write a checkpoint."""
    weights = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    arrays = {**prefixed("network", weights), **prefixed("optimizer", optimizer_arrays(optimizer))}
    course.keep({**arrays, GENERATOR: generator.get_state().numpy()}, {"step": step})


def _resume(network: nn.Module, optimizer: torch.optim.Optimizer, generator: torch.Generator, course: Course) -> int:
    """Return to the checkpoint, where there is one; returns the steps done."""
    kept = course.kept()
    if kept is None:
        return 0
    arrays, notes = kept
    weights = under("network", arrays)
    network.load_state_dict({name: torch.from_numpy(array) for name, array in weights.items()})
    load_optimizer(optimizer, under("optimizer", arrays))
    generator.set_state(torch.from_numpy(arrays[GENERATOR]))
    return int(str(notes["step"]))
