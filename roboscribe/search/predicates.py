"""Exact search over one- and two-atom predicates that separate positive from negative states, ranked.

Many predicates separate the same samples; which of them becomes a subgoal decides everything that follows. The order
of preference is written once, in `Candidate.rank`, and the ranked table is part of every result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from roboscribe.dsl.rewrite import free_vars
from roboscribe.dsl.syntax import And, Predicate
from roboscribe.search.features import Feature
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout

LEVELS = (0.03, 0.1)
"""Shares of accepted negatives that count as equally good; beyond the last a predicate does not separate."""
FINE_LEVELS = (0.001, 0.01, 0.03, 0.1)
"""The same between projections of one difference, where separating better is all that a coarser one has to offer."""
TOLERANCE = LEVELS[-1]
LOST_LEVELS = (0.2, 0.5)
"""Shares of frames on which a predicate is lost again that count as equally well maintained."""
SLACK = 0.25
"""How far a threshold lies beyond the positives, in ranges of the positives: a sample's extreme is not the
population's, and a predicate must also fit the entities and episodes to come. At most half-way to a negative."""


@dataclass(frozen=True)
class Samples:
    """What a predicate is judged on.

    Args:
        layout: meaning of the states.
        positives: (P, F), P_s.
        negatives: (M, F), N_s.
        frames: (S, F), the demonstrations up to the goal, one after the other.
        starts: (D,), where each demonstration begins in `frames`.
        after: per set of named entities, the frame (D,), counted from its demonstration's start, that a predicate
            about them must come after; sets that are missing are free.
        goal_families: what the goal itself compares, as `Feature.family`.
        goal_entities: entities that the goal mentions by name.
    """

    layout: Layout
    positives: FloatArray
    negatives: FloatArray
    frames: FloatArray
    starts: IntArray
    after: Mapping[frozenset[str], IntArray]
    goal_families: frozenset[str] = frozenset()
    goal_entities: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Candidate:
    """One separating predicate and what speaks for and against it.

    Args:
        predicate: φ.
        accepted: share of the negatives on which φ holds.
        initial: share of the demonstrations in which φ holds at the start.
        kept: share of the frames after φ first held, up to the goal, on which it holds.
        first: where in a demonstration φ first holds, median, 0 start to 1 goal.
        copy: whether φ compares what the goal itself compares, with another threshold; that explains nothing.
        relevant: whether φ mentions every entity that the goal mentions.
        advances: whether φ first holds after what precedes it, in 95 % of the demonstrations.
        margin: distance from the threshold to the nearest rejected negative, in spreads.
        scales: spread of each term, to make margins comparable in a reward.
    """

    predicate: Predicate
    accepted: float
    initial: float
    kept: float
    first: float
    copy: bool
    relevant: bool
    advances: bool
    margin: float
    scales: tuple[tuple[str, float], ...]
    entities: int
    detail: int
    own_goal: bool
    size: int
    family: str

    @property
    def separates(self) -> bool:
        """Whether few enough negatives are accepted."""
        return self.accepted <= TOLERANCE

    @property
    def explains(self) -> bool:
        """Whether this is a step towards the goal: it separates, comes late enough and says something new."""
        return self.separates and self.advances and self.relevant and not self.copy

    @property
    def rank(self) -> tuple[float | bool | str, ...]:
        """Sort key, best first: the written order of preference.

        It comes after its predecessor; separates; is no weaker copy of the goal; is about the goal's entities; is not true at the start; is maintained; mentions few entities;
        speaks of an entity and its own goal; is reached early; is specific; is small; has a wide margin.
        """
        return (
            not self.advances,
            not self.separates,
            self.copy,
            not self.relevant,
            level(self.accepted),
            self.initial > TOLERANCE,
            level(1.0 - self.kept, LOST_LEVELS),
            max(1, self.entities),
            not self.own_goal,
            round(self.first, 1),
            self.size,
            -self.detail,
            -self.margin,
            str(self.predicate),
        )


def level(share: float, levels: tuple[float, ...] = LEVELS) -> int:
    """Return the index of the first of `levels` that is not below `share`."""
    return int(np.searchsorted(levels, share))


def rank_predicates(features: Sequence[Feature], samples: Samples, keep: int = 30) -> tuple[Candidate, ...]:
    """Rank the one-atom predicates that separate the samples, and two-atom ones where no single atom does.

    Every feature is tried on both sides, with its threshold at the extreme of the positives, so that a candidate
    always holds on all of them.

    Args:
        features: scalar expressions on offer.
        samples: positives, negatives and demonstrations.
        keep: length of the table.

    Returns:
        Best first; empty when there is nothing to tell apart. The best may still fail to separate.
    """
    atoms = [atom for atom in _atoms(features, samples) if atom.accepted < 0.5]
    singles = _one_per_family(_judge(atom, samples) for atom in atoms)
    table = sorted(singles, key=lambda c: c.rank)
    if not any(c.explains for c in table):
        table = sorted([*table, *_pairs(atoms, samples)], key=lambda c: c.rank)
    return tuple(table[:keep])


@dataclass(frozen=True, eq=False)
class _Atom:
    """A threshold on one feature: its truth on negatives and frames."""

    feature: Feature
    predicate: Predicate
    on_negatives: BoolArray
    on_frames: BoolArray
    scale: float
    margin: float

    @property
    def accepted(self) -> float:
        return float(self.on_negatives.mean()) if self.on_negatives.size else 0.0


def _atoms(features: Sequence[Feature], samples: Samples) -> list[_Atom]:
    found = []
    for feature in features:
        values = [feature.values(s, samples.layout) for s in (samples.positives, samples.negatives, samples.frames)]
        if not all(np.isfinite(v).all() for v in values):
            continue
        found += [_atom(feature, *values, sign) for sign in (1.0, -1.0)]
    return [atom for atom in found if atom is not None]


