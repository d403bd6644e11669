"""Settings of the learners. Their defaults are what docs/lab-notes.md records as measured best."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

from roboscribe.defaults import CONFIRM

Profile: TypeAlias = Literal["actions", "states", "paper", "scripted"]
"""What may be learned from; `scripted` learns nothing and takes the controllers that the task brings."""


@dataclass(frozen=True)
class CloneConfig:
    """Cloning of segments.

    Args:
        steps: most gradient steps; in between there is one per frame.
        least_steps: fewest gradient steps.
        patient_steps: the same where a first clone fell short: few frames have to be seen more often.
        checkpoints: how many evenly spaced weights are tried by rollouts.
        batch: samples per step.
        learning_rate: Adam's, falling to zero along a cosine.
        hidden: units of each hidden layer.
        limit: pre-tanh actions are clipped to ± this.
        least_log_std: lower clip of the predicted log standard deviation, pre-tanh.
        input_noise: standard deviation of the noise on normalised inputs.
        extra_frames: frames taken beyond the one on which φ is first true.
    """

    steps: int = 6000
    least_steps: int = 1500
    patient_steps: int = 4000
    checkpoints: int = 3
    batch: int = 256
    learning_rate: float = 3e-3
    hidden: tuple[int, ...] = (128, 128)
    limit: float = 2.5
    least_log_std: float = -3.0
    input_noise: float = 0.3
    extra_frames: int = 8


@dataclass(frozen=True)
class InverseConfig:
    """Inverse dynamics for demonstrations without actions.

    Args:
        tries: random actions tried from each demonstrated simulator state.
        steps_from_starts: random steps from each start state, where the demonstrations store no simulator states.
        rounds: fits; from the second on the clone's own rollouts are fitted too.
        noise: standard deviation added to the actions of those rollouts.
        rollout_steps: length of each of those rollouts.
        steps: gradient steps.
        batch: samples per step.
        learning_rate: Adam's, falling to zero along a cosine.
        hidden: units of each hidden layer.
        limit: as in `CloneConfig`.
        least_log_std: as in `CloneConfig`.
    """

    tries: int = 8
    steps_from_starts: int = 20
    rounds: int = 3
    noise: float = 0.4
    rollout_steps: int = 20
    steps: int = 4000
    batch: int = 256
    learning_rate: float = 1e-3
    hidden: tuple[int, ...] = (128, 128)
    limit: float = 2.5
    least_log_std: float = -3.0


@dataclass(frozen=True)
class PpoConfig:
    """PPO from a warm start.

    Args:
        worlds: rows stepped at once.
        steps: control steps of each row per iteration.
        epochs: passes over an iteration's data.
        minibatches: updates per pass.
        actor_rate: Adam's step for the actor.
        critic_rate: Adam's step for the critic.
        clip: PPO's ratio clip.
        gamma: discount per control step.
        lam: of generalised advantage estimation.
        noise: standard deviation of exploration, pre-tanh, fixed.
        critic_iterations: iterations before the actor may move.
        evaluate_every: iterations between evaluations.
        patience: evaluations without a new best after which training stops.
    """

    worlds: int = 128
    steps: int = 50
    epochs: int = 5
    minibatches: int = 4
    actor_rate: float = 3e-4
    critic_rate: float = 1e-3
    clip: float = 0.2
    gamma: float = 0.99
    lam: float = 0.95
    noise: float = 0.1
    critic_iterations: int = 5
    evaluate_every: int = 4
    patience: int = 6


@dataclass(frozen=True)
class SacConfig:
    """SAC as the paper's artifact ran it, with fewer updates per control step so that it is affordable here.

    Args:
        worlds: rows stepped at once.
        updates: gradient updates per round of one control step in every row.
        batch: transitions per update.
        learning_starts: control steps before the first update.
        buffer: transitions kept.
        gamma: discount per control step.
        learning_rate: of actor, critics and temperature.
        tau: share by which target critics follow.
        hidden: units of each hidden layer.
        evaluate_every: rounds between evaluations.
    """

    worlds: int = 64
    updates: int = 4
    batch: int = 512
    learning_starts: int = 4000
    buffer: int = 1_000_000
    gamma: float = 0.95
    learning_rate: float = 1e-3
    tau: float = 0.05
    hidden: tuple[int, ...] = (256, 256)
    evaluate_every: int = 200


@dataclass(frozen=True)
class PoolConfig:
    """Start states of one skill.

    Args:
        starts: starts to collect for training.
        evaluation: held-out starts for evaluation.
        in_loops: times as many of either in loops, where more is asked of a skill.
        opaque: either, for the cheap attempt on ψ_R itself.
        attempts: episodes run at most, per start asked for.
        screening: held-out starts after which a hopeless candidate is dropped without trying the others.
        tries: cap per episode and bound entities.
        stress_above: success above which hard starts are repeated; below, they are the most without that.
        repeats: times that one hard start is repeated at most, lest a hopeless one fills the pool.
        batch: rows stepped at once.
    """

    starts: int = 400
    evaluation: int = 200
    in_loops: int = 2
    opaque: int = 32
    attempts: int = 3
    screening: int = 50
    tries: int = 2
    stress_above: float = 0.5
    repeats: int = 20
    batch: int = 64


BLIND = PpoConfig(worlds=64, actor_rate=1e-4, critic_iterations=0, noise=0.5)
"""PPO that explores widely from the first iteration on, for a skill that has no warm start; it has few steps."""


@dataclass(frozen=True)
class TrainConfig:
    """How skills are trained.

    Args:
        profile: what may be learned from: `actions`, `states` or `paper`; or `scripted`: the task's own controllers.
        target: evaluated success at which a skill of a program for ψ_R is good enough.
        subgoal_target: the same where the program is for a subgoal.
        budget: control steps that one training of a skill may take, its start states and evaluations included; of a
            known one each round of improving it.
        learning: share of them that reinforcement learning itself may take, in all rounds together.
        rounds: turns at improving that PPO gives each controller of a program that is known, one controller after the
            other: what one learns changes where the others start, and what they start from is soon out of date.
        first_budget: most that learning may take where nothing comes before the skill yet: a hard subgoal had better
            be refined.
        opaque_budget: the same for an attempt on ψ_R itself.
        confirm: consecutive steps for which a subgoal must hold.
        screening: episodes that tell whether the known skills of a program are worth improving for ψ_R.
        worth_improving: share of them that must succeed; of a program with a loop, share of its turns.
        passable: success from which on a subgoal's skill is not reinforced before ψ_R is attempted.
        assurance: episodes after which skills are left as they are if as many as are wanted succeed: where all of 100
            do, at most 3 % fail in truth.
        pool, clone, inverse: of start states, of cloning, and of actions inferred from states.
        learner: what improves a warm start, chosen by the type of its settings: PPO, or SAC from scratch.
        blind: of an attempt on ψ_R itself, which is PPO whatever the learner: it has no time for a replay buffer, and
            nothing to lose.
    """

    profile: Profile = "actions"
    target: float = 0.995
    subgoal_target: float = 0.97
    budget: int = 500_000
    learning: float = 0.5
    rounds: int = 2
    first_budget: int = 60_000
    opaque_budget: int = 10_000
    confirm: int = CONFIRM
    screening: int = 32
    worth_improving: float = 0.5
    passable: float = 0.8
    assurance: int = 100
    pool: PoolConfig = field(default_factory=PoolConfig)
    clone: CloneConfig = field(default_factory=CloneConfig)
    inverse: InverseConfig = field(default_factory=InverseConfig)
    learner: PpoConfig | SacConfig = field(default_factory=PpoConfig)
    blind: PpoConfig = BLIND

    @property
    def learning_steps(self) -> int:
        """Control steps that reinforcement learning of one skill may take."""
        return round(self.learning * self.budget)

    def for_profile(self, profile: Profile) -> TrainConfig:
        """Return the settings of a profile: `paper` learns by SAC from scratch, as the paper does."""
        usual = self.learner if profile != "paper" or isinstance(self.learner, SacConfig) else SacConfig()
        return replace(self, profile=profile, learner=usual)
