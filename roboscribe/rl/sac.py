"""SAC on predicate rewards, through Stable-Baselines3: the learner of the paper, and of profile `paper`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.logger import KVWriter, Logger

from roboscribe.rl.config import SacConfig
from roboscribe.rl.learner import Learned, LearnerTask, Log, no_log
from roboscribe.rl.observation import Encoder
from roboscribe.rl.skill import Layers, Skill
from roboscribe.rl.skill_env import SkillEnv
from roboscribe.rl.torch_net import layers_of, single_thread
from roboscribe.rl.vec_env import RowsEnv

UNMEASURED = -1.0
"""Success before the first evaluation: below every rate, so that the first policy evaluated is kept."""


class SacEnv(RowsEnv):
    """A skill's environment as Stable-Baselines3 steps it. Rewards are R_φ + 1 while φ, not scaled by 1 − γ."""

    def __init__(self, env: SkillEnv, encoder: Encoder, action_size: int) -> None:
        """Wrap an environment; `reset` starts it."""
        self.env, self.encoder = env, encoder
        self.actions: NDArray[np.float32] = np.zeros((env.batch, action_size), np.float32)
        bounds = np.full(encoder.size, np.inf, np.float32)
        super().__init__(env.batch, spaces.Box(-bounds, bounds), spaces.Box(-1.0, 1.0, (action_size,), np.float32))

    def reset(self) -> NDArray[np.float32]:
        """Start every row afresh."""
        self.env.restart()
        return self._observed()

    def _observed(self) -> NDArray[np.float32]:
        return self.encoder(self.env.states, self.env.entities)

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions for `step_wait`."""
        self.actions = actions

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, object]]]:
        """Apply the kept actions."""
        outcome = self.env.step(self.actions.astype(np.float64))
        ended = outcome.terminated | outcome.truncated
        final = self.encoder(outcome.final, outcome.final_entities)
        notes: list[dict[str, object]] = [{} for _ in ended]
        for row in np.flatnonzero(ended):
            notes[row] = {"terminal_observation": final[row], "TimeLimit.truncated": bool(outcome.truncated[row])}
        rewards = (outcome.reward / (1 - self.env.gamma)).astype(np.float32)
        return self._observed(), rewards, ended, notes


@dataclass
class Metrics(KVWriter):
    """The library's metrics, kept as plain numbers."""

    latest: dict[str, float]

    def write(self, key_values: dict[str, object], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Keep the numbers of the latest record."""
        numbers = {key: value for key, value in key_values.items() if isinstance(value, int | float)}
        self.latest |= {key.removeprefix("train/"): float(value) for key, value in numbers.items()}

    def close(self) -> None:
        """Do nothing."""


def train_sac(
    skill: Skill, task: LearnerTask, config: SacConfig, seed: int, log: Log = no_log, activation: str = "relu"
) -> Learned:
    """Learn a skill from scratch by SAC; the best evaluated policy is kept.

    No checkpoint is written while it runs: its replay buffer would dominate every file. A killed run learns the
    skill again, to the same weights.

    Args:
        skill: gives name, spec and layout; its weights are not used.
        task: subtask, start states, evaluation, target and budget.
        config: settings.
        seed: decides everything.
        log: receives metrics at every evaluation.
        activation: of the networks.

    Returns:
        The best evaluated skill.

    Source: Sec. 4.3.3 and 5; settings of the authors' implementation.
    Departs: attempts start from a pool of states in which the predecessor was reached, end with φ (paid as if φ held
        for ever), and many rows are stepped per round, so that updates, the costly part, are fewer per control step.
    """
    single_thread()
    with global_generators():
        env = SkillEnv(task.subtask, task.pool, config.worlds, config.gamma, np.random.default_rng(seed))
        metrics: dict[str, float] = {}
        model = _build(SacEnv(env, skill.encoder, task.subtask.task.action_size), config, seed)
        model.set_logger(Logger(None, [Metrics(metrics)]))
        best, success, spent, evaluating = skill, UNMEASURED, 0, 0
        turn = config.worlds * config.evaluate_every
        while spent + turn <= min(task.budget, task.most - evaluating) and success < task.target:
            model.learn(turn, log_interval=task.budget, reset_num_timesteps=spent == 0)
            spent = model.num_timesteps
            model.logger.dump(spent)
            candidate = Skill(skill.name, skill.spec, actor_layers(model), skill.layout, activation)
            verdict = task.evaluate(candidate, success)
            evaluating += verdict.control_steps
            if verdict.rate > success:
                best, success = candidate, verdict.rate
            log({**metrics, "success": verdict.rate, "best_success": success}, spent + evaluating)
        return Learned(best, max(success, 0.0), spent + evaluating)


def _build(env: SacEnv, config: SacConfig, seed: int) -> SAC:
    return SAC(
        "MlpPolicy",
        env,
        learning_rate=config.learning_rate,
        buffer_size=config.buffer,
        learning_starts=config.learning_starts,
        batch_size=config.batch,
        tau=config.tau,
        gamma=config.gamma,
        train_freq=(1, "step"),
        gradient_steps=config.updates,
        policy_kwargs={"net_arch": list(config.hidden), "optimizer_kwargs": {"fused": True}},
        seed=seed,
        device="cpu",
    )


def actor_layers(model: SAC) -> Layers:
    """Copy out the layers that lead to the mean action."""
    return (*layers_of(model.actor.latent_pi), *layers_of(model.actor.mu))


@contextlib.contextmanager
def global_generators() -> Iterator[None]:
    """Put the process-wide random generators, which the library seeds, back as they were."""
    import random

    numpy_state, python_state = np.random.get_state(), random.getstate()  # noqa: NPY002 - the library's generator
    with torch.random.fork_rng():
        try:
            yield
        finally:
            np.random.set_state(numpy_state)  # noqa: NPY002
            random.setstate(python_state)


__all__: Sequence[str] = ("SacEnv", "actor_layers", "train_sac")