def _atom(feature: Feature, pos: FloatArray, neg: FloatArray, frames: FloatArray, sign: float) -> _Atom | None:
    """Put the threshold at the extreme of the positives; sign 1 for "below", -1 for "above"."""
    pos, neg, frames = sign * pos, sign * neg, sign * frames
    extreme = float(pos.max())
    spread = float(np.std(np.concatenate([neg, pos])))
    if spread == 0.0:
        return None
    rejected = neg[neg > extreme]
    gap = float(rejected.min()) - extreme if rejected.size else spread
    slack = SLACK * (extreme - float(pos.min()))
    threshold = _rounded_up(extreme + min(slack, 0.5 * gap))
    if not extreme < threshold:
        return None
    build: Callable[[float], Predicate] = feature.below if sign > 0 else feature.above
    predicate = build(sign * threshold)
    return _Atom(feature, predicate, neg < threshold, frames < threshold, spread, gap / spread)


def _rounded_up(value: float, digits: int = 3) -> float:
    """Round to significant digits, never downwards, so that what was below stays below."""
    if value == 0.0:
        return 1e-6
    unit = 10.0 ** (np.floor(np.log10(abs(value))) - digits + 1)
    return float(f"{np.ceil(value / unit) * unit:.{digits}g}")


def _judge(atom: _Atom, samples: Samples) -> Candidate:
    return _candidate((atom,), atom.predicate, atom.on_negatives, atom.on_frames, samples)


def _candidate(
    atoms: tuple[_Atom, ...], predicate: Predicate, neg: BoolArray, frames: BoolArray, samples: Samples
) -> Candidate:
    lengths = np.diff(np.append(samples.starts, len(frames)))
    first = first_true(frames, samples.starts)
    reached = first < lengths
    since = _since(first, samples.starts, len(frames))
    after = samples.after.get(frozenset(free_vars(predicate)), np.full(len(first), -1))
    voters = first > 0
    ahead = float(np.mean(first[voters] > after[voters])) if voters.any() else 0.0
    return Candidate(
        predicate=predicate,
        accepted=float(neg.mean()) if neg.size else 0.0,
        initial=float(np.mean(first == 0)),
        kept=float(frames[since].mean()) if since.any() else 0.0,
        first=float(np.median(first / np.maximum(1, lengths - 1))),
        copy=any(atom.feature.family in samples.goal_families for atom in atoms),
        relevant=samples.goal_entities <= set(free_vars(predicate)),
        advances=bool(ahead >= 0.95 and reached.mean() >= 0.95 and np.mean(first == 0) <= 0.25),
        margin=min(atom.margin for atom in atoms),
        scales=tuple((str(atom.feature.term), float(f"{atom.scale:.4g}")) for atom in atoms),
        entities=len({name for atom in atoms for name in free_vars(atom.feature.term)}),
        detail=sum(atom.feature.detail for atom in atoms),
        own_goal=any(atom.feature.own_goal for atom in atoms),
        size=sum(atom.feature.size for atom in atoms),
        family=" ".join(sorted(atom.feature.family for atom in atoms)),
    )


def first_true(truth: BoolArray, starts: IntArray) -> IntArray:
    """First true frame of each episode, counted from its start; the episode's length where there is none."""
    ends = np.append(starts[1:], len(truth))
    where = np.flatnonzero(truth)
    found = np.searchsorted(where, starts)
    step = np.append(where, len(truth))[found]
    return np.asarray(np.minimum(step, ends) - starts, dtype=np.int64)


def _since(first: IntArray, starts: IntArray, total: int) -> BoolArray:
    """Frames at or after the first true one of their episode."""
    lengths = np.diff(np.append(starts, total))
    index = np.arange(total) - np.repeat(starts, lengths)
    return np.asarray(index >= np.repeat(first, lengths))


def _one_per_family(candidates: Iterable[Candidate]) -> list[Candidate]:
    """Of several projections of one difference keep the best separating, and of equals the most specific one."""
    best: dict[str, Candidate] = {}
    for candidate in candidates:
        old = best.get(candidate.family)
        if old is None or _within_family(candidate) < _within_family(old):
            best[candidate.family] = candidate
    return list(best.values())


def _within_family(c: Candidate) -> tuple[float | bool, ...]:
    fine = level(c.accepted, FINE_LEVELS)
    lost = level(1.0 - c.kept, LOST_LEVELS)
    return (not c.advances, fine, c.initial > TOLERANCE, lost, -c.detail, c.first, -c.margin)


def _pairs(atoms: Sequence[_Atom], samples: Samples, best: int = 100, keep: int = 800) -> list[Candidate]:
    """Conjunctions of two atoms: acceptance of all pairs at once, then a closer look at the best."""
    sides: dict[tuple[str, int], _Atom] = {}
    for atom in sorted(atoms, key=lambda a: (a.accepted, -a.feature.detail, a.feature.size)):
        sides.setdefault((atom.feature.family, atom.feature.detail), atom)
    chosen = list(sides.values())[:best]
    if len(chosen) < 2:
        return []
    truth = np.stack([a.on_negatives for a in chosen]).astype(np.float32)
    together = truth @ truth.T
    order = sorted(combinations(range(len(chosen)), 2), key=lambda ij: (together[ij], ij))
    return [_conjunction(chosen[i], chosen[j], samples) for i, j in order[:keep]]


def _conjunction(a: _Atom, b: _Atom, samples: Samples) -> Candidate:
    predicate = And(a.predicate, b.predicate)
    return _candidate((a, b), predicate, a.on_negatives & b.on_negatives, a.on_frames & b.on_frames, samples)
