"""What a controller's training begins with: what was known of it before, or a clone of what was demonstrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, assert_never

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


class WarmStart(NamedTuple):
    """What training begins with: a skill, its success on held-out starts, and what gave it."""

    skill: Skill
    rate: float
    learner: str


def best_warm_start(
    training: ProgramTraining,
    run: Run,
    skills: Mapping[str, Skill],
    starts: TrainingStarts,
    evaluator: SkillEvaluator,
    *,
    again: int = 0,
) -> tuple[float, WarmStart]:
    """Find the best of what was known before and of clones.

    Args:
        training: the program, and how it is trained.
        run: the statement whose controller is to be learned.
        skills: what is known.
        starts: to train from.
        evaluator: measures skills.
        again: turns at improving it that it has had, this one included; clones are tried in the first one alone.

    Returns:
        The success of what was known before, 0 where nothing was, and the best.
    """
    if run.controller not in skills:
        cloned = _clone(training, run, starts, evaluator)
        if cloned is not None:
            return 0.0, cloned
        fresh = training.fresh_skills(run, evaluator.starts)[0]
        return 0.0, WarmStart(fresh, evaluator(fresh).rate, "initial")
    known = WarmStart(skills[run.controller], evaluator(skills[run.controller]).rate, "kept")
    good = known.rate >= training.enough(run)
    if good or again > 1 or (again and training.may_be_enough(run, known.rate, len(evaluator.starts))):
        return known.rate, known
    cloned = _clone(training, run, starts, evaluator)
    return known.rate, cloned if cloned is not None and cloned.rate > known.rate else known


def _clone(training: ProgramTraining, run: Run, starts: TrainingStarts, evaluator: SkillEvaluator) -> WarmStart | None:
    """Return the best clone this profile allows; None where there is nothing to clone."""
    config, frames = training.config, training.frames(run)
    if frames is None or isinstance(run.until, Solved):
        return None
    seed = training.seed_of(f"{run.controller} clone")
    blanks = training.fresh_skills(run, evaluator.starts)
    match config.profile:
        case "actions":
            found = clone_frames(blanks, frames.samples(), evaluator, config, seed)
        case "states":
            spec, pool = training.specs(run, speeds=True)[0], starts.pool
            found = clone_states(blanks, frames, pool, spec, starts.counted(evaluator), config, seed)
        case "paper" | "scripted":
            return None
        case other:
            assert_never(other)
    return None if found is None else WarmStart(*found, "clone")
