"""PPO from a warm start, through rsl-rl-lib, with our own evaluation and checkpoints around it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from rsl_rl.runners import OnPolicyRunner

from roboscribe.rl.checkpoint import Arrays, prefixed, read_checkpoint, under, write_checkpoint
from roboscribe.rl.config import PpoConfig
from roboscribe.rl.learner import Learned, LearnerTask, Log, no_log
from roboscribe.rl.rsl import RslEnv, build_runner
from roboscribe.rl.skill import Layers, Skill, layer_arrays, layers_from
from roboscribe.rl.skill_env import SkillEnv
from roboscribe.rl.torch_net import layers_of, load_layers, load_optimizer, optimizer_arrays, single_thread

RECENT = 1
"""Evaluations without a new best after which a skill still counts as getting better."""
COUNTS = ("iteration", "unimproved", "evaluating", "success")
"""Numbers of a run that its checkpoint keeps."""


@dataclass
class _Run:
    """One PPO run in progress."""

    runner: OnPolicyRunner
    env: SkillEnv
    best: Layers
    success: float
    iteration: int = 0
    unimproved: int = 0
    evaluating: int = 0

    @property
    def actor(self) -> Layers:
        return layers_of(self.runner.alg.actor)


def train_ppo(
    skill: Skill,
    success: float,
    task: LearnerTask,
    config: PpoConfig,
    seed: int,
    log: Log = no_log,
    checkpoint: Path | None = None,
) -> Learned:
    """Improve a skill by PPO; what is returned never evaluates worse than the skill given.

    Args:
        skill: warm start.
        success: its success on the fixed starts.
        task: subtask, start states, evaluation, target and budget.
        config: settings.
        seed: decides everything.
        log: receives metrics every iteration.
        checkpoint: where progress is kept. A run that finds its own checkpoint goes on from there and ends with
            bitwise the weights of an uninterrupted run on the same machine and versions.

    Returns:
        The best evaluated skill.

    Source: TRAINPROGRAM (Sec. 4.3.3).
    Departs: PPO from cloned skills instead of SAC from scratch, which was measured to need fewer seconds.
    """
    single_thread()
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        run = _begin(skill, success, task, config, seed)
        if checkpoint is not None and checkpoint.exists():
            _restore(run, checkpoint, _identity(config, seed))
        per_iteration = config.worlds * config.steps
        while not _finished(run, task, config):
            _iterate(run, config)
            measured = run.iteration % config.evaluate_every == 0 and run.iteration > config.critic_iterations
            if measured:
                _keep_best(run, skill, task)
            log(_metrics(run, measured), run.iteration * per_iteration + run.evaluating)
            if checkpoint is not None and measured:
                _save(run, checkpoint, _identity(config, seed))
        unfinished = success < run.success < task.target and run.unimproved <= RECENT
        spent = run.iteration * per_iteration + run.evaluating
        return Learned(skill.with_layers(run.best), run.success, spent, unfinished)


def _begin(skill: Skill, success: float, task: LearnerTask, config: PpoConfig, seed: int) -> _Run:
    env = SkillEnv(task.subtask, task.pool, config.worlds, config.gamma, np.random.default_rng(seed))
    env.restart()
    wrapped = RslEnv(env, skill.encoder, task.subtask.task.action_size)
    return _Run(build_runner(wrapped, skill.layers, config), env, skill.layers, success)


def _finished(run: _Run, task: LearnerTask, config: PpoConfig) -> bool:
    learning = (run.iteration + 1) * config.worlds * config.steps
    spent = learning > task.budget or learning + run.evaluating > task.most
    return spent or run.success >= task.target or run.unimproved >= config.patience


def _iterate(run: _Run, config: PpoConfig) -> None:
    """Collect one batch and learn from it; at first the critic alone, which otherwise would destroy the actor."""
    for parameter in run.runner.alg.actor.mlp.parameters():
        parameter.requires_grad_(run.iteration >= config.critic_iterations)
    run.runner.current_learning_iteration = run.iteration
    run.runner.learn(1)
    run.iteration += 1


def _keep_best(run: _Run, skill: Skill, task: LearnerTask) -> None:
    verdict = task.evaluate(skill.with_layers(run.actor), run.success)
    run.evaluating += verdict.control_steps
    run.unimproved += 1
    if verdict.rate > run.success:
        run.best, run.success, run.unimproved = run.actor, verdict.rate, 0


def _metrics(run: _Run, measured: bool) -> dict[str, float]:
    wrapped = run.runner.env
    found = dict(run.runner.logger.metrics)
    if wrapped.attempts:
        found["training_success"] = wrapped.successes / wrapped.attempts
    wrapped.attempts = wrapped.successes = 0
    return found | ({"best_success": run.success} if measured else {})


def _identity(config: PpoConfig, seed: int) -> dict[str, object]:
    return {"learner": "ppo", "seed": seed, "config": json.dumps(asdict(config))}


def _save(run: _Run, path: Path, identity: Mapping[str, object]) -> None:
    state, generator = run.env.save()
    arrays: Arrays = {"torch": torch.get_rng_state().numpy()}
    arrays |= prefixed("env", state) | prefixed("best", layer_arrays(run.best))
    arrays |= prefixed("actor", layer_arrays(run.actor))
    arrays |= prefixed("critic", layer_arrays(layers_of(run.runner.alg.critic)))
    arrays |= prefixed("adam", optimizer_arrays(run.runner.alg.optimizer))
    counts = {name: getattr(run, name) for name in COUNTS}
    write_checkpoint(path, arrays, {**identity, **counts, "generator": generator})


def _restore(run: _Run, path: Path, identity: Mapping[str, object]) -> None:
    """Continue from a checkpoint of the same configuration and seed."""
    arrays, notes = read_checkpoint(path, identity)
    load_layers(run.runner.alg.actor, layers_from(under("actor", arrays), f"actor in {path}"))
    load_layers(run.runner.alg.critic, layers_from(under("critic", arrays), f"critic in {path}"))
    load_optimizer(run.runner.alg.optimizer, under("adam", arrays))
    run.best = layers_from(under("best", arrays), f"best skill in {path}")
    counts = json.loads(json.dumps(notes))
    for name in COUNTS:
        setattr(run, name, counts[name])
    run.env.restore(under("env", arrays), counts["generator"])
    torch.set_rng_state(torch.from_numpy(arrays["torch"]))
