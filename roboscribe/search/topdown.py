"""TOPDOWNENUM: the cheapest conjunction of literals that separates labelled examples.

    P → L | L ∧ P            L → U | ¬U | ∃v'. C | ¬∃v'. C            C → A | ¬A | A ∧ A (literals)

U are atoms about the entity itself, A atoms about it and another one. Nothing is interpreted while candidates are
enumerated: atoms arrive with their truth tables; examples on which all atoms agree are counted instead of repeated;
literals with the table of a cheaper one are dropped; and all conjunctions that share their first literals are judged by
one product of matrices.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import inf

import numpy as np

from roboscribe.dsl.rewrite import conjunction
from roboscribe.dsl.syntax import And, Exists, Not, Predicate, Truth, Var
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

LONGEST = 3
"""Most literals of a conjunction."""
EXISTS_COST = 1
BUDGET = 20_000_000
"""Most conjunctions that one search may judge."""


@dataclass(frozen=True, eq=False)
class Literal:
    """A predicate, its cost and its truth: (X,) over examples, or (N, X) where a second entity is open."""

    predicate: Predicate
    cost: int
    truth: BoolArray


@dataclass(frozen=True, eq=False)
class Atoms:
    """Atoms on offer: `outer` about v, `inner` about v' (and v), to stand under ∃var:kind."""

    outer: tuple[Literal, ...]
    inner: tuple[Literal, ...]
    var: Var
    kind: str


@dataclass(frozen=True)
class Enumeration:
    """What a search found, and how much it judged.

    Args:
        best: the separating predicate that costs least, its exceptions counted, of equals the most accurate; None when
            there is none.
        candidates: conjunctions judged.
        simpler: of these, how many cost no more than the best.
    """

    best: Predicate | None
    candidates: int
    simpler: int = 0


def top_down_enum(atoms: Atoms, positive: BoolArray, tolerance: float) -> Predicate | None:
    """Find the cheapest conjunction that separates the examples.

    Args:
        atoms: literals' atoms with their truth on X examples.
        positive: (X,) labels.
        tolerance: share of the positives that may be rejected, and of the negatives that may be accepted.

    Returns:
        The cheapest separating predicate, of equals the most accurate; None when there is none.

    Source: TOPDOWNENUM in Algorithm 6, line 15.
    """
    return enumerate_conjunctions(atoms, positive, tolerance).best


def enumerate_conjunctions(
    atoms: Atoms, positive: BoolArray, tolerance: float, budget: int = BUDGET, exception_bits: float = 0.0
) -> Enumeration:
    """Judge every conjunction of up to three literals, as long as the budget lasts.

    Args:
        atoms: as in `top_down_enum`.
        positive: as there.
        tolerance: as there.
        budget: most conjunctions judged.
        exception_bits: what it takes to say of one example that it is judged wrongly, compared with what it takes to
            name the predicate among those that cost no more; 0 takes the cheapest whatever exceptions it needs.
    """
    atoms, positives, negatives = _counted(atoms, positive)
    evaluator = _CandidateEvaluator(literals(atoms), positives, negatives, tolerance, budget, exception_bits)
    for length in range(1, LONGEST + 1):
        evaluator.judge_all(length)
    best, cost = evaluator.best()
    return Enumeration(best, evaluator.candidates, evaluator.count_up_to(cost))


@dataclass(frozen=True)
class Strictest:
    """A literal, and which share of the negative examples it refuses."""

    predicate: Predicate
    refused: float


def strictest_literal(atoms: Atoms, positive: BoolArray, tolerance: float) -> Strictest:
    """Find the literal that refuses the most negative examples, but no positive ones.

    Args:
        atoms: literals' atoms with their truth on X examples.
        positive: (X,) labels.
        tolerance: share of the positives that may be refused; literals whose refusals differ by less are equal.

    Returns:
        The strictest literal, of equals the cheapest; True, which refuses none, where there is no other.
    """
    atoms, positives, negatives = _counted(atoms, positive)

    def refused(literal: Literal, examples: FloatArray) -> float:
        return float(examples @ ~literal.truth) / max(1.0, float(examples.sum()))

    fit = [(refused(p, negatives), p) for p in literals(atoms) if refused(p, positives) <= tolerance]
    most = max((share for share, _ in fit), default=0.0)
    equals = [(share, p) for share, p in fit if share >= most - tolerance]
    if not equals:
        return Strictest(Truth(), 0.0)
    share, chosen = min(equals, key=lambda found: (found[1].cost, -found[0], str(found[1].predicate)))
    return Strictest(chosen.predicate, share)


