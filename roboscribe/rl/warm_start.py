"""Warm starts: the frames a skill would have been responsible for, and clones of what was done in them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from roboscribe.dsl.segmentation import Segment
from roboscribe.rl.clone import CloningSamples, clone, foretelling_error
from roboscribe.rl.config import CloneConfig, TrainConfig
from roboscribe.rl.inverse_dynamics import Transitions, explore, fit_inverse, probe, random_actions
from roboscribe.rl.observation import ObservationSpec
from roboscribe.rl.pool import StartPool
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import SkillEvaluator
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.rows import Rows
from roboscribe.world.trajectory import Trajectory


@dataclass(frozen=True)
class Frames(Rows):
    """M demonstrated frames of one skill.

    Args:
        states: (M, F).
        following: (M, F), one control step later.
        entities: (M, n) bound.
        actions: (M, A), NaN where unknown.
        snapshots: (M, S) simulator states; (M, 0) where not stored.
        simulated: (M, n) what the simulator calls the bound entities.
    """

    states: FloatArray
    following: FloatArray
    entities: IntArray
    actions: FloatArray
    snapshots: FloatArray
    simulated: IntArray

    def samples(self) -> CloningSamples:
        """Return the frames whose actions are known."""
        return CloningSamples(self.states, self.entities, self.actions).known()


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
    simulated = [demonstration.simulated(entity) for entity in part.entities]
    return Frames(
        demonstration.states[part.start : stop],
        demonstration.states[part.start + 1 : stop + 1],
        np.tile(np.array(part.entities, np.int64), (count, 1)),
        np.full((count, action_size), np.nan) if done is None else done,
        np.zeros((count, 0)) if stored is None else stored[part.start : stop],
        np.tile(np.array(simulated, np.int64), (count, 1)),
    )


IDLE = 0.05
"""Share of a usual motion below which a step changes nothing."""
USUAL = 0.9
"""Quantile of the steps in which something moves at all that is its usual motion."""


def busy(demonstrations: Sequence[Trajectory]) -> list[BoolArray]:
    """Tell in which steps of each demonstration (T,) anything changes; whoever waits shows nothing to imitate.

    A clone of frames in which a demonstrator paused pauses, too, and without end, for nothing changes then.
    """
    if not demonstrations:
        return []
    layout = demonstrations[0].layout
    kinds = {index: layout.type_of(index) for index, *_ in layout.columns}
    places = [
        columns
        for (index, name, goal), columns in layout.columns.items()
        if any(a.name == name and a.is_place for a in kinds[index].described(goal))
    ]
    changes = [_changes(shown.states, places) for shown in demonstrations]
    every = np.concatenate(changes)
    usual = [np.quantile(moving, USUAL) if len(moving := each[each > 0]) else np.inf for each in every.T]
    return [(change > IDLE * np.array(usual)).any(axis=1) for change in changes]


def _changes(states: FloatArray, places: Sequence[slice]) -> FloatArray:
    """Return how far each attribute goes from step to step, (T - 1, P), for states (T, F)."""
    steps = np.diff(states, axis=0)
    lengths = [np.linalg.norm(steps[:, columns], axis=1) for columns in places]
    return np.stack(lengths, axis=1) if lengths else np.zeros((len(steps), 0))


def joined(parts: Sequence[Frames]) -> Frames:
    """Concatenate frames; snapshots are dropped where some demonstrations lack them."""
    stored = len({part.snapshots.shape[1] for part in parts}) == 1
    return Frames.concatenated([part if stored else replace(part, snapshots=part.snapshots[:, :0]) for part in parts])


def clone_frames(
    blanks: Sequence[Skill], samples: CloningSamples, evaluator: SkillEvaluator, config: TrainConfig, seed: int
) -> tuple[Skill, float] | None:
    """Return the first clone that reaches the target in rollouts, else the best; None where there is nothing to clone.

    The first attempt is short and sees the most. Longer ones begin with what foretells actions best of demonstrations
    that it was not fitted to. Each has another seed, and its latest checkpoint is tried first, as long as the budget
    lasts.

    Args:
        blanks: untrained skills, the one that sees the most first.
        samples: demonstrated frames.
        evaluator: measures clones in rollouts.
        config: settings.
        seed: decides everything.
    """
    best: tuple[Skill, float] | None = None
    if not len(samples):
        return best
    for attempt, (blank, settings) in enumerate(_attempts(blanks, samples, config.clone, seed)):
        for _, skill in reversed(list(clone(blank, samples, settings, seed + attempt))):
            rate = evaluator(skill, 0.0 if best is None else best[1]).rate
            if best is None or rate > best[1]:
                best = skill, rate
            if rate >= config.target or evaluator.rest < 0:
                return best
    return best


def _attempts(
    blanks: Sequence[Skill], samples: CloningSamples, config: CloneConfig, seed: int
) -> Iterator[tuple[Skill, CloneConfig]]:
    """Yield what is cloned, and how patiently."""
    yield blanks[0], config
    patient = replace(config, least_steps=config.patient_steps)
    errors = [foretelling_error(blank, samples, config, seed) for blank in blanks] if len(blanks) > 1 else [0.0]
    for rank in np.argsort(errors, kind="stable"):
        yield blanks[rank], patient


def clone_states(
    blanks: Sequence[Skill],
    frames: Frames,
    pool: StartPool,
    spec: ObservationSpec,
    evaluator: SkillEvaluator,
    config: TrainConfig,
    seed: int,
) -> tuple[Skill, float] | None:
    """Return the best clone of actions that are inferred from states alone.

    Actions are first tried out from the demonstrated simulator states where these are stored; where not, in random
    motion from the skill's own start states, which meets less of what the demonstrations did. In further rounds the
    inverse model is fitted again, to the clone's own rollouts too.

    Args:
        blanks: as in `clone_frames`.
        frames: demonstrated; their actions are not used.
        pool: start states of the skill.
        spec: what the inverse model sees of a state.
        evaluator: measures clones in rollouts; its world is used to try actions out.
        config: settings.
        seed: decides everything.
    """
    rng = np.random.default_rng(seed)
    data = _first_tries(frames, pool, evaluator, config, rng)
    best: tuple[Skill, float] | None = None
    for turn in range(config.inverse.rounds if len(data) else 0):
        model = fit_inverse(spec, blanks[0].layout, data, config.inverse, seed + turn)
        done = model.infer(frames.states, frames.following, frames.entities)
        found = clone_frames(
            blanks, CloningSamples(frames.states, frames.entities, done), evaluator, config, seed + turn
        )
        if found is not None and (best is None or found[1] > best[1]):
            best = found
        affordable = len(pool) and evaluator.rest >= len(pool) * config.inverse.rollout_steps
        if best is None or best[1] >= config.target or not affordable:
            break
        own = explore(evaluator.world, pool, best[0], config.inverse, rng)
        data = Transitions.concatenated([data, own])
    return best


def _first_tries(
    frames: Frames, pool: StartPool, evaluator: SkillEvaluator, config: TrainConfig, rng: np.random.Generator
) -> Transitions:
    """Try actions out from demonstrated or start states, from as many of them as half of the budget allows."""
    stored, settings = frames.snapshots.shape[1] > 0, config.inverse
    steps, tries = (1, settings.tries) if stored else (settings.steps_from_starts, 1)
    snapshots = np.repeat(frames.snapshots if stored else pool.snapshots, tries, axis=0)
    entities = np.repeat(frames.simulated if stored else pool.entities, tries, axis=0)
    actions = random_actions(steps, len(snapshots), frames.actions.shape[1], rng)
    some = slice(int(min(len(snapshots), max(evaluator.rest, 0) / 2 / steps)))
    return probe(evaluator.world, snapshots[some], entities[some], actions[:, some])
