"""What speaks for and against a predicate as a subgoal, and the order of preference.

Many predicates separate the same samples; which of them becomes a subgoal decides everything that follows. The order
is written once, in `Candidate.rank`, and the ranked table is part of every result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from roboscribe.dsl.rewrite import free_vars, uses_robot, walk
from roboscribe.dsl.syntax import Exists, Goal, Predicate, Truth, Var
from roboscribe.search.chance import informative
from roboscribe.search.features import Feature
from roboscribe.search.length import length
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import AGREEMENT, first_true, restored

LEVELS = (0.1,)
"""Shares of accepted negatives that count as nearly equally good."""
TOLERANCE = 0.2
"""Share of accepted negatives up to which it separates: episodes that begin with it fail for another reason."""
CLEAR = 0.05
"""Share of accepted negatives up to which a predicate about the goal's entities comes before all others. One that
accepts more may be a part of failing: what stands in the way then is told by others, which accept none."""
ACCEPTED_COST = 2.0
"""Price of accepting all negatives, in lengths of a demonstration."""
NODE_COST = 0.01
"""Price of a node of a predicate, in lengths of a demonstration: of two equally early ones the shorter is wanted."""
ENTITY_COST = 0.1
"""Price of each further entity that is named, in lengths of a demonstration: two bits, which tell it from others."""
BIT_GAIN = 0.05
"""Worth of a bit, in lengths of a demonstration: a predicate that halves what is possible says twice as much."""
LOOP_GAIN = 0.1
"""The same of a loop, for every entity bears it out: a place says more than the half of the table that it lies in."""
MOST_BITS = 6.0
"""Bits beyond which a number says no more: a threshold of one part in 64 is as sharp as a controller can be."""
LATE = 0.9
"""Part of the way to a subgoal beyond which what begins to hold comes with it and is hardly a step towards it."""
TELLING = 2.0
"""Bits below which being about the goal's entities does not count: a side of the table that the goal lies on is passed
on the way to it, whatever stands in the way."""
APART = 1.0
"""Margin from which on it counts for all that: nothing that failed was near it, as a mug that nobody has touched."""
OFTEN = 0.1
"""Share of the crossings beyond which φ is often true at the start."""
LOST_LEVELS = (0.1, 0.5)
"""Shares of frames on which a predicate is lost again that count as equally well maintained."""
MOST_INITIAL = 0.5
"""Share of the crossings that may begin with what leads on: more often than not there has to be something to do."""
LEAST_KEPT = 0.5
"""Share of the frames up to the goal on which a subgoal has to hold on: what is mostly lost again is passed by, and a
program that waits for it goes back."""


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
        before: (C, F), P_s: of each crossing into ψ the state right before.
        reached: (C, F), the state on which ψ first holds.
        lasts: (C, F), the last state that is shown, where a demonstration goes on once ψ holds.
        negatives: (M, F), N_s.
        frames: (S, F), the crossings from takeover to the first frame of ψ, one after the other.
        starts: (C,), where each crossing begins in `frames`.
        otherwise: (O, F), what is shown besides: of a part that is cut out, the whole shows what values are usual.
        choices: how many expressions were on offer.
        steps: per set of named entities, when (C,) each subgoal about them that is there already first holds.
        known: what the goal and the subgoals before it compare already, see `is_copy`.
        restored: the same of those subgoals that restore what held at first.
        goal_entities: entities that the goal mentions by name.
        elsewhere: of each other branch, what it moves that the goal does not mention, and when (C,) it is done.
        root: whether ψ is ψ_R, which may be nothing but what φ says; another goal has to come after φ.
        afterwards: whether these are the parts of the demonstrations in which all that comes before the goal is done.
        anchors: predecessors of the goal, to which a predicate about the same entities may be added.
    """

    layout: Layout
    before: FloatArray
    reached: FloatArray
    lasts: FloatArray
    negatives: FloatArray
    frames: FloatArray
    starts: IntArray
    otherwise: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    choices: int = 2
    steps: Mapping[frozenset[str], tuple[IntArray, ...]] = field(default_factory=dict)
    known: Mapping[str, int] = field(default_factory=dict)
    restored: Mapping[str, int] = field(default_factory=dict)
    goal_entities: frozenset[str] = frozenset()
    elsewhere: tuple[tuple[frozenset[str], IntArray], ...] = ()
    root: bool = True
    afterwards: bool = False
    anchors: tuple[Anchor, ...] = ()