def literals(atoms: Atoms) -> list[Literal]:
    """List the literals that atoms give rise to, cheapest first, each truth table (X,) once."""
    positive = [*atoms.outer, *_existentials(atoms)]
    both = [*positive, *(Literal(Not(p.predicate), p.cost, ~p.truth) for p in positive)]
    seen: dict[bytes, Literal] = {}
    for literal in sorted(both, key=lambda p: p.cost):
        seen.setdefault(literal.truth.tobytes(), literal)
    return list(seen.values())


def _existentials(atoms: Atoms) -> Iterator[Literal]:
    """∃v'. C for one and two literals."""
    signed = [s for a in atoms.inner for s in (a, Literal(Not(a.predicate), a.cost, ~a.truth))]
    for one in signed:
        yield _exists(atoms, one.predicate, one.cost, one.truth)
    for one, other in combinations(signed, 2):
        yield _exists(atoms, And(*_ordered(one, other)), one.cost + other.cost, one.truth & other.truth)


def _ordered(one: Literal, other: Literal) -> tuple[Predicate, Predicate]:
    """Comparisons before learned predicates, as a reader meets them in Eq. 4."""
    first, second = (one, other) if one.cost >= other.cost else (other, one)
    return first.predicate, second.predicate


def _exists(atoms: Atoms, body: Predicate, cost: int, truth: BoolArray) -> Literal:
    somewhere = np.bitwise_or.reduce(truth.view(np.uint8), axis=0).view(np.bool_)  # far faster than any()
    return Literal(Exists(atoms.var, atoms.kind, body), cost + EXISTS_COST, somewhere)


def _counted(atoms: Atoms, positive: BoolArray) -> tuple[Atoms, FloatArray, FloatArray]:
    """Keep one of all examples on which every atom is equally true; count the positive and negative ones of each.

    Counts are float32, exact up to 16 million, because their products are the whole cost of a search.
    """
    atoms, kinds = _distinct_examples(atoms, len(positive))
    count = kinds.max(initial=-1) + 1
    positives, negatives = (np.bincount(kinds[label], minlength=count) for label in (positive, ~positive))
    return atoms, positives.astype(np.float32), negatives.astype(np.float32)


def _distinct_examples(atoms: Atoms, examples: int) -> tuple[Atoms, IntArray]:
    """Keep one of all examples on which every atom is equally true, and say (X,) which one stands for which."""
    rows = [np.atleast_2d(a.truth) for a in (*atoms.outer, *atoms.inner)]
    packed = np.packbits(np.concatenate([np.zeros((1, examples), dtype=np.bool_), *rows]), axis=0)
    columns = np.ascontiguousarray(packed.T).view(np.dtype((np.void, len(packed))))[:, 0]
    _, kept, kinds = np.unique(columns, return_index=True, return_inverse=True)

    def thin(literal: Literal) -> Literal:
        return Literal(literal.predicate, literal.cost, literal.truth[..., kept])

    inner = tuple(thin(a) for a in atoms.inner)
    return Atoms(tuple(thin(a) for a in atoms.outer), inner, atoms.var, atoms.kind), kinds.reshape(-1)


