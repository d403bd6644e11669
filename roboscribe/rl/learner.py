"""The interface that PPO and SAC share: what a learner is given and what it returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import TypeAlias

from roboscribe.rl.pool import StartPool
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import Verdict
from roboscribe.rl.subtask import Subtask

Log: TypeAlias = Callable[[Mapping[str, float], int], None]
"""Receives metrics by name, and the control steps spent so far."""


def no_log(metrics: Mapping[str, float], step: int) -> None:
    """Log nothing."""


@dataclass(frozen=True)
class LearnerTask:
    """What a learner needs to know of a skill's surroundings.

    Args:
        subtask: what the skill must reach.
        pool: its start states.
        evaluate: measures a skill's success on fixed starts; told the success that it has to beat.
        target: success at which learning may stop.
        budget: control steps that learning may take, evaluations not counted.
        most: control steps that may be spent before the last evaluation, earlier evaluations counted.
    """

    subtask: Subtask
    pool: StartPool
    evaluate: Callable[[Skill, float], Verdict]
    target: float
    budget: int
    most: float = inf


@dataclass(frozen=True)
class Learned:
    """Best skill found.

    Args:
        skill: it.
        success: on the fixed starts.
        control_steps: all that were spent, evaluations included.
        unfinished: whether they ran out while the skill was still getting better; of SAC, which begins anew each time,
            never.
    """

    skill: Skill
    success: float
    control_steps: int
    unfinished: bool = False
