"""Which entities of a type a loop is about: all, or those of which a number that nothing changes lies in some range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import comb, log2

import numpy as np

from roboscribe.dsl.rewrite import free_vars, rename
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import And, Predicate, Proj, Truth
from roboscribe.dsl.types import named_entities
from roboscribe.search.features import Feature
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import AGREEMENT

STILL = 0.01
"""Share of the range of its initial values by which a number may change that counts as lasting: sensors are noisy."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Demonstrations, read once for every entity of a type.

    Args:
        layout: meaning of the states.
        entity: the name that stands for any of them, b1.
        members: (N,) the entities.
        frames: (S, F) demonstrations from their start to the first frame of ψ_R, one after the other.
        starts: (D,) where each begins in `frames`.
        negatives: (M, F), N_s.
        known: what the tree compares already, see `is_copy`, for those entities that its loops mean.
    """

    layout: Layout
    entity: str
    members: tuple[int, ...]
    frames: FloatArray
    starts: IntArray
    negatives: FloatArray
    known: Mapping[Predicate, Mapping[str, int]]

    @property
    def lasts(self) -> IntArray:
        """Last frame of each demonstration, (D,)."""
        return np.append(self.starts[1:], len(self.frames)) - 1

    def values(self, feature: Feature, states: FloatArray) -> FloatArray:
        """Evaluate a feature for every entity, (N, S)."""
        named = ((e, {self.entity: self.layout.names[e]}) for e in self.members)
        return np.stack([evaluate(rename(feature.term, m), states, {}, self.layout)[..., 0] for _, m in named])

    def truth(self, predicate: Predicate, states: FloatArray) -> BoolArray:
        """Evaluate a predicate about `entity` for every entity, (N, S)."""
        return np.stack([holds(predicate, states, {self.entity: e}, self.layout) for e in self.members])


def alone(only: Predicate, values: FloatArray, states: FloatArray, pairs: Pairs) -> FloatArray:
    """Put (N, S) values of entities that a loop is not about below every threshold: nothing is left to do."""
    return values if only == Truth() else np.where(pairs.truth(only, states), values, -np.inf)


def is_lasting(values: FloatArray, starts: IntArray) -> bool:
    """Tell whether values (..., S) of a number stay in every demonstration what they are where it starts, (D,)."""
    begun = np.repeat(starts, np.diff(np.append(starts, values.shape[-1])))
    return bool(np.abs(values - values[..., begun]).max() <= STILL * np.ptp(values[..., starts]))


@dataclass(frozen=True, eq=False)
class Reading:
    """A number that no demonstration changes, by which entities may be told apart.

    Args:
        feature: what is read.
        initial: (N, D) its values, by entity and demonstration.
    """

    feature: Feature
    initial: FloatArray

    @cached_property
    def cuts(self) -> FloatArray:
        """Thresholds between different values, in rising order."""
        return np.array([middle(*pair) for pair in pairwise(np.unique(self.initial).tolist())])

    @cached_property
    def sides(self) -> BoolArray:
        """Which values (2C, N D) lie below each of the C thresholds, then which lie above."""
        below = self.initial.ravel() < self.cuts[:, None]
        return np.concatenate([below, ~below])

    def side(self, rank: int) -> Predicate:
        """Say what all on a side have in common."""
        cut = float(self.cuts[rank % len(self.cuts)])
        return self.feature.below(cut) if rank < len(self.cuts) else self.feature.above(cut)


def lasting_readings(features: Sequence[Feature], pairs: Pairs) -> Iterator[Reading]:
    """Yield single numbers of an entity, or of its goal, that no demonstration changes.

    Where a type has one entity, what is done with it may be told by other things without like, a lamp say.
    """
    for feature in features:
        names = free_vars(feature.term)
        if isinstance(feature.term, Proj) and feature.over is None and names and _tells(names[0], pairs):
            values = pairs.values(feature, pairs.frames)
            initial = values[:, pairs.starts]
            if np.ptp(initial) > 0.0 and is_lasting(values, pairs.starts):
                yield Reading(feature, initial)


def _tells(name: str, pairs: Pairs) -> bool:
    """Whether what an entity is like may tell whom a loop is about: each of them, or a thing without like."""
    if name == pairs.entity or len(pairs.members) > 1:
        return name == pairs.entity
    kind = named_entities(pairs.layout).get(name)
    return kind is not None and len(pairs.layout.of_type(kind)) == 1


def parting(values: FloatArray, readings: Sequence[Reading], pairs: Pairs) -> Iterator[Predicate]:
    """Find entities that end below a threshold where all others end beyond it, told by a number that nothing changes.

    That number lies beyond a threshold of its own or between two, whichever parts them better.

    Args:
        values: (N, S) of a feature, to lie below a threshold once ψ_R holds.
        readings: what may tell them, see `lasting_readings`.
        pairs: evidence.

    Yields:
        For each number what tells the entities that it parts best from the others, if it parts them at all, and if
        that says more than it takes to choose it.
    """
    ends = values[:, pairs.lasts].ravel()
    for reading in readings:
        within, inside = _between_two(reading, ends)
        ranges = np.concatenate([reading.sides, inside[None]])
        best, gap = _best_parting(ends, ranges)
        said = log2(comb(len(ends), int(ranges[best].sum())))
        enough = log2(2 * len(reading.cuts) * len(readings) * len(pairs.members))
        if gap > 0.0 and said >= enough:
            yield within if best == len(reading.sides) else reading.side(best)


def _between_two(reading: Reading, ends: FloatArray) -> tuple[Predicate, BoolArray]:
    """Bound, on both sides, the numbers (M,) of those entities whose `ends` (M,) lie below the widest gap."""
    values, ordered = reading.initial.ravel(), np.sort(ends)
    chosen = ends <= ordered[np.argmax(np.diff(ordered))]
    low, high = values[chosen].min(), values[chosen].max()
    beneath, beyond = values[values < low], values[values > high]
    if chosen.all() or not len(beneath) or not len(beyond):
        return Truth(), np.zeros_like(chosen)
    low, high = middle(float(beneath.max()), float(low)), middle(float(high), float(beyond.min()))
    return And(reading.feature.above(low), reading.feature.below(high)), (values > low) & (values < high)


def middle(low: float, high: float) -> float:
    """Return a number about half-way between two, with as few digits as lie between them, and at least three."""
    half = (low + high) / 2
    rounded = (float(f"{half:.{digits}g}") for digits in range(3, 17))
    return next((each for each in rounded if low < each < high), half)


def _best_parting(ends: FloatArray, ranges: BoolArray) -> tuple[int, float]:
    """Find the range that parts entities best, and the gap between where they end; not above 0 for none.

    That is one without exception before one with a few, then by the gap in the entities' own ranges: what goes to the
    first of three trays lies in it, what goes to one of the first two lies anywhere between.

    Args:
        ends: (M,) where each entity ends.
        ranges: (C, M) which of them each range is about.
    """
    order = np.argsort(ends, kind="stable")
    chosen = _Subsets(ends[order], ranges[:, order])
    others = _Subsets(ends[order], ~ranges[:, order])
    two = (chosen.counts > 0) & (others.counts > 0)
    gaps = np.where(two, others.quantile(1.0 - AGREEMENT) - chosen.quantile(AGREEMENT), -np.inf)
    least = others.quantile(0.0) - chosen.quantile(1.0)
    own = chosen.quantile(1.0) - chosen.quantile(0.0) + (1.0 - AGREEMENT) * np.ptp(ends[np.isfinite(ends)])
    exact = (gaps > 0.0) & (least > 0.0)
    score = np.divide(np.where(exact, least, gaps), own, out=gaps.copy(), where=gaps > 0.0)
    best = int(np.lexsort((-score, ~exact))[0])
    return best, float(gaps[best])


class _Subsets:
    """Quantiles of many subsets of some numbers at once; those of the empty subset mean nothing.

    Args:
        ordered: (M,) rising.
        members: (C, M) which of them are in each subset.
    """

    def __init__(self, ordered: FloatArray, members: BoolArray) -> None:
        """Count, from the lowest number on, how many each subset has."""
        self.ordered, self.ranks = ordered, np.cumsum(members, axis=1)
        self.counts = self.ranks[:, -1]

    def quantile(self, share: float) -> FloatArray:
        """Return the quantile (C,) of each subset, between two numbers in proportion."""
        place = share * np.maximum(self.counts - 1, 0)
        below = np.floor(place).astype(np.int64)
        low, high = self._at(below), self._at(np.minimum(below + 1, np.maximum(self.counts - 1, 0)))
        quantile: FloatArray = low + (place - below) * (high - low)
        return quantile

    def _at(self, rank: IntArray) -> FloatArray:
        found: FloatArray = self.ordered[np.argmax(self.ranks > rank[:, None], axis=1)]
        return found
