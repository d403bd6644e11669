"""Exact search over predicates of one and two atoms that separate positive from negative states."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import free_vars, walk
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import And, Norm, Predicate
from roboscribe.search.candidates import (
    LOST_LEVELS,
    OFTEN,
    Anchor,
    Candidate,
    Judged,
    Samples,
    judge,
    level,
)
from roboscribe.search.features import Feature
from roboscribe.search.thresholds import ball, bits, bound, too_fine, usual_range
from roboscribe.world.layout import BoolArray, FloatArray
from roboscribe.world.trajectory import AGREEMENT

__all__ = ["Anchor", "Candidate", "Samples", "rank_predicates"]

NO_WORSE = 0.1
"""How many more negatives a specific projection of a difference may accept than a coarser one."""
HOPELESS, FAR_FROM_ONE = 0.5, 0.9
"""Share of accepted negatives beyond which an atom is not looked at; the same of leaving, for whoever stands at one
thing is far from all others."""


def rank_predicates(
    features: Sequence[Feature], samples: Samples, recurring: Sequence[Candidate] = (), keep: int = 30
) -> tuple[Candidate, ...]:
    """Rank the predicates that separate the samples.

    First single atoms, and what each adds to a predecessor; where none of those explains the goal, atoms as they are
    right before it, and then pairs of atoms. Every feature is tried on both sides, with its threshold at the extreme of
    the positives, so that a candidate holds on all of them, or but for a few that lie far from all others.

    Args:
        features: scalar expressions on offer.
        samples: positives, negatives and demonstrations.
        recurring: predicates that are brought about for one entity after the other.
        keep: length of the table.

    Returns:
        Best first; empty when there is nothing to tell apart. The best may still fail to separate.
    """
    atoms = _atoms(features, samples)
    small = [judge(atom.judged(), samples) for atom in atoms] + list(_anchored(atoms, samples))
    lifted = {c.family for c in recurring}
    small = [c for c in small if c.family not in lifted]
    loops = [c for side in _sidedness(recurring, features) for c in _one_per_family(side)]
    table = sorted([*_one_per_family(small), *loops], key=lambda c: c.rank)
    if not any(c.explains for c in table):
        passing = [judge(atom.judged(), samples) for atom in _passing(features, samples)]
        table = sorted([*table, *_one_per_family(passing)], key=lambda c: c.rank)
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
    bits: float

    @property
    def accepted(self) -> float:
        return float(self.on_negatives.mean()) if self.on_negatives.size else 0.0

    @property
    def scales(self) -> tuple[tuple[str, float], ...]:
        return ((str(self.feature.term), float(f"{self.scale:.4g}")),)

    def judged(self) -> Judged:
        return Judged(
            self.predicate, (self.feature,), self.on_negatives, self.on_frames, self.margin, self.scales, self.bits
        )


def _anchored(atoms: Sequence[_Atom], samples: Samples) -> Iterable[Candidate]:
    """Add one atom to a predecessor about the same entities: what must hold in addition to it."""
    for anchor in samples.anchors:
        old_terms = set(walk(anchor.predicate))
        negatives = holds(anchor.predicate, samples.negatives, {}, samples.layout)
        frames = holds(anchor.predicate, samples.frames, {}, samples.layout)
        for atom in atoms:
            if frozenset(free_vars(atom.predicate)) == anchor.entities and atom.feature.term not in old_terms:
                yield judge(
                    Judged(
                        And(anchor.predicate, atom.predicate),
                        (atom.feature,),
                        negatives & atom.on_negatives,
                        frames & atom.on_frames,
                        atom.margin,
                        (*anchor.scales.items(), *atom.scales),
                        atom.bits,
                        anchor,
                    ),
                    samples,
                )


def _atoms(features: Sequence[Feature], samples: Samples) -> list[_Atom]:
    most = FAR_FROM_ONE if samples.afterwards else HOPELESS
    found = [_atom(feature, values, sign, most) for feature, values, sign in _sides(features, samples)]
    return [atom for atom in found if atom is not None]


def _passing(features: Sequence[Feature], samples: Samples) -> list[_Atom]:
    """Atoms of what comes to hold together with ψ, as it is right before: a touch is a matter of one step."""
    found = []
    for feature, values, sign in () if samples.root else _sides(features, samples):
        if np.median(values.before) > float(values.reached.max()):
            found.append(_atom(feature, replace(values, reached=values.before), sign))
    return [atom for atom in found if atom is not None]


def _sides(features: Sequence[Feature], samples: Samples) -> Iterator[tuple[Feature, _Values, float]]:
    """Yield each feature, and its values in all samples, twice: to lie below, and turned round to lie above."""
    sets = (samples.before, samples.reached, samples.lasts, samples.negatives, samples.frames, samples.otherwise)
    for feature in features:
        values = _Values(*(feature.values(s, samples.layout) if len(s) else np.empty(0) for s in sets))
        if values.finite:
            yield from ((feature, values.towards(sign), sign) for sign in (1.0, -1.0))


@dataclass(frozen=True, eq=False)
class _Values:
    """A feature of all samples; fields as in `Samples`, one number instead of a state."""

    before: FloatArray
    reached: FloatArray
    lasts: FloatArray
    negatives: FloatArray
    frames: FloatArray
    otherwise: FloatArray

    @property
    def finite(self) -> bool:
        return all(np.isfinite(getattr(self, field.name)).all() for field in fields(self))

    def towards(self, sign: float) -> _Values:
        """Turn it round where positives are to lie above."""
        return _Values(*(sign * getattr(self, field.name) for field in fields(self)))


def _atom(feature: Feature, values: _Values, sign: float, most: float = HOPELESS) -> _Atom | None:
    """Put the threshold at the extreme of the positives; sign 1 for "below", -1 for "above".

    What must still hold with ψ is measured where ψ first holds, what is passed on the way right before: whichever of
    the two is the sharper. What is brought about last stands at its threshold there, however sharply it is brought
    about in the end; so how much it says is read off the last frame, where it lasts until then.
    """
    before, neg = values.before, values.negatives
    pos = np.minimum(before, values.reached)
    spread = float(np.std(np.concatenate([neg, pos])))
    if spread == 0.0:
        return None
    usual = usual_range(np.concatenate([pos, neg, values.frames, values.otherwise]), ball(feature, sign))
    if too_fine(feature, usual, pos, neg):
        return None
    threshold, gap = bound(pos, neg, spread, usual, before, ball(feature, sign))
    if neg.size and np.mean(neg < threshold) >= most:
        return None
    build: Callable[[float], Predicate] = feature.below if sign > 0 else feature.above
    predicate = build(sign * threshold)
    said = bits(pos, threshold, usual, feature, sign)
    if np.mean(values.lasts < threshold) >= AGREEMENT:
        settled = np.minimum(pos, values.lasts)
        closer, _ = bound(settled, neg, spread, usual, numbers=ball(feature, sign))
        said = max(said, bits(settled, closer, usual, feature, sign))
    return _Atom(feature, predicate, neg < threshold, values.frames < threshold, spread, gap / spread, said)


def _sidedness(candidates: Sequence[Candidate], features: Sequence[Feature]) -> tuple[list[Candidate], list[Candidate]]:
    """Part what bounds the length of a single number, on either side of its goal, from all else.

    Who only ever comes from one side does not show whether the other side would do.
    """
    wide = {feature.family for feature in features if feature.detail > 1}
    single = {f.term for f in features if isinstance(f.term, Norm) and f.family not in wide}
    either = [c for c in candidates if not single.isdisjoint(walk(c.predicate))]
    return [c for c in candidates if c not in either], either


def _one_per_family(candidates: Iterable[Candidate]) -> list[Candidate]:
    """Of several projections of one difference keep the most specific of those that separate as well as any."""
    families: dict[str, list[Candidate]] = {}
    for candidate in candidates:
        families.setdefault(candidate.family, []).append(candidate)
    return [min(_sharpest(members), key=_within_family) for members in families.values()]


def _sharpest(family: list[Candidate]) -> list[Candidate]:
    advancing = [c for c in family if c.advances] or family
    best = min(c.accepted for c in advancing)
    return [c for c in advancing if c.accepted <= best + NO_WORSE]


def _within_family(c: Candidate) -> tuple[float | bool | str, ...]:
    return (c.initial > OFTEN, level(1.0 - c.kept, LOST_LEVELS), -c.bits, c.first, -c.margin, str(c.predicate))


def _pairs(atoms: Sequence[_Atom], samples: Samples, best: int = 100, keep: int = 800) -> list[Candidate]:
    """Conjunctions of two atoms: acceptance of all pairs at once, then a closer look at the best.

    One of two atoms that never takes anything away from the other adds no more than words.
    """
    sides: dict[tuple[str, int], _Atom] = {}
    for atom in sorted(atoms, key=lambda a: (a.accepted, -a.feature.detail, a.feature.size)):
        sides.setdefault((atom.feature.family, atom.feature.detail), atom)
    chosen = list(sides.values())[:best]
    if len(chosen) < 2:
        return []
    truth = np.stack([a.on_negatives for a in chosen]).astype(np.float32)
    together = truth @ truth.T
    adds = _takes_away(truth) | _takes_away(np.stack([a.on_frames for a in chosen]).astype(np.float32))
    pairs = [ij for ij in combinations(range(len(chosen)), 2) if adds[ij] and adds[ij[::-1]]]
    order = sorted(pairs, key=lambda ij: (together[ij], ij))
    return [_conjunction(chosen[i], chosen[j], samples) for i, j in order[:keep]]


def _takes_away(truth: NDArray[np.float32]) -> BoolArray:
    """Tell of rows (N, S) of 0 and 1 in which (i, j) row i is somewhere 1 where row j is 0, (N, N)."""
    somewhere: BoolArray = truth @ (1.0 - truth).T > 0.0
    return somewhere


def _conjunction(a: _Atom, b: _Atom, samples: Samples) -> Candidate:
    both = Judged(
        And(a.predicate, b.predicate),
        (a.feature, b.feature),
        a.on_negatives & b.on_negatives,
        a.on_frames & b.on_frames,
        min(a.margin, b.margin),
        (*a.scales, *b.scales),
        a.bits + b.bits,
    )
    return judge(both, samples)
