"""The learner that DeepSet, GAIL, goalGAIL and RLPD share: SAC with the set policy, and switches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from roboscribe.baselines.config import RECIPES, BaselineConfig, Method, OffPolicyConfig, Recipe
from roboscribe.baselines.course import Course
from roboscribe.baselines.discriminator import Discriminator
from roboscribe.baselines.learner_state import restore_learner, save_learner
from roboscribe.baselines.policy import SetPolicy, set_policy
from roboscribe.baselines.replay import HindsightBuffer, Sampling, task_reward
from roboscribe.baselines.set_sac import SetSacPolicy, copy_actor, policy_settings
from roboscribe.baselines.transitions import Shown, check_actions, shown_transitions
from roboscribe.baselines.world_env import WorldEnv
from roboscribe.rl.sac import Metrics, global_generators
from roboscribe.rl.torch_net import single_thread
from roboscribe.world import Task, Trajectory

SkillEvaluator: TypeAlias = Callable[[SetPolicy], float]
"""Measures a policy's success; the control steps that it takes are not the method's."""
ENV, REPLAY = 0, 1
"""Random numbers of their own: starts of episodes, and what is drawn from the buffer."""


@dataclass(frozen=True)
class Learned:
    """What a method ended with.

    Args:
        policy: the last weights; no evaluation chose them.
        control_steps: that the method used.
        hopeless: it was given up early, for no evaluation had seen a success.
    """

    policy: SetPolicy
    control_steps: int
    hopeless: bool


@dataclass
class Learner:
    """One run in progress.

    Args:
        model: the library's SAC.
        env: its environment.
        buffer: its replay buffer.
        policy: a copy of the deterministic actor.
        discriminator: None where the task's reward is learned from.
        best: greatest success of an evaluation so far.
    """

    model: SAC
    env: WorldEnv
    buffer: HindsightBuffer
    policy: SetPolicy
    discriminator: Discriminator | None
    best: float = 0.0


class Discriminating(BaseCallback):
    """Teaches the discriminator after every round, before the library's updates."""

    def __init__(self, discriminator: Discriminator, shown: Shown, relabelled: float) -> None:
        """Remember what to teach from what."""
        super().__init__()
        self.discriminator, self.shown, self.relabelled = discriminator, shown, relabelled

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        config, model = self.discriminator.config, self.model
        assert isinstance(model, SAC)
        buffer = model.replay_buffer
        assert isinstance(buffer, HindsightBuffer)
        if model.num_timesteps <= model.learning_starts:
            return
        for _ in range(config.updates):
            own = buffer.draw(config.batch, self.relabelled)
            shown = self.shown.draw(buffer.sampling.rng, config.batch, self.relabelled, buffer.sampling.task)
            loss = self.discriminator.update(own, shown)
        self.logger.record("train/discriminator_loss", loss)


def learn_off_policy(
    task: Task,
    method: Method,
    shown: Sequence[Trajectory],
    config: BaselineConfig,
    course: Course,
    *,
    judge: SkillEvaluator,
) -> Learned:
    """Learn a set policy from whole episodes of a task.

    Args:
        task: what is to be solved.
        method: one whose recipe has rollouts.
        shown: demonstrations; not looked at where the recipe has none.
        config: settings.
        course: control steps that may be used (what is left of a round of all rows is not), seed, checkpoint, which is
            written after every evaluation, and log.
        judge: evaluates.

    Raises:
        DemonstrationError: demonstrations without actions where the recipe wants them, or without a step.
        ArtifactError: the checkpoint cannot be used.

    Source: DeepSet, GAIL and goalGAIL of Sec. 5.
    Departs: SAC in the place of DDPG, which in the library lacks the penalty on actions, the clipped targets and the
        random actions on which the originals rely.
    """
    single_thread()
    recipe, learner_config = RECIPES[method], config.learner
    if recipe.actions:
        check_actions(shown, method)
    with global_generators():
        demonstrated = shown_transitions(shown, task) if recipe.states else None
        learner = _build(task, method, demonstrated, config, course.seed)
        teaching = _teaching(learner, recipe, demonstrated, learner_config)
        _resume(learner, course)
        budget = course.steps // learner_config.worlds * learner_config.worlds
        while learner.model.num_timesteps < budget and not _hopeless(learner, task, learner_config):
            _advance(learner, teaching, budget, learner_config)
            rate = judge(learner.policy)
            learner.best = max(learner.best, rate)
            course.log({"success": rate, **_metrics(learner)}, learner.model.num_timesteps)
            _keep(learner, course)
        copy_actor(learner.model.policy, learner.policy.network)
        return Learned(learner.policy, learner.model.num_timesteps, _hopeless(learner, task, learner_config))