@dataclass
class _CandidateEvaluator:
    """Every candidate passes here: it is counted, judged, and kept if none that separates takes fewer bits.

    Args:
        literals: what conjunctions are made of.
        positives: (X,) float32, how many positive examples there are of each kind.
        negatives: (X,) how many negative ones.
        tolerance: share of either that may be judged wrongly.
        budget: most candidates.
        exception_bits: as in `enumerate_conjunctions`.
    """

    literals: list[Literal]
    positives: FloatArray
    negatives: FloatArray
    tolerance: float
    budget: int
    exception_bits: float = 0.0
    candidates: int = 0
    least: float = inf
    found: list[tuple[float, int, float, tuple[int, ...]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Leave out literals that reject too many positives: no conjunction with them can separate."""
        self.shown, self.hidden = float(self.positives.sum()), float(self.negatives.sum())
        self._within = counts_by_cost([p.cost for p in self.literals])
        tables = np.zeros((len(self.literals), len(self.positives)), dtype=np.float32)
        for table, literal in zip(tables, self.literals, strict=True):
            table[:] = literal.truth
        kept = np.flatnonzero(tables @ self.positives >= self.shown - self._errors(self.shown))
        self.literals = [self.literals[i] for i in kept]
        self.tables = tables[kept]
        self.costs = np.array([p.cost for p in self.literals], dtype=np.int64)
        dearest = LONGEST * int(self.costs.max(initial=0))
        self.bits = np.log2([max(1, self.count_up_to(cost)) for cost in range(dearest + 1)])

    def judge_all(self, length: int) -> None:
        """Judge the conjunctions of `length` literals: one product of matrices for all with the same beginning."""
        for beginning in combinations(range(len(self.literals)), max(0, length - 2)):
            if self.candidates >= self.budget:
                return
            self.judge(beginning, length)

    def judge(self, beginning: tuple[int, ...], length: int) -> None:
        """Judge the conjunctions of `length` literals that begin with all but the last two, or with none."""
        after = beginning[-1] + 1 if beginning else 0
        head, tails, price = self.tables[list(beginning)].prod(axis=0), self.tables[after:], self.costs[after:]
        others, prices = (tails, np.add.outer(price, price)) if length > 1 else (np.ones_like(tails[:1]), price[None])
        self.candidates += len(tails) * (len(tails) - 1) // 2 if length > 1 else len(tails)
        kept = (others * (head * self.positives)) @ tails.T
        accepted = (others * (head * self.negatives)) @ tails.T
        costs = prices + self.costs[list(beginning)].sum()
        fit = (kept >= self.shown - self._errors(self.shown)) & (accepted <= self._errors(self.hidden))
        fit = np.triu(fit, 1) if length > 1 else fit
        exceptions = self.shown - kept + accepted
        bits = self.bits[costs] + self.exception_bits * exceptions
        self.least = min(self.least, float(bits.min(initial=self.least, where=fit)))
        for i, j in np.argwhere(fit & (bits <= self.least)):
            chosen = (*beginning, after + int(i), after + int(j)) if length > 1 else (int(j),)
            missed = (self.shown - float(kept[i, j])) / max(1.0, self.shown)
            wrong = round(missed + float(accepted[i, j]) / max(1.0, self.hidden), 12)
            self.found.append((self.least, int(costs[i, j]), wrong, chosen))

    def _errors(self, examples: float) -> float:
        """Return how many of so many examples may be judged wrongly."""
        return float(np.floor(self.tolerance * examples + 1e-9))

    def count_up_to(self, cost: int) -> int:
        """Return how many literals, and pairs of literals, cost no more than `cost`."""
        return int(self._within[min(cost, len(self._within) - 1)])

    def best(self) -> tuple[Predicate | None, int]:
        """Return the candidate found that takes the fewest bits, and its cost.

        Of equals it is the cheapest, then the most accurate, then the first by its text.
        """
        if not self.found:
            return None, 0
        least = min(found[:3] for found in self.found)
        equals = [conjunction([self.literals[i].predicate for i in f[3]]) for f in self.found if f[:3] == least]
        return min(equals, key=str), least[1]


def counts_by_cost(costs: Sequence[int]) -> IntArray:
    """Count the literals, and pairs of different literals, that cost no more than 0, 1, ... together."""
    singles = np.bincount(np.array(costs, dtype=np.int64), minlength=1)
    ordered = np.convolve(singles, singles)
    ordered[::2] -= singles  # a literal is no pair with itself
    pairs = ordered // 2
    pairs[: len(singles)] += singles
    return np.asarray(np.cumsum(pairs), dtype=np.int64)
