"""Warm starts: the frames a skill would have been responsible for, and clones of what was done in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from roboscribe.dsl.interpreter import Segment
from roboscribe.rl.clone import Samples, clone
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.inverse_dynamics import fit_inverse, probe, random_actions
from roboscribe.rl.observation import ObservationSpec
from roboscribe.rl.skill import Skill
from roboscribe.world.layout import FloatArray, IntArray, Layout
from roboscribe.world.protocols import World
from roboscribe.world.trajectory import Trajectory


@dataclass(frozen=True)
class Frames:
    """Demonstrated frames of one skill.

    Args:
        states: (M, F).
        following: (M, F), one control step later.
        entities: (M, n) bound.
        actions: (M, A), NaN where unknown.
        snapshots: (M, S) simulator states; (M, 0) where not stored.
    """

    states: FloatArray
    following: FloatArray
    entities: IntArray
    actions: FloatArray
    snapshots: FloatArray

    def __len__(self) -> int:
        """M."""
        return len(self.states)

    def samples(self) -> Samples:
        """Return the frames whose actions are known."""
        return Samples(self.states, self.entities, self.actions).known()


def frames_of(part: Segment, demonstration: Trajectory, beyond: int, actions: bool, action_size: int) -> Frames:
    """Cut a segment out of its demonstration, with `beyond` frames after φ was first true.

    Args:
        part: which frames, and what is bound there.
        demonstration: where.
        beyond: frames added.
        actions: whether demonstrated actions may be used.
        action_size: A.
    """
    stop = min(part.stop + beyond, len(demonstration) - 1)
    count = stop - part.start
    known = actions and demonstration.actions is not None
    done = demonstration.actions[part.start : stop] if known and demonstration.actions is not None else None
    stored = demonstration.snapshots
    return Frames(
        demonstration.states[part.start : stop],
        demonstration.states[part.start + 1 : stop + 1],
        np.tile(np.array(part.entities, np.int64), (count, 1)),
        np.full((count, action_size), np.nan) if done is None else done,
        np.zeros((count, 0)) if stored is None else stored[part.start : stop],
    )


def joined(parts: Sequence[Frames]) -> Frames:
    """Concatenate frames; snapshots are dropped where some demonstrations lack them."""
    stored = len({part.snapshots.shape[1] for part in parts}) == 1
    return Frames(
        np.concatenate([part.states for part in parts]),
        np.concatenate([part.following for part in parts]),
        np.concatenate([part.entities for part in parts]),
        np.concatenate([part.actions for part in parts]),
        np.concatenate([part.snapshots if stored else part.snapshots[:, :0] for part in parts]),
    )


def inferred(
    frames: Frames, layout: Layout, spec: ObservationSpec, world: World, config: TrainConfig, seed: int
) -> Frames:
    """Fill in the actions of frames that have none but store simulator states.

    Args:
        frames: with unknown actions.
        layout: meaning of the states.
        spec: what the inverse model sees of a state.
        world: where actions are tried out.
        config: settings.
        seed: decides everything.

    Returns:
        The frames with the likeliest actions; unchanged where no simulator states are stored.
    """
    settings = config.inverse
    if not len(frames) or not frames.snapshots.shape[1]:
        return frames
    rng = np.random.default_rng(seed)
    snapshots = np.repeat(frames.snapshots, settings.tries, axis=0)
    entities = np.repeat(frames.entities, settings.tries, axis=0)
    actions = random_actions(1, len(snapshots), frames.actions.shape[1], rng)
    data = probe(world, snapshots, entities, actions)
    model = fit_inverse(spec, layout, data, settings, seed)
    done = model.infer(frames.states, frames.following, frames.entities)
    return Frames(frames.states, frames.following, frames.entities, done, frames.snapshots)


def candidates(fresh: Skill, samples: Samples, config: TrainConfig, seed: int) -> Iterator[Skill]:
    """Yield clones, of one seed after the other, each seed's latest checkpoint first."""
    for attempt in range(config.clone.attempts):
        for _, skill in reversed(list(clone(fresh, samples, config.clone, seed + attempt))):
            yield skill


def best_of(skills: Iterator[Skill], success: Callable[[Skill], float], target: float) -> tuple[Skill, float] | None:
    """Return the first skill that reaches the target in rollouts, else the best; None where there is none."""
    best: tuple[Skill, float] | None = None
    for skill in skills:
        rate = success(skill)
        if best is None or rate > best[1]:
            best = skill, rate
        if rate >= target:
            break
    return best