@dataclass(frozen=True)
class Candidate:
    """One separating predicate and what speaks for and against it.

    Args:
        predicate: φ.
        accepted: share of the negatives on which φ holds.
        initial: share of the crossings in which φ holds at the start.
        kept: share of the frames after φ first held, up to the goal, on which it holds; the mean over crossings.
        first: where in a crossing φ first holds, median, 0 start to 1 goal.
        copy: whether φ compares what the goal or a subgoal before it compares, with another threshold; that explains
            nothing, but where it is the first to restore what an earlier subgoal undid.
        relevant: whether φ mentions every entity that the goal mentions, and no branch elsewhere brings it about.
        advances: whether φ is brought about on the way, always after or always before each subgoal that is there.
        margin: distance from the threshold to the nearest rejected negative, in spreads.
        scales: spread of each term over positives and negatives.
        entities: how many named entities φ mentions.
        bits: how much φ says: the binary logarithm of how many times more is possible without it.
        size: how long φ is, see `length`.
        family: objects and attributes that φ compares.
        standing: once the goal has predecessors, 0 for what holds in the world, whatever the robot does next; 1 for
            what is about the robot; 2 for what is said of entities with all of which a loop has dealt, and for leaving
            something by name; 3 for what is then said of some of them, for who leaves is away from all, and of goals.
            Else 0.
        each: whether φ is brought about for one entity of a type after the other: a loop.
        with_others: whether φ relates that entity to one that moves and is not of its type: what is missing may be to
            move that one.
        comes_with_it: whether φ begins to hold hardly before the subgoal that it should lead to. Where nothing about
            an entity is known to come before that, what is about the robot may: a button is pressed as soon as the hand
            is there.
        informative: whether φ says enough, and not by chance, see the function of that name.
        only: of a loop, which entities it is about.
        afterwards: whether it is brought about when all that comes before the goal is done.
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
    bits: float
    size: int
    family: str
    standing: int = 0
    each: bool = False
    with_others: bool = False
    comes_with_it: bool = False
    informative: bool = True
    only: Predicate = field(default_factory=Truth)
    afterwards: bool = False

    @property
    def separates(self) -> bool:
        """Whether few enough negatives are accepted."""
        return self.accepted <= TOLERANCE

    @property
    def possible(self) -> bool:
        """Whether it can be a subgoal: it separates, is brought about on the way, lasts, and says something new."""
        lasts = self.kept >= LEAST_KEPT
        return self.separates and self.advances and lasts and self.informative and not self.copy

    @property
    def explains(self) -> bool:
        """Whether this is a step towards the goal: a possible subgoal about the goal's entities."""
        return self.possible and self.relevant

    @property
    def leads_on(self) -> bool:
        """Whether it is a step of the goal's own.

        It is about the goal's entities and comes before them, says much, has mostly to be brought about, and fails
        clearly with them. Of what a loop repeats every entity is a witness: that need not say as much, nor need what
        lies far from all that fails.
        """
        tells = self.each or self.bits >= TELLING or self.margin >= APART
        mostly_late, fails = self.initial <= MOST_INITIAL, self.accepted <= CLEAR
        return self.relevant and not self.comes_with_it and tells and mostly_late and fails

    @property
    def cost(self) -> float:
        """Weigh what differs by degrees: how late φ is, how many failures it accepts, how long it is, what it says.

        What is lost again is as late as it is long: both are the share of the way on which φ does not hold.
        """
        complete_with_task = self.each and not self.with_others  # as what a loop repeats is
        missing = self.first + (1.0 - self.first) * (1.0 - self.kept)
        lateness = 0.0 if complete_with_task else missing
        price = lateness + ACCEPTED_COST * self.accepted + NODE_COST * self.size
        price += ENTITY_COST * max(0, self.entities - 1)
        return round(price - (LOOP_GAIN if self.each else BIT_GAIN) * self.bits, 3)

    @property
    def levels(self) -> tuple[float | bool, ...]:
        """What differs in kind between candidates; those that differ only by degrees may prove to be better.

        It is brought about on the way; separates; is no weaker copy of what is there; leads on to the goal; is
        maintained; mentions an entity, but few; recurs; stands well with the predecessors; is not often true at the
        start; accepts few failures.
        """
        return (
            not self.advances,
            not self.separates,
            self.copy,
            not self.leads_on,
            level(1.0 - self.kept, LOST_LEVELS),
            self.entities == 0,
            not self.each or self.with_others,
            self.standing,
            self.initial > OFTEN,
            level(self.accepted, LEVELS),
        )

    @property
    def rank(self) -> tuple[float | bool | str, ...]:
        """Sort key, best first: the written order of preference.

        What `levels` says; then it is reached early, is small, says much and accepts fewer still; has a wide margin.
        """
        return (*self.levels, self.cost, -self.margin, str(self.predicate))


