"""Which entities of a type a loop is about: all, or those that a number tells which nothing changes.

That number lies in some range, or is the greatest or the least of all.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import comb, log2
from typing import NamedTuple

import numpy as np

from roboscribe.dsl.rewrite import free_vars, rename, uses_robot
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import And, Diff, Exists, Less, Not, Predicate, Proj, Truth, Var
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
        named = ({self.entity: self.layout.names[e]} for e in self.members)
        each = (replace(feature, term=rename(feature.term, name)) for name in named)
        return np.stack([feature.values(states, self.layout) for feature in each])

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
    def order(self) -> IntArray:
        """Ranks (N D,) of the values, rising."""
        return np.argsort(self.initial, axis=None, kind="stable")

    @cached_property
    def cuts(self) -> dict[int, float]:
        """Thresholds between different values, in rising order, by how many values lie below."""
        values = self.initial.ravel()[self.order].tolist()
        between = {rank: middle(*pair) for rank, pair in enumerate(pairwise(values), start=1)}
        return {rank: cut for rank, cut in between.items() if values[rank - 1] < cut < values[rank]}


def lasting_readings(features: Sequence[Feature], pairs: Pairs) -> Iterator[Reading]:
    """Yield single numbers of an entity, or of its goal, that no demonstration changes.

    They may be compared with those of things without like, a scale's limit, say. Where a type has one entity, what is
    done with it may be told by such things alone, by a lamp.
    """
    for feature in features:
        single = isinstance(feature.term, Proj | Diff) and feature.over is None and not uses_robot(feature.term)
        if single and _tells(set(free_vars(feature.term)), pairs):
            values = pairs.values(feature, pairs.frames)
            initial = values[:, pairs.starts]
            if np.ptp(initial) > 0.0 and is_lasting(values, pairs.starts):
                yield Reading(feature, initial)


def _tells(names: Set[str], pairs: Pairs) -> bool:
    """Whether what some entities are like may tell whom a loop is about: each of them, and things without like."""
    kinds = named_entities(pairs.layout)
    without_like = all(name in kinds and len(pairs.layout.of_type(kinds[name])) == 1 for name in names - {pairs.entity})
    return without_like and (pairs.entity in names or (bool(names) and len(pairs.members) == 1))


def parting(values: FloatArray, readings: Sequence[Reading], pairs: Pairs) -> Iterator[Predicate]:
    """Find entities that end below a threshold where all others end beyond it, told by a number that nothing changes.

    That number lies beyond a threshold of its own or between two, or is the greatest or the least of its
    demonstration, whichever parts them better.

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
        ranges = [*_sides(reading, ends), *_between_two(reading, ends), *_superlatives(reading, ends, pairs)]
        best = max(ranges, key=lambda one: one.rank, default=None)
        enough = log2(2 * max(1, len(reading.cuts)) * len(readings) * len(pairs.members))
        if best is not None and best.gap > 0.0 and best.bits >= enough:
            yield best.only


class _Range(NamedTuple):
    """Some entities, and how well they are parted from the others.

    Attributes:
        only: what tells them.
        bits: what it says which of all entities, over all demonstrations, they are.
        gap: between where they end and where the others do; not above 0 for none.
        rank: the higher, the better they are parted.
    """

    only: Predicate
    bits: float
    gap: float
    rank: tuple[bool, float]


class _Ends(NamedTuple):
    """Where some entities end: the least, two quantiles and the greatest; a twentieth lies beyond each quantile."""

    least: float
    low: float
    high: float
    greatest: float


def _range(only: Predicate, bits: float, chosen: _Ends, others: _Ends, whole: float) -> _Range:
    """Rank how well entities are parted: without exception before with a few, then by the gap in their own ranges.

    What goes to the first of three trays lies in it; what goes to one of the first two lies anywhere between.
    """
    gap, least = others.low - chosen.high, others.least - chosen.greatest
    if gap <= 0.0:
        return _Range(only, bits, gap, (False, gap))
    own = chosen.greatest - chosen.least + (1.0 - AGREEMENT) * whole
    return _Range(only, bits, gap, (least > 0.0, (least if least > 0.0 else gap) / own))


