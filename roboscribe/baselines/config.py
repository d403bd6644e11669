"""Settings of the baselines, and what each of them is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

from roboscribe.errors import TaskError
from roboscribe.world.layout import Layout

Method: TypeAlias = Literal["bc", "chunked-bc", "deepset", "gail", "goalgail", "rlpd"]
METHODS: tuple[Method, ...] = get_args(Method)


def method_named(name: str) -> Method:
    """Look a method up.

    Raises:
        TaskError: there is no such method.
    """
    for method in METHODS:
        if method == name:
            return method
    msg = f"unknown baseline {name!r}: expected one of {', '.join(METHODS)}"
    raise TaskError(msg)


@dataclass(frozen=True)
class Recipe:
    """What a method learns from.

    Args:
        actions: demonstrated actions.
        states: demonstrated states.
        rollouts: control steps of its own.
        hindsight: goals are replaced by what was reached later.
        discriminator: a discriminator's reward stands in place of the task's.
        mixed: half of every batch is demonstrated.
    """

    actions: bool = False
    states: bool = False
    rollouts: bool = False
    hindsight: bool = False
    discriminator: bool = False
    mixed: bool = False

    @property
    def profile(self) -> str:
        """The profile of programs that may learn from as much."""
        return "actions" if self.actions else "states"


RECIPES: Mapping[Method, Recipe] = {
    "bc": Recipe(actions=True, states=True),
    "chunked-bc": Recipe(actions=True, states=True),
    "deepset": Recipe(rollouts=True, hindsight=True),
    "gail": Recipe(states=True, rollouts=True, discriminator=True),
    "goalgail": Recipe(states=True, rollouts=True, hindsight=True, discriminator=True),
    "rlpd": Recipe(actions=True, states=True, rollouts=True, mixed=True),
}


@dataclass(frozen=True)
class SetConfig:
    """The set policy that BC and the off-policy methods share.

    Args:
        units: of each hidden layer.
        actor_layers: hidden layers of the actor for each token, before the sum.
        critic_layers: hidden layers of critic and discriminator for each token; one more follows the sum.
        critic_norm: whether critics normalise what follows the sum (layer norm).
    """

    units: int = 256
    actor_layers: int = 3
    critic_layers: int = 2
    critic_norm: bool = False


@dataclass(frozen=True)
class CloningConfig:
    """Cloning of whole demonstrations.

    Args:
        steps: gradient steps.
        batch: frames per step.
        learning_rate: Adam's at the start; it falls to zero along a cosine.
        input_noise: standard deviation of the noise on normalised inputs, as of the clones in programs.
        checkpoint_every: gradient steps between checkpoints.
    """

    steps: int = 20_000
    batch: int = 128
    learning_rate: float = 1e-3
    input_noise: float = 0.3
    checkpoint_every: int = 5_000


@dataclass(frozen=True)
class ChunkConfig:
    """Cloning of chunks of actions.

    Args:
        cloning: steps, batch and rate.
        actions: actions predicted at once.
        units: width of the transformer.
        layers: its layers over the tokens; one more looks from the actions at the tokens.
        heads: of its attention.
        decay: how much less a prediction weighs than one that was made a step later, as an exponent.
    """

    cloning: CloningConfig = field(default_factory=lambda: CloningConfig(steps=10_000, learning_rate=5e-4))
    actions: int = 16
    units: int = 128
    layers: int = 2
    heads: int = 4
    decay: float = 0.3


@dataclass(frozen=True)
class DiscriminatorConfig:
    """What tells demonstrated transitions from the policy's own.

    Args:
        batch: transitions of either kind per update.
        updates: per round of one control step in every row.
        learning_rate: Adam's.
        penalty: weight of the gradient penalty.
        scale: of its logarithm, the reward.
    """

    batch: int = 128
    updates: int = 2
    learning_rate: float = 1e-3
    penalty: float = 10.0
    scale: float = 0.1


@dataclass(frozen=True)
class OffPolicyConfig:
    """The learner that DeepSet, GAIL, goalGAIL and RLPD share.

    Args:
        worlds: rows stepped at once.
        updates: gradient updates per round of one control step in every row.
        batch: transitions per update.
        learning_starts: control steps of random actions before the first update.
        buffer: transitions kept.
        gamma: discount per control step.
        learning_rate: of actor, critics and temperature.
        tau: share by which target critics follow.
        temperature: of the entropy, as Stable-Baselines3 spells it; learned, from the number given.
        random_actions: share of the actions on the way that are drawn evenly, as in DeepSet's and goalGAIL's originals;
            not of methods that are shown actions.
        relabelled: share of the samples whose goals are replaced, where the method does so.
        evaluate_every: control steps between evaluations, each of which is followed by a checkpoint.
        hopeless_after: control steps without a single success in an evaluation after which a task of several
            entities is given up.
    """

    worlds: int = 64
    updates: int = 4
    batch: int = 512
    learning_starts: int = 2_000
    buffer: int = 500_000
    gamma: float = 0.98
    learning_rate: float = 1e-3
    tau: float = 0.05
    temperature: str = "auto_0.02"
    random_actions: float = 0.3
    relabelled: float = 0.8
    evaluate_every: int = 50_000
    hopeless_after: int = 500_000


@dataclass(frozen=True)
class BaselineConfig:
    """Settings of all methods; each takes what concerns it."""

    network: SetConfig = field(default_factory=SetConfig)
    cloning: CloningConfig = field(default_factory=CloningConfig)
    chunks: ChunkConfig = field(default_factory=ChunkConfig)
    learner: OffPolicyConfig = field(default_factory=OffPolicyConfig)
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)


def usual_steps(method: Method, layout: Layout, config: BaselineConfig) -> int:
    """Return how long a method learns unless told otherwise: gradient steps of clones, else control steps."""
    match method:
        case "bc":
            return config.cloning.steps
        case "chunked-bc":
            return config.chunks.cloning.steps
        case "rlpd":
            return 500_000
        case _:
            return 2_000_000 if len(layout.entities) == 1 else 1_000_000
