"""What is asked for when a program is to be found: the one record that the command line fills and every stage reads."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from roboscribe.defaults import EVALUATION_EPISODES, N_DEMONSTRATIONS, ROLLOUT_EPISODES
from roboscribe.errors import expected
from roboscribe.programs import program_name
from roboscribe.rl.config import Profile, TrainConfig
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.steps import Limits


@dataclass(frozen=True)
class SynthesisPlan:
    """What is asked for.

    Args:
        task: where.
        seed: decides everything.
        profile: what may be learned from, or `scripted` for the task's own controllers; None is `actions` where the
            demonstrations have them, else `states`.
        demonstrations: a Parquet file; None collects some.
        n_demonstrations: how many to collect.
        rollout_episodes: episodes per rollout of Algorithm 2.
        evaluation_episodes: episodes of the final evaluation.
        limits: accuracy asked and effort allowed.
        training: settings of the learners, but for the profile.
        light: whether skills are learned and programs compared in the task's lighter simulator, where it has one; what
            is found is evaluated in the task's own either way.
        video: whether an episode is filmed.
    """

    task: TaskConfig
    seed: int = 0
    profile: Profile | None = None
    demonstrations: Path | None = None
    n_demonstrations: int = N_DEMONSTRATIONS
    rollout_episodes: int = ROLLOUT_EPISODES
    evaluation_episodes: int = EVALUATION_EPISODES
    limits: Limits = field(default_factory=Limits)
    training: TrainConfig = field(default_factory=TrainConfig)
    light: bool = True
    video: bool = True

    def __post_init__(self) -> None:
        """Check the counts."""
        expected("n_demonstrations", self.n_demonstrations, 1)
        expected("rollout_episodes", self.rollout_episodes, 1)
        expected("evaluation_episodes", self.evaluation_episodes, 1)

    @property
    def practice(self) -> TaskConfig:
        """Where skills are learned and programs compared."""
        return replace(self.task, light=self.light)

    @property
    def program_name(self) -> str:
        """What the program is called."""
        return program_name(self.task.name)