def _sides(reading: Reading, ends: FloatArray) -> Iterator[_Range]:
    """Yield all entities below a threshold, and all beyond it, for every threshold."""
    ordered, whole = ends[reading.order], float(np.ptp(ends))
    below, beyond = _growing(ordered), _growing(ordered[::-1])[::-1]
    bits = {count: log2(comb(len(ends), count)) for count in reading.cuts}
    for count, cut in reading.cuts.items():
        yield _range(reading.feature.below(cut), bits[count], below[count - 1], beyond[count], whole)
    for count, cut in reading.cuts.items():
        yield _range(reading.feature.above(cut), bits[count], beyond[count], below[count - 1], whole)


def _growing(ends: FloatArray) -> list[_Ends]:
    """Say where the first, the first two, ... of some entities end."""
    ordered, found = list[float](), list[_Ends]()
    for end in ends.tolist():
        insort(ordered, end)
        found.append(_where(ordered))
    return found


def _where(ordered: Sequence[float]) -> _Ends:
    """Say where entities end, given the rising numbers."""
    return _Ends(ordered[0], _quantile(ordered, 1.0 - AGREEMENT), _quantile(ordered, AGREEMENT), ordered[-1])


def _quantile(ordered: Sequence[float], share: float) -> float:
    """Return a quantile of rising numbers, between two in proportion."""
    place = share * (len(ordered) - 1)
    low = int(place)
    return ordered[low] + (place - low) * (ordered[min(low + 1, len(ordered) - 1)] - ordered[low])


def _between_two(reading: Reading, ends: FloatArray) -> Iterator[_Range]:
    """Yield, bounded on both sides, the numbers of those entities whose `ends` (M,) lie below the widest gap."""
    values, ordered = reading.initial.ravel(), np.sort(ends)
    chosen = ends <= ordered[np.argmax(np.diff(ordered))]
    low, high = values[chosen].min(), values[chosen].max()
    beneath, beyond = values[values < low], values[values > high]
    if chosen.all() or not len(beneath) or not len(beyond):
        return
    low, high = middle(float(beneath.max()), float(low)), middle(float(high), float(beyond.min()))
    inside = (values > low) & (values < high)
    if inside.any() and not inside.all():
        only = And(reading.feature.above(low), reading.feature.below(high))
        within, others = _where(sorted(ends[inside])), _where(sorted(ends[~inside]))
        yield _range(only, log2(comb(len(ends), int(inside.sum()))), within, others, float(np.ptp(ends)))


def _superlatives(reading: Reading, ends: FloatArray, pairs: Pairs) -> Iterator[_Range]:
    """Yield the greatest and the least entities of each demonstration, and all but either."""
    count, mine = len(pairs.members), reading.feature.term
    if count < 2 or free_vars(mine) != (pairs.entity,):
        return
    kind = pairs.layout.entities[pairs.members[0]].name
    other = Var(f"{pairs.layout.letter(kind)}'")
    theirs, whole = rename(mine, {pairs.entity: other.name}), float(np.ptp(ends))
    for surpassed, best in (
        (Less(mine, theirs), reading.initial.max(axis=0)),
        (Less(theirs, mine), reading.initial.min(axis=0)),
    ):
        chosen = reading.initial == best
        if chosen.all():
            continue
        bits = sum(log2(comb(count, number)) for number in chosen.sum(axis=0).tolist())
        chosen = chosen.ravel()
        those, others = _where(sorted(ends[chosen])), _where(sorted(ends[~chosen]))
        rest = Exists(other, kind, surpassed)
        yield _range(Not(rest), bits, those, others, whole)
        yield _range(rest, bits, others, those, whole)


def middle(low: float, high: float) -> float:
    """Return a number about half-way between two, with as few digits as lie between them, and at least three."""
    half = (low + high) / 2
    rounded = (float(f"{half:.{digits}g}") for digits in range(3, 17))
    return next((each for each in rounded if low < each < high), half)
