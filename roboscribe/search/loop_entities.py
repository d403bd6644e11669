"""Which entities of a type a loop is about: all, or those of which a number that nothing changes lies in some range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import comb, log2

import numpy as np

from roboscribe.dsl.rewrite import free_vars, rename
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import And, Predicate, Proj, Truth
from roboscribe.search.features import Feature
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import AGREEMENT

STILL = 0.01
"""Share of the range of its initial values by which a number may change that counts as lasting: sensors are noisy."""
MOST_CUTS = 15
"""Thresholds that are tried for one number; where more would tell entities apart, as many evenly spread ones, and as
many in the widest gaps: kinds that differ leave one. Then those beside the best of them are tried, too."""


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


def lasting_readings(features: Sequence[Feature], pairs: Pairs) -> Iterator[tuple[Feature, FloatArray]]:
    """Yield single numbers of an entity, or of its goal, that no demonstration changes, with their values (N, D)."""
    for feature in features:
        term = feature.term
        if isinstance(term, Proj) and feature.over is None and free_vars(term) == (pairs.entity,):
            values = pairs.values(feature, pairs.frames)
            initial = values[:, pairs.starts]
            if np.ptp(initial) > 0.0 and is_lasting(values, pairs.starts):
                yield feature, initial


def parting(values: FloatArray, readings: Sequence[tuple[Feature, FloatArray]], pairs: Pairs) -> Iterator[Predicate]:
    """Find entities that end below a threshold where all others end beyond it, told by a number that nothing changes.

    That number lies beyond a threshold of its own, or, where none parts them, between two.

    Args:
        values: (N, S) of a feature, to lie below a threshold once ψ_R holds.
        readings: what may tell them, see `lasting_readings`.
        pairs: evidence.

    Yields:
        For each number what tells the entities that it parts best from the others, if it parts them at all, and if
        that says more than it takes to choose it.
    """
    ends = values[:, pairs.lasts]
    for feature, initial in readings:
        cuts = _cuts(initial)
        only, chosen = _best_side(feature, initial, cuts, ends)
        if _parted(ends, chosen) <= 0.0:
            only, chosen = _between(feature, initial, ends)
        said = log2(comb(chosen.size, int(chosen.sum())))
        enough = log2(2 * len(cuts) * len(readings) * len(pairs.members))
        if _parted(ends, chosen) > 0.0 and said >= enough:
            yield only


def _best_side(
    feature: Feature, values: FloatArray, cuts: Sequence[float], ends: FloatArray
) -> tuple[Predicate, BoolArray]:
    """Find the side of a threshold that parts entities best, and which values (N, D) lie there.

    Both sides of the number by which demonstrators tell them apart are to end at the same one, so that all thresholds
    beside the best of the `cuts` are tried, too.
    """

    def rank(side: tuple[float, bool]) -> tuple[bool, float]:
        return _parts(ends, _lies(values, *side))

    cut, above = max(((cut, above) for above in (False, True) for cut in cuts), key=rank)
    at, bounds = cuts.index(cut), [-np.inf, *cuts, np.inf]
    low, high = bounds[at], bounds[at + 2]
    cut = max((cut, *(other for other in _midpoints(values) if low < other < high)), key=lambda cut: rank((cut, above)))
    return feature.above(cut) if above else feature.below(cut), _lies(values, cut, above)


def _lies(values: FloatArray, cut: float, above: bool) -> BoolArray:
    """Tell which values lie on a side of a threshold."""
    return np.asarray(values > cut if above else values < cut)


def _between(feature: Feature, values: FloatArray, ends: FloatArray) -> tuple[Predicate, BoolArray]:
    """Bound, on both sides, the values (N, D) of those entities whose `ends` (N, D) lie below the widest gap."""
    ordered = np.sort(ends, axis=None)
    chosen = ends <= ordered[np.argmax(np.diff(ordered))]
    low, high = values[chosen].min(), values[chosen].max()
    beneath, beyond = values[values < low], values[values > high]
    if chosen.all() or not len(beneath) or not len(beyond):
        return Truth(), np.zeros_like(chosen)
    bounds = ((beneath.max() + low) / 2, (high + beyond.min()) / 2)
    low, high = (float(f"{bound:.3g}") for bound in bounds)
    return And(feature.above(low), feature.below(high)), (values > low) & (values < high)


def _cuts(values: FloatArray) -> list[float]:
    """Thresholds between different values, a few of all."""
    between = _midpoints(values)
    widest = np.argsort(-np.diff(np.unique(values)), kind="stable")[:MOST_CUTS]
    spread = np.linspace(0, len(between) - 1, MOST_CUTS).astype(int)
    return sorted({between[i] for i in np.union1d(widest, spread)})


def _midpoints(values: FloatArray) -> list[float]:
    """All thresholds between different values, in rising order."""
    levels = np.unique(values)
    return [float(f"{cut:.3g}") for cut in (levels[1:] + levels[:-1]) / 2]


def _parts(ends: FloatArray, chosen: BoolArray) -> tuple[bool, float]:
    """Rank how well entities are parted: without exception before with a few, then by the gap in their own ranges.

    What goes to the first of three trays lies in it; what goes to one of the first two lies anywhere between.
    """
    gap = _parted(ends, chosen)
    if gap <= 0.0:
        return False, gap
    own = float(np.ptp(ends[chosen])) + (1.0 - AGREEMENT) * float(np.ptp(ends[np.isfinite(ends)]))
    least = float(ends[~chosen].min() - ends[chosen].max())
    return least > 0.0, (least if least > 0.0 else gap) / own


def _parted(ends: FloatArray, chosen: BoolArray) -> float:
    """Return how wide the gap is between where those chosen end and where the others do; not above 0 for none."""
    if not chosen.any() or chosen.all():
        return -np.inf
    return float(np.quantile(ends[~chosen], 1.0 - AGREEMENT) - np.quantile(ends[chosen], AGREEMENT))
