"""All that decides how an off-policy run goes on, as arrays and JSON values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC

from roboscribe.baselines.discriminator import Discriminator
from roboscribe.baselines.replay import HindsightBuffer
from roboscribe.baselines.world_env import WorldEnv
from roboscribe.rl.checkpoint import Arrays, prefixed, under
from roboscribe.rl.torch_net import load_optimizer, optimizer_arrays

COUNTS = ("num_timesteps", "_n_updates", "_episode_num")


def save_learner(
    model: SAC, env: WorldEnv, buffer: HindsightBuffer, discriminator: Discriminator | None
) -> tuple[Arrays, dict[str, object]]:
    """Copy everything out: weights, optimizers, buffer, worlds, random generators.

    Returns:
        Arrays by name, and JSON values.
    """
    worlds, starts = env.save()
    stored, drawing = buffer.save()
    arrays: Arrays = {
        **prefixed("env", worlds),
        **prefixed("buffer", stored),
        "observed": np.asarray(model._last_obs),
        "random": torch.get_rng_state().numpy(),
    }
    for name, module in _modules(model, discriminator).items():
        weights = {key: tensor.numpy().copy() for key, tensor in module.state_dict().items()}
        arrays |= prefixed(f"weights/{name}", weights)
    for name, optimizer in _optimizers(model, discriminator).items():
        arrays |= prefixed(f"optimizer/{name}", optimizer_arrays(optimizer))
    if model.log_ent_coef is not None:
        arrays["temperature"] = model.log_ent_coef.detach().numpy().copy()
    counts = {name: int(getattr(model, name)) for name in COUNTS}
    explored = model.action_space.np_random.bit_generator.state
    return arrays, {"counts": counts, "starts": starts, "drawing": drawing, "explored": explored}


def restore_learner(
    model: SAC,
    env: WorldEnv,
    buffer: HindsightBuffer,
    discriminator: Discriminator | None,
    arrays: Arrays,
    notes: Mapping[str, Any],
) -> None:
    """Return to what `save_learner` gave."""
    env.restore(under("env", arrays), notes["starts"])
    buffer.restore(under("buffer", arrays), notes["drawing"])
    for name, module in _modules(model, discriminator).items():
        weights = under(f"weights/{name}", arrays)
        module.load_state_dict({key: torch.from_numpy(array) for key, array in weights.items()})
    for name, optimizer in _optimizers(model, discriminator).items():
        load_optimizer(optimizer, under(f"optimizer/{name}", arrays))
    if model.log_ent_coef is not None:
        model.log_ent_coef.data.copy_(torch.from_numpy(arrays["temperature"]))
    for name, count in notes["counts"].items():
        setattr(model, name, count)
    model._last_obs = np.asarray(arrays["observed"], np.float32)
    model._last_episode_starts = np.zeros(model.n_envs, np.bool_)
    model.action_space.np_random.bit_generator.state = dict(notes["explored"])
    torch.set_rng_state(torch.from_numpy(np.asarray(arrays["random"], np.uint8)))


def _modules(model: SAC, discriminator: Discriminator | None) -> dict[str, torch.nn.Module]:
    """Name everything that has weights."""
    return {"policy": model.policy, **({} if discriminator is None else {"discriminator": discriminator})}


def _optimizers(model: SAC, discriminator: Discriminator | None) -> dict[str, torch.optim.Optimizer]:
    """Name every optimizer."""
    found = {"actor": model.actor.optimizer, "critic": model.critic.optimizer}
    if model.ent_coef_optimizer is not None:
        found["temperature"] = model.ent_coef_optimizer
    return found if discriminator is None else {**found, "discriminator": discriminator.optimizer}
