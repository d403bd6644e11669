"""Whether what a program has learned is worth improving: a look at the whole of it, before controllers take a turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

from roboscribe.rl.config import TrainConfig
from roboscribe.rl.program_training import SEEDS, ProgramTraining
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_job import SkillJob, SkillReport
from roboscribe.rl.whole_program import affordable, tried
from roboscribe.success_rate import wilson
from roboscribe.world.layout import BoolArray

LONGEST = 4
"""Times `TrainConfig.assurance` that a screening may take."""
BY_CHANCE = 0.05
"""Probability below which it is no chance that a program never succeeds."""


@dataclass(frozen=True)
class Screening:
    """Whether a turn is worthwhile, what to report where it is not, and the control steps that it took to find out."""

    worthwhile: bool
    report: SkillReport | None = None
    control_steps: int = 0


def screen(
    training: ProgramTraining, turn: Sequence[SkillJob], skills: Mapping[str, Skill], reports: Sequence[SkillReport]
) -> Screening:
    """Run the program as things stand, before controllers that have all had a turn get another one.

    It is not worthwhile where the program reaches its goal as often as is wanted, nor where it does so too rarely for
    its controllers to be to blame, or never although they succeed one by one. One failure too many may be chance: more
    episodes tell. For what was trained in vain other episodes have told already.
    """
    if not turn or (turn[0].together and _subgoal_is_missing(training, reports)):
        return Screening(False)
    config, job = training.config, turn[0]
    if (job.again == 1 and training.trained_before) or not _can_be_screened(training, job, skills):
        return Screening(True)
    seeds = training.draw(f"screening {job.title} {training.solve}").integers(SEEDS, size=LONGEST * config.assurance)
    success, steps = tried(training, skills, seeds[: config.screening])
    for episodes in range(config.assurance, len(seeds) + 1, config.assurance):
        failures = int((~success).sum())
        if failures > (1.0 - training.wanted) * episodes + 1 or not affordable(training, episodes):
            break
        more, spent = tried(training, skills, seeds[len(success) : episodes])
        success, steps = np.concatenate([success, more]), steps + spent
        if success.mean() >= training.wanted:
            break
    rate = float(success.mean())
    assured = rate >= training.wanted and len(success) >= config.assurance
    hopeless = rate < least_worth_improving(training) if job.again else never_together(training, reports, success)
    if assured or hopeless:
        return Screening(False, SkillReport(turn[-1].run.controller, "kept", 0, rate, rate, steps))
    return Screening(True, control_steps=steps)


def least_worth_improving(training: ProgramTraining) -> float:
    """Return the success below which a program lacks more than skill; of one with loops, that of all their turns."""
    turns = max((training.repetitions(run) for run in training.runs), default=0)
    return float(training.config.worth_improving ** max(1, turns))


def _can_be_screened(training: ProgramTraining, job: SkillJob, skills: Mapping[str, Skill]) -> bool:
    """Tell whether the whole program can show what a turn is worth: known skills for ψ_R, or a loop that comes last."""
    if job.together:
        return all(run.controller in skills for run in training.runs) and affordable(
            training, training.config.screening
        )
    return job.again > 0 and training.solve


def _subgoal_is_missing(training: ProgramTraining, reports: Sequence[SkillReport]) -> bool:
    """Tell whether what was cloned for a subgoal's program mostly fails, so that its loop shows no later iterations."""
    failing = any(mostly_fails(training.config, report.success, report.starts) for report in reports)
    return failing and _may_lack_a_subgoal(training)


def _may_lack_a_subgoal(training: ProgramTraining) -> bool:
    """Tell whether failing clones may be a missing subgoal's fault: they do as was shown, on the way to the task."""
    return training.config.profile == "actions" and not training.solve


def never_together(training: ProgramTraining, reports: Sequence[SkillReport], success: BoolArray) -> bool:
    """Tell whether a subgoal's program never succeeds, (E,), although its controllers one by one do often enough.

    What makes them fail together is no lack of skill: a subgoal is missing, such as a drawer that is still shut.
    """
    rates = {report.controller: report.success for report in reports if report.starts}
    measured = all(run.controller in rates for run in training.runs)
    if success.any() or not measured or not _may_lack_a_subgoal(training):
        return False
    expected = prod(rates[run.controller] ** max(1, training.repetitions(run)) for run in training.runs)
    return bool((1 - expected) ** len(success) < BY_CHANCE)


def mostly_fails(config: TrainConfig, rate: float, starts: int) -> bool:
    """Tell whether a skill that succeeds from a share of some starts fails too often, beyond chance, to be improved.

    Where there were no starts the rate is one of episodes, or 0 because the program never got there.
    """
    at_best = wilson(rate * starts, starts)[1] if starts else rate
    return at_best < config.worth_improving