def _build(task: Task, method: Method, shown: Shown | None, config: BaselineConfig, seed: int) -> Learner:
    """Build everything in its initial state."""
    recipe, settings = RECIPES[method], config.learner
    network = replace(config.network, critic_norm=recipe.mixed)
    torch.manual_seed(seed)
    policy = set_policy(method, task.layout, task.action_size, network)
    tokenizer = policy.network.tokenizer
    if shown is not None:
        tokenizer.observe(shown.batch.states)
    discriminator = Discriminator(tokenizer, network, config.discriminator) if recipe.discriminator else None
    sampling = Sampling(
        task,
        tokenizer,
        np.random.default_rng([seed, REPLAY]),
        settings.relabelled if recipe.hindsight else 0.0,
        shown if recipe.mixed else None,
        task_reward if discriminator is None else discriminator.reward,
    )
    env = WorldEnv(task, settings.worlds, np.random.default_rng([seed, ENV]))
    random_actions = 0.0 if recipe.actions else settings.random_actions
    model = _sac(env, sampling, policy_settings(tokenizer, network, random_actions), settings, seed)
    assert isinstance(model.replay_buffer, HindsightBuffer)
    return Learner(model, env, model.replay_buffer, policy, discriminator)


def _sac(env: WorldEnv, sampling: Sampling, policy: dict[str, Any], config: OffPolicyConfig, seed: int) -> SAC:
    """Build the library's learner."""
    model = SAC(
        SetSacPolicy,
        env,
        learning_rate=config.learning_rate,
        buffer_size=config.buffer,
        learning_starts=config.learning_starts,
        batch_size=config.batch,
        tau=config.tau,
        gamma=config.gamma,
        train_freq=(1, "step"),
        gradient_steps=config.updates,
        replay_buffer_class=HindsightBuffer,
        replay_buffer_kwargs={"sampling": sampling},
        ent_coef=config.temperature,
        policy_kwargs=policy,
        seed=seed,
        device="cpu",
    )
    model.set_logger(Logger(None, [Metrics({})]))
    return model


def _teaching(learner: Learner, recipe: Recipe, shown: Shown | None, config: OffPolicyConfig) -> Discriminating | None:
    """Return what teaches the discriminator, where there is one."""
    if learner.discriminator is None or shown is None:
        return None
    return Discriminating(learner.discriminator, shown, config.relabelled if recipe.hindsight else 0.0)


def _advance(learner: Learner, teaching: Discriminating | None, budget: int, config: OffPolicyConfig) -> None:
    """Learn until the next evaluation."""
    model = learner.model
    whole = max(config.worlds, config.evaluate_every // config.worlds * config.worlds)
    steps = min(whole, budget - model.num_timesteps)
    model.learn(steps, callback=teaching, log_interval=budget, reset_num_timesteps=model.num_timesteps == 0)
    model.logger.dump(model.num_timesteps)
    copy_actor(model.policy, learner.policy.network)


def _metrics(learner: Learner) -> Mapping[str, float]:
    """Return the library's latest figures."""
    (output,) = learner.model.logger.output_formats
    assert isinstance(output, Metrics)
    return output.latest


def _hopeless(learner: Learner, task: Task, config: OffPolicyConfig) -> bool:
    """Tell whether to give up: several entities, many steps, and never a success."""
    several = len(task.layout.entities) > 1
    return several and learner.best == 0.0 and learner.model.num_timesteps >= config.hopeless_after


def _keep(learner: Learner, course: Course) -> None:
    """Write a checkpoint."""
    arrays, notes = save_learner(learner.model, learner.env, learner.buffer, learner.discriminator)
    course.keep(arrays, {**notes, "best": learner.best})


def _resume(learner: Learner, course: Course) -> None:
    """Return to the checkpoint, where there is one."""
    kept = course.kept()
    if kept is not None:
        arrays, notes = kept
        restore_learner(learner.model, learner.env, learner.buffer, learner.discriminator, arrays, notes)
        learner.best = float(str(notes["best"]))
