"""The way between our environments and rsl-rl-lib's PPO: its `VecEnv`, its settings, its log."""

from __future__ import annotations

import contextlib
import io

import numpy as np
import torch
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner
from rsl_rl.utils.logger import Logger
from tensordict import TensorDict

from roboscribe.rl.config import PpoConfig
from roboscribe.rl.observation import Encoder
from roboscribe.rl.skill import Layers
from roboscribe.rl.skill_env import SkillEnv
from roboscribe.rl.torch_net import linears, load_layers

GROUP = "policy"
"""Name of the only observation group."""
MAX_GRADIENT = 1.0
"""Norm to which an update's gradient is clipped; the library's own default."""
CRITIC_SCALE = 0.1
"""Factor on the critic's last layer: it starts by expecting next to nothing, not something of the size of a return."""
NO_ENTROPY = 0.0
"""Weight of the entropy bonus: the noise is fixed, so there is no entropy to win."""


class RslEnv(VecEnv):  # type: ignore[misc] # the library ships no types
    """A skill's environment as rsl-rl steps it. Policies act before the tanh, so no density needs a correction."""

    def __init__(self, env: SkillEnv, encoder: Encoder, action_size: int) -> None:
        """Wrap an environment that has been restarted or restored."""
        self.env, self.encoder = env, encoder
        self.num_envs, self.num_actions = env.batch, action_size
        self.max_episode_length = env.subtask.limit
        self.episode_length_buf = torch.zeros(env.batch, dtype=torch.long)
        self.device = "cpu"
        self.cfg: dict[str, object] = {}
        self.attempts, self.successes = 0, 0

    def get_observations(self) -> TensorDict:
        """Return the present observations."""
        inputs = torch.from_numpy(self.encoder(self.env.states, self.env.entities))
        return TensorDict({GROUP: inputs}, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, torch.Tensor]]:
        """Apply pre-tanh actions (B, A)."""
        outcome = self.env.step(np.tanh(actions.numpy().astype(np.float64)))
        ended = outcome.terminated | outcome.truncated
        self.attempts += int(ended.sum())
        self.successes += int(outcome.succeeded.sum())
        extras = {"time_outs": torch.from_numpy(outcome.truncated)}
        rewards = torch.from_numpy(outcome.reward.astype(np.float32))
        return self.get_observations(), rewards, torch.from_numpy(ended), extras


class LossLog(Logger):  # type: ignore[misc] # the library ships no types
    """rsl-rl's log of an iteration, kept as plain numbers instead of printed and written to a directory."""

    def log(self, *_: object, loss_dict: dict[str, float], **timing: object) -> None:
        """Keep the losses and the seconds of the iteration."""
        seconds = {name: value for name, value in timing.items() if isinstance(value, float)}
        self.metrics = {f"{name}_loss": float(value) for name, value in loss_dict.items()}
        self.metrics |= {name: seconds[name] for name in ("collect_time", "learn_time")}


def build_runner(env: RslEnv, layers: Layers, config: PpoConfig) -> OnPolicyRunner:
    """Build rsl-rl's runner with the actor's weights copied in and separate steps for actor and critic.

    Args:
        env: wrapped environment.
        layers: weights of the warm start.
        config: settings.
    """
    hidden = [len(bias) for _, bias in layers[:-1]]
    fixed_noise = {
        "class_name": "GaussianDistribution",
        "init_std": config.noise,
        "std_type": "scalar",
        "learn_std": False,
    }
    network = {"class_name": "MLPModel", "hidden_dims": hidden, "activation": "elu"}
    settings = {
        "num_steps_per_env": config.steps,
        "save_interval": 1,
        "check_for_nan": True,
        "obs_groups": {"actor": [GROUP], "critic": [GROUP]},
        "actor": {**network, "distribution_cfg": fixed_noise},
        "critic": network,
        "algorithm": {
            "class_name": "PPO", "num_learning_epochs": config.epochs, "num_mini_batches": config.minibatches,
            "clip_param": config.clip, "gamma": config.gamma, "lam": config.lam, "entropy_coef": NO_ENTROPY,
            "schedule": "fixed", "use_clipped_value_loss": False, "max_grad_norm": MAX_GRADIENT,
        },
    }  # fmt: skip
    with contextlib.redirect_stdout(io.StringIO()):  # the library prints its models
        runner = OnPolicyRunner(env, settings, log_dir=None)
    runner.logger = LossLog(
        None, runner.cfg, env.cfg, env.num_envs, is_distributed=False, gpu_world_size=1, gpu_global_rank=0, device="cpu"
    )
    load_layers(runner.alg.actor, layers)
    for linear in linears(runner.alg.critic)[-1:]:
        linear.weight.data.mul_(CRITIC_SCALE)
    groups = [(runner.alg.actor, config.actor_rate), (runner.alg.critic, config.critic_rate)]
    parameters = [{"params": list(model.parameters()), "lr": rate} for model, rate in groups]
    runner.alg.optimizer = torch.optim.Adam(parameters, fused=True)
    return runner
