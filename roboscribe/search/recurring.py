"""Predicates that demonstrations bring about for one entity of a type after the other: what loops are made of.

A predicate about one entity is a schema: it is judged on every (demonstration, entity) pair, not on one name. An entity
that satisfies it from the start is no evidence, one that reaches it late is. All of the type satisfy it once the goal
is reached; that is what the goal asks for, so it is measured there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from roboscribe.dsl.rewrite import free_vars, uses_robot, walk
from roboscribe.dsl.syntax import Goal, Predicate, Truth
from roboscribe.search.candidates import MOST_INITIAL, Candidate, is_copy
from roboscribe.search.chance import informative
from roboscribe.search.features import Feature
from roboscribe.search.length import length
from roboscribe.search.loop_entities import Pairs, alone, lasting_readings, parting
from roboscribe.search.thresholds import ball, beyond, bits, bound, near_side, too_fine, usual_range
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.trajectory import AGREEMENT, NEVER, first_true, last_false

ARRIVING = 2
"""Frames before ψ_R first holds within which something arrives for it: where it lies is measured at the last two."""
TOGETHER = 0.5
"""Share of the arrivals with which another entity may be moved, too; more often, it is not done for one at a time."""


def recurring_candidates(features: Sequence[Feature], pairs: Pairs) -> Iterator[Candidate]:
    """Find what every entity of a type satisfies once ψ_R holds, and most are brought to on the way.

    Args:
        features: scalar expressions; those that mention `pairs.entity` and no robot are looked at: what is brought
            about for one entity has to last while the robot is busy with the next.
        pairs: evidence.

    Yields:
        Candidates about `pairs.entity`, with `each` set; where it is not every entity of the type, `only` says which.

    Departs: Algorithm 3, line 2 finds a loop when a predicate learned from one entity recurs with another; a predicate
        that was learned from all of them is a loop to begin with.
    """
    readings = list(lasting_readings(features, pairs))
    all_of_them = (Truth(),) if len(pairs.members) > 1 else ()  # of a single one there is nothing to repeat
    for feature in features:
        if pairs.entity in free_vars(feature.term) and not uses_robot(feature.term):
            values, negatives = (pairs.values(feature, s) for s in (pairs.frames, pairs.negatives))
            if np.isfinite(values).all() and np.isfinite(negatives).all():
                telling = (
                    readings if _mentions_goal(feature) else [r for r in readings if not _mentions_goal(r.feature)]
                )
                for sign in (1.0, -1.0):
                    for only in (*all_of_them, *parting(sign * values, telling, pairs)):
                        found = _candidate(feature, features, sign, sign * values, sign * negatives, pairs, only)
                        if found is not None:
                            yield found


def _mentions_goal(feature: Feature) -> bool:
    """Whether a feature is about a goal; where an entity ends is told by its own goal whatever was done to it."""
    return any(isinstance(part, Goal) for part in walk(feature.term))


def _candidate(
    feature: Feature,
    features: Sequence[Feature],
    sign: float,
    values: FloatArray,
    negatives: FloatArray,
    pairs: Pairs,
    only: Predicate,
) -> Candidate | None:
    """Put a threshold where all entities that the loop is about lie once ψ_R holds; values (N, S) to lie below."""
    spread = float(np.std(np.concatenate([values.ravel(), negatives.ravel()])))
    if spread == 0.0:
        return None
    values, negatives = alone(only, values, pairs.frames, pairs), alone(only, negatives, pairs.negatives, pairs)
    worst = negatives.max(axis=0)
    worst = worst[np.isfinite(worst)]  # where no entity is meant nothing fails
    kept, arriving = _at_the_end(values, pairs)
    usual = usual_range(values[np.isfinite(values)], ball(feature, sign))
    if too_fine(feature, usual, kept, worst):
        return None
    unseen = 0.5 * _last_step(values, float(kept.max()), pairs)
    threshold, gap = bound(kept, worst, spread, usual, arriving, ball(feature, sign), unseen)
    threshold = beyond(_spared(values, pairs), threshold, spread, worst)
    predicate = (feature.below if sign > 0 else feature.above)(sign * threshold)
    truth = values < threshold
    first = np.stack([first_true(row, pairs.starts) for row in truth], axis=1)
    reached = first <= (pairs.lasts - pairs.starts)[:, None]
    missing = (~reached).sum(axis=1)
    late = (first > 0) & reached
    if np.mean(missing <= min(1, len(pairs.members) - 1)) < AGREEMENT:
        return None
    meant = np.isfinite(values[:, pairs.starts]).any(axis=0)
    shown = late.any(axis=1) if len(pairs.members) > 1 else late.any(axis=1)[meant]
    if np.mean(shown) < 1.0 - MOST_INITIAL or not _one_by_one(first, late):
        return None
    if _together(values, first, late, pairs) > TOGETHER:
        return None
    said = bits(kept, threshold, usual, feature, sign)
    lengths = np.maximum(1, pairs.lasts - pairs.starts)[:, None]
    return Candidate(
        predicate=predicate,
        accepted=float(np.mean(worst < threshold)) if worst.size else 0.0,
        initial=float(np.mean((first == 0).all(axis=1)[meant])),
        kept=_kept(truth, first, pairs),
        first=float(np.median((first / lengths)[late])) if late.any() else 1.0,
        copy=is_copy(feature, pairs.known.get(only, pairs.known[Truth()])),
        relevant=True,
        advances=True,
        margin=gap / spread,
        scales=((str(feature.term), float(f"{spread:.4g}")),),
        entities=len(free_vars(feature.term)),
        bits=said,
        size=length(predicate) + length(only) - length(Truth()),
        family=feature.family if only == Truth() else f"{feature.family} where {only}",
        each=True,
        informative=informative(said, worst < threshold, int(late.sum()), len(features)),
        only=only,
    )


def _at_the_end(values: FloatArray, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
    """Return where entities lie once ψ_R holds, and where, further off, the last ones right before; values (N, S).

    Where the last one is right before ψ_R holds is not good enough: slack must not reach there. Demonstrations that
    mostly go on for longer say nothing about that.
    """
    before = values[:, pairs.lasts - 1]
    pos = np.minimum(values[:, pairs.lasts], before)
    there = np.isfinite(pos)
    since = _last_beyond(values, float(pos.max()), pairs)
    settled = _settled(since, pairs)
    arriving = there & (since >= 0) & ~settled  # where nothing is to be done nobody arrives
    if settled.any(axis=0).mean() < AGREEMENT:
        settled, arriving = there, there
    kept = pos[settled]
    if np.median(arriving.any(axis=0)) == 0.0:
        return kept, np.empty(0)
    beyond = np.sort(before[arriving & (before > kept.max())])
    return kept, beyond[int((1.0 - AGREEMENT) * len(beyond)) :]


def _last_beyond(values: FloatArray, threshold: float, pairs: Pairs) -> IntArray:
    """Return the last step at which entities lay beyond a threshold, (N, D); -1 where they never did."""
    return np.stack([last_false(row <= threshold, pairs.starts) for row in values])


def _settled(since: IntArray, pairs: Pairs) -> BoolArray:
    """Tell which entities were left behind before ψ_R held, by when they were last beyond where they belong; (N, D).

    The one that was served last is still being served when a demonstration ends at once, so it may be further off; not
    where something else is done after it.
    """
    arriving = since >= pairs.lasts - pairs.starts - ARRIVING
    settled: BoolArray = (since >= 0) & ((since < since.max(axis=0)) | ~arriving)
    return settled


def _spared(values: FloatArray, pairs: Pairs) -> float:
    """Return how far off entities lie that need nothing, from the start on, once ψ_R holds; values (N, S).

    A threshold lies beyond them; what is brought about is not told by them.
    """
    last = values[:, pairs.lasts]
    spared = last[(_last_beyond(values, float(last.max()), pairs) < 0) & np.isfinite(last)]
    return near_side(spared) if spared.size else -np.inf


def _last_step(values: FloatArray, extreme: float, pairs: Pairs) -> float:
    """Return how far beyond an extreme entities usually were one frame before they came within it; values (N, S).

    Of what lies between, demonstrations that pass it in one step say nothing.
    """
    arrivals = [
        row[start + step - 1]
        for row in values
        for start, step in zip(pairs.starts, first_true(row <= extreme, pairs.starts), strict=True)
        if 0 < step < NEVER
    ]
    return float(np.median(arrivals)) - extreme if arrivals else 0.0


def _one_by_one(first: IntArray, late: BoolArray) -> bool:
    """Whether entities that are brought to it are brought to it at different times; (D, N) each."""
    shown = [first[d, late[d]] for d in range(len(first)) if late[d].sum() > 1]
    return not shown or float(np.mean([len(set(times.tolist())) == len(times) for times in shown])) >= AGREEMENT


def _together(values: FloatArray, first: IntArray, late: BoolArray, pairs: Pairs) -> float:
    """Share of the arrivals at which another entity is moved as far: all of them ride on something; values (N, S)."""
    moved = []
    for d, n in zip(*np.nonzero(late), strict=True):
        step = pairs.starts[d] + first[d, n]
        served = np.flatnonzero(late[d])
        if len(served) > 1:
            change = np.abs(values[served, step] - values[served, step - 1])
            moved.append(bool(change[served != n].max() > change[served == n].max() / 2))
    return float(np.mean(moved)) if moved else 0.0


def _kept(truth: BoolArray, first: IntArray, pairs: Pairs) -> float:
    """Share of the frames after an entity first satisfied it on which it does, on average over pairs that do."""
    shares = [
        float(truth[n, start + first[d, n] : last + 1].mean())
        for d, (start, last) in enumerate(zip(pairs.starts, pairs.lasts, strict=True))
        for n in range(len(truth))
        if first[d, n] <= last - start
    ]
    return float(np.mean(shares)) if shares else 0.0
