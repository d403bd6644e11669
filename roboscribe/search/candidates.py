"""What speaks for and against a predicate as a subgoal, and the order of preference.

Many predicates separate the same samples; which of them becomes a subgoal decides everything that follows. The order
is written once, in `Candidate.rank`, and the ranked table is part of every result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from roboscribe.dsl.rewrite import free_vars, size
from roboscribe.dsl.syntax import Predicate
from roboscribe.search.features import Feature
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout

LEVELS = (0.1,)
"""Shares of accepted negatives that count as nearly equally good."""
TOLERANCE = 0.2
"""Share of accepted negatives up to which it separates: episodes that begin with it fail for another reason."""
ACCEPTED_COST = 2.0
"""Price of accepting all negatives, in lengths of a demonstration."""
NODE_COST = 0.01
"""Price of a node of a predicate, in lengths of a demonstration: of two equally early ones the shorter is wanted."""
OWN_GOAL_GAIN = 0.2
"""Worth of an entity's own goal, in lengths of a demonstration: a coordinate crosses its threshold a little earlier."""
OFTEN = 0.1
"""Share of the demonstrations beyond which φ is often true at the start."""
LOST_LEVELS = (0.2, 0.5)
"""Shares of frames on which a predicate is lost again that count as equally well maintained."""
AGREEMENT = 0.95
"""Share of the demonstrations that must agree, as in VALIDATE."""
MOST_INITIAL = 0.25
"""Share of the demonstrations that may begin with a predicate satisfied and have no say, as in VALIDATE."""


@dataclass(frozen=True)
class Anchor:
    """A subgoal that comes before the goal already; a new predicate may be asked for in addition to it.

    Args:
        predicate: φ' of a predecessor.
        scales: spread of each of its terms.
    """

    predicate: Predicate
    scales: Mapping[str, float]

    @property
    def entities(self) -> frozenset[str]:
        """Named entities that it mentions."""
        return frozenset(free_vars(self.predicate))


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
        anchors: predecessors of the goal, to which a predicate about the same entities may be added.
    """

    layout: Layout
    positives: FloatArray
    negatives: FloatArray
    frames: FloatArray
    starts: IntArray
    after: Mapping[frozenset[str], IntArray]
    goal_families: frozenset[str] = frozenset()
    goal_entities: frozenset[str] = frozenset()
    anchors: tuple[Anchor, ...] = ()


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
        entities: how many named entities φ mentions.
        detail: how many numbers φ looks at, the more the more specific.
        own_goal: whether φ compares an entity with its own goal.
        size: nodes of φ.
        family: objects and attributes that φ compares.
        standing: once the goal has predecessors, 0 for an entity's own goal, the form of task specifications (Sec. 3);
            1 for what must hold in addition to a predecessor; 2 for anything else. Without predecessors 0.
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
    standing: int = 0

    @property
    def separates(self) -> bool:
        """Whether few enough negatives are accepted."""
        return self.accepted <= TOLERANCE

    @property
    def explains(self) -> bool:
        """Whether this is a step towards the goal: it separates, comes late enough and says something new."""
        return self.separates and self.advances and self.relevant and not self.copy

    @property
    def cost(self) -> float:
        """Weigh what differs by degrees: how late φ is, how many failures it accepts, how long it is, what it is."""
        gain = OWN_GOAL_GAIN * self.own_goal
        return round(self.first + ACCEPTED_COST * self.accepted + NODE_COST * self.size - gain, 3)

    @property
    def rank(self) -> tuple[float | bool | str, ...]:
        """Sort key, best first: the written order of preference.

        It comes after its predecessor; separates; is no weaker copy of the goal; is about the goal's entities; is
        maintained; mentions an entity, but few; stands well with the predecessors; is not often true at the start;
        accepts few failures; is reached early, is small and accepts fewer still; is specific; has a wide margin.
        """
        return (
            not self.advances,
            not self.separates,
            self.copy,
            not self.relevant,
            level(1.0 - self.kept, LOST_LEVELS),
            self.entities == 0,
            self.entities,
            self.standing,
            self.initial > OFTEN,
            level(self.accepted, LEVELS),
            self.cost,
            -self.detail,
            -self.margin,
            str(self.predicate),
        )


def level(share: float, levels: tuple[float, ...]) -> int:
    """Return the index of the first of `levels` that is not below `share`."""
    return int(np.searchsorted(levels, share))


@dataclass(frozen=True, eq=False)
class Judged:
    """A predicate with its truth on negatives (M,) and frames (S,), ready to be judged.

    Args:
        predicate: φ.
        features: what its atoms look at, those of an anchor left out.
        on_negatives: (M,).
        on_frames: (S,).
        margin: distance from the threshold to the nearest rejected negative, in spreads.
        scales: spread of each term.
        anchor: the predecessor that φ contains.
    """

    predicate: Predicate
    features: Sequence[Feature]
    on_negatives: BoolArray
    on_frames: BoolArray
    margin: float
    scales: tuple[tuple[str, float], ...]
    anchor: Anchor | None = None


def judge(it: Judged, samples: Samples) -> Candidate:
    """Measure what `Candidate` lists."""
    names = frozenset(free_vars(it.predicate))
    lengths = np.diff(np.append(samples.starts, len(it.on_frames)))
    first = first_true(it.on_frames, samples.starts)
    since = _since(first, samples.starts, len(it.on_frames))
    own_goal = any(f.own_goal for f in it.features)
    prefix = f"{it.anchor.predicate} ∧ " if it.anchor else ""
    return Candidate(
        predicate=it.predicate,
        accepted=float(it.on_negatives.mean()) if it.on_negatives.size else 0.0,
        initial=float(np.mean(first == 0)),
        kept=float(it.on_frames[since].mean()) if since.any() else 0.0,
        first=float(np.median(first / np.maximum(1, lengths - 1))),
        copy=any(f.family in samples.goal_families for f in it.features),
        relevant=samples.goal_entities <= names,
        advances=_advances(first, lengths, samples.after.get(names)),
        margin=it.margin,
        scales=it.scales,
        entities=len({name for f in it.features for name in free_vars(f.term)}),
        detail=sum(f.detail for f in it.features),
        own_goal=own_goal,
        size=size(it.predicate),
        family=prefix + " ".join(sorted(f.family for f in it.features)),
        standing=_standing(own_goal, it.anchor, samples),
    )


def _standing(own_goal: bool, anchor: Anchor | None, samples: Samples) -> int:
    if anchor is not None:
        return 1
    return 0 if own_goal or not samples.anchors else 2


def _advances(first: IntArray, lengths: IntArray, after: IntArray | None) -> bool:
    """Whether a predicate that first holds at `first` (D,) is reached, mostly not at once, and after `after` (D,)."""
    voters = first > 0
    ahead = float(np.mean(first[voters] > (-1 if after is None else after[voters]))) if voters.any() else 0.0
    return bool(ahead >= AGREEMENT and np.mean(first < lengths) >= AGREEMENT and np.mean(~voters) <= MOST_INITIAL)


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