def is_copy(feature: Feature, known: Mapping[str, int]) -> bool:
    """Tell whether what a feature looks at is compared already, by as many numbers.

    Args:
        feature: α.
        known: greatest `Feature.detail` of each `Feature.family` that is compared already. That the hand is above a
            block leaves much to say about where it is.
    """
    return known.get(feature.family, 0) >= feature.detail


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
        bits: how much φ says, without its anchor.
        anchor: the predecessor that φ contains.
    """

    predicate: Predicate
    features: Sequence[Feature]
    on_negatives: BoolArray
    on_frames: BoolArray
    margin: float
    scales: tuple[tuple[str, float], ...]
    bits: float = 0.0
    anchor: Anchor | None = None


def judge(it: Judged, samples: Samples) -> Candidate:
    """Measure what `Candidate` lists."""
    names = frozenset(free_vars(it.predicate))
    lengths = np.diff(np.append(samples.starts, len(it.on_frames)))
    of_robot = any(uses_robot(f.term) for f in it.features)
    first = np.minimum((first_true if of_robot else restored)(it.on_frames, samples.starts), lengths)
    since = _since(first, samples.starts, len(it.on_frames))
    ways, brought = first / np.maximum(1, lengths - 1), (first > 0) & (first < lengths)
    restores = np.mean(it.on_frames[samples.starts] & brought) >= AGREEMENT
    leaving = samples.afterwards and of_robot and any(isinstance(part, Var) for part in walk(it.predicate))
    prefix = f"{it.anchor.predicate} ∧ " if it.anchor else ""
    return Candidate(
        predicate=it.predicate,
        accepted=float(it.on_negatives.mean()) if it.on_negatives.size else 0.0,
        initial=float(np.mean(first == 0)),
        kept=_kept(it.on_frames, since, samples.starts),
        first=_median(ways),
        copy=any(is_copy(f, samples.restored if restores else samples.known) for f in it.features),
        relevant=samples.goal_entities <= names and not _done_elsewhere(names, first, samples),
        advances=_advances(first, lengths, samples.steps.get(names, ()))
        and (samples.root or _median((lengths - 1 - first)[brought]) > 0),
        margin=it.margin,
        scales=it.scales,
        entities=len({name for f in it.features for name in free_vars(f.term)}),
        bits=it.bits,
        informative=informative(
            it.bits, it.on_negatives, int(brought.sum()), samples.choices, len(it.features), leaving=leaving
        ),
        size=length(it.predicate),
        family=prefix + " ".join(sorted(f.family for f in it.features)),
        comes_with_it=not samples.root and _median(ways[brought]) > LATE and not (of_robot and not samples.anchors),
        standing=_standing(it.predicate, samples, of_robot=of_robot),
        afterwards=samples.afterwards,
    )


def _median(values: FloatArray | IntArray) -> float:
    """Return the median of values (C,), 0 of none."""
    return float(np.median(values)) if values.size else 0.0


def _standing(phi: Predicate, samples: Samples, *, of_robot: bool) -> int:
    """Say how likely what φ is about comes next, see `Candidate`."""
    if samples.afterwards:
        about_goal = of_robot and any(isinstance(part, Goal) for part in walk(phi))
        if isinstance(phi, Exists) or about_goal:  # a goal is left with what lies there by now
            return 3
        if of_robot == bool(free_vars(phi)):
            return 2
    return int(bool(samples.anchors) and of_robot)


def _advances(first: IntArray, lengths: IntArray, others: Sequence[IntArray]) -> bool:
    """Whether a predicate that first holds at `first` (C,) is brought about, on one side of each of `others` (C,)."""
    voters = (first > 0) & (first < lengths)
    if np.mean(first < lengths) < AGREEMENT or not voters.any():
        return False
    sides = ((first >= other, first < other) for other in others)
    return all(max(np.mean(after[voters]), np.mean(before[voters])) >= AGREEMENT for after, before in sides)


def _done_elsewhere(names: frozenset[str], first: IntArray, samples: Samples) -> bool:
    """Whether what first holds at `first` (C,) is about what another branch moves, and there no later than it is done.

    That a mug stands far below a drawer follows from its being where another branch brings it.
    """
    return any(moved & names and np.median(done - first) >= 0 for moved, done in samples.elsewhere)


def _kept(truth: BoolArray, since: BoolArray, starts: IntArray) -> float:
    """Return the share of the frames `since` φ first held on which it does, on average over crossings.

    Whoever passes by early on and is long away again is one of many.
    """
    held, after = (np.add.reduceat(part.astype(np.int64), starts) for part in (truth & since, since))
    seen = after > 0
    return float(np.mean(held[seen] / after[seen])) if seen.any() else 0.0


def _since(first: IntArray, starts: IntArray, total: int) -> BoolArray:
    """Frames at or after the first true one of their episode."""
    lengths = np.diff(np.append(starts, total))
    index = np.arange(total) - np.repeat(starts, lengths)
    return np.asarray(index >= np.repeat(first, lengths))
