"""What a controller's training begins with: what was known of it before, or a clone of what was demonstrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import assert_never

from roboscribe.dsl.syntax import Run, Solved
from roboscribe.rl.pool import StartPool
from roboscribe.rl.program_training import ProgramTraining
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import SkillEvaluator
from roboscribe.rl.warm_start import clone_frames, clone_states


@dataclass
class TrainingStarts:
    """Start states to train from, looked for when they are first asked for: what was cloned well needs none."""

    find: Callable[[], tuple[StartPool, int]]
    control_steps: int = 0

    @cached_property
    def pool(self) -> StartPool:
        """Find them."""
        pool, self.control_steps = self.find()
        return pool

    def counted(self, evaluator: SkillEvaluator) -> SkillEvaluator:
        """Return an evaluator that may spend so much less as it took to find them."""
        return replace(evaluator, allowance=evaluator.allowance - self.control_steps)


def best_warm_start(
    training: ProgramTraining,
    run: Run,
    skills: Mapping[str, Skill],
    starts: TrainingStarts,
    evaluator: SkillEvaluator,
) -> tuple[Skill, float, str]:
    """Return the best of what was known before and of clones, its success, and what gave it."""
    fresh = training.fresh_skill(run, evaluator.starts)
    known, learner = (skills[run.controller], "kept") if run.controller in skills else (fresh, "initial")
    if learner == "initial" and (cloned := _clone(training, run, fresh, starts, evaluator)) is not None:
        return *cloned, "clone"
    rate = evaluator(known).rate
    if learner == "kept" and rate < training.target(run):
        cloned = _clone(training, run, fresh, starts, evaluator)
        if cloned is not None and cloned[1] > rate:
            return *cloned, "clone"
    return known, rate, learner


def _clone(
    training: ProgramTraining, run: Run, fresh: Skill, starts: TrainingStarts, evaluator: SkillEvaluator
) -> tuple[Skill, float] | None:
    """Return the best clone this profile allows, and its success; None where there is nothing to clone."""
    config, frames = training.config, training.frames(run)
    if frames is None or isinstance(run.until, Solved):
        return None
    seed = training.seed_of(f"{run.controller} clone")
    match config.profile:
        case "actions":
            return clone_frames(fresh, frames.samples(), evaluator, config, seed)
        case "states":
            spec, pool = training.spec(run, speeds=True), starts.pool
            return clone_states(fresh, frames, pool, spec, starts.counted(evaluator), config, seed)
        case "paper" | "scripted":
            return None
        case other:
            assert_never(other)
