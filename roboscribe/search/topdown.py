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
from functools import cached_property
from itertools import combinations
from math import inf

import numpy as np
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import conjunction
from roboscribe.dsl.syntax import And, Exists, Not, Predicate, Truth, Var
from roboscribe.world.layout import BoolArray, IntArray

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
    """

    best: Predicate | None
    candidates: int


@dataclass(frozen=True, eq=False)
class Situations:
    """Examples that stand side by side, in each situation of which a predicate has to be true of some.

    Args:
        of: (X,) rank of the situation that each example stands in.
        judged: (X,) whether it counts as an example, too.
        most_empty: share of the situations that may be left without any.
    """

    of: IntArray
    judged: BoolArray
    most_empty: float

    @cached_property
    def count(self) -> int:
        """How many there are."""
        return int(self.of.max(initial=-1)) + 1

    def filled(self, truth: BoolArray) -> bool:
        """Tell whether a predicate with this truth (X,) is true of some example in enough situations."""
        found = np.zeros(self.count, dtype=np.bool_)
        found[self.of[truth]] = True
        return float(np.count_nonzero(~found)) <= self.most_empty * self.count


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
    atoms: Atoms,
    positive: BoolArray,
    tolerance: float,
    budget: int = BUDGET,
    exception_bits: float = 0.0,
    most_bits: float = inf,
    situations: Situations | None = None,
) -> Enumeration:
    """Judge every conjunction of up to three literals, as long as the budget lasts.

    Args:
        atoms: as in `top_down_enum`.
        positive: as there.
        tolerance: as there.
        budget: most conjunctions judged.
        exception_bits: what it takes to say of one example that it is judged wrongly, compared with what it takes to
            name the predicate among those that cost no more; 0 takes the cheapest whatever exceptions it needs.
        most_bits: that this may take, and naming the predicate.
        situations: in which the predicate has to be true of some examples; None asks for none.
    """
    kinds = _count_kinds(atoms, positive, situations)
    offered, counted = literals(kinds.atoms), (kinds.positives + kinds.negatives) > 0
    evaluator = _CandidateEvaluator(
        literals=[each for each in offered if kinds.possible(each.truth)],
        on_offer=counts_by_cost([each.cost for each in _differing(offered, counted)]),
        kinds=kinds,
        tolerance=tolerance,
        budget=budget,
        exception_bits=exception_bits,
        least=most_bits,
    )
    for length in range(1, LONGEST + 1):
        evaluator.judge_all(length)
    return Enumeration(evaluator.best(), evaluator.candidates)


@dataclass(frozen=True)
class Strictest:
    """A literal, and which share of the negative examples it refuses."""

    predicate: Predicate
    refused: float


def strictest_literal(
    atoms: Atoms,
    positive: BoolArray,
    tolerance: float,
    situations: Situations | None = None,
    chosen: BoolArray | None = None,
) -> Strictest:
    """Find the literal that refuses the most negative examples, but no positive ones.

    Args:
        atoms: literals' atoms with their truth on X examples.
        positive: (X,) labels.
        tolerance: share of the positives that may be refused; literals whose refusals differ by less are equal.
        situations: as in `enumerate_conjunctions`.
        chosen: (X,) positives of which no more may be refused by themselves either; None is all of them.

    Returns:
        The strictest literal, of equals the cheapest; True, which refuses none, where there is no other.
    """
    kinds = _count_kinds(atoms, positive, situations)

    def refused(literal: Literal, examples: NDArray[np.float32]) -> float:
        return float(examples @ ~literal.truth) / max(1.0, float(examples.sum()))

    rows = kinds.of[positive if chosen is None else chosen]
    taken = np.bincount(rows, minlength=len(kinds.positives)).astype(np.float32)
    possible = [p for p in literals(kinds.atoms) if refused(p, taken) <= tolerance and kinds.possible(p.truth)]
    fit = [(refused(p, kinds.negatives), p) for p in possible if refused(p, kinds.positives) <= tolerance]
    most = max((share for share, _ in fit), default=0.0)
    equals = [(share, p) for share, p in fit if share >= most - tolerance]
    if not equals:
        return Strictest(Truth(), 0.0)
    share, strictest = min(equals, key=lambda found: (found[1].cost, -found[0], str(found[1].predicate)))
    return Strictest(strictest.predicate, share)


def literals(atoms: Atoms) -> list[Literal]:
    """List the literals that atoms give rise to, cheapest first, each truth table (X,) once."""
    positive = [*atoms.outer, *_existentials(atoms)]
    both = [*positive, *(Literal(Not(p.predicate), p.cost, ~p.truth) for p in positive)]
    return _differing(sorted(both, key=lambda p: p.cost))


def _differing(offered: Sequence[Literal], examples: BoolArray | slice = slice(None)) -> list[Literal]:
    """Keep the first of all literals that agree on some examples."""
    seen: dict[bytes, Literal] = {}
    for literal in offered:
        seen.setdefault(literal.truth[examples].tobytes(), literal)
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


@dataclass(frozen=True, eq=False)
class _Kinds:
    """Examples on which all atoms agree are of one kind.

    Args:
        atoms: with their truth on each kind, (K,).
        of: (X,) kind of each example.
        positives: (K,) float32, how many positive examples there are of each kind.
        negatives: (K,) how many negative ones.
        situations: in which a predicate has to be true of some examples.
    """

    atoms: Atoms
    of: IntArray
    positives: NDArray[np.float32]
    negatives: NDArray[np.float32]
    situations: Situations | None

    def possible(self, truth: BoolArray) -> bool:
        """Tell whether a predicate with some truth (K,) may be taken."""
        return self.situations is None or self.situations.filled(truth[self.of])


def _count_kinds(atoms: Atoms, positive: BoolArray, situations: Situations | None) -> _Kinds:
    """Keep one of all examples on which every atom is equally true; count the positive and negative ones of each.

    Counts are float32, exact up to 16 million, because their products are the whole cost of a search.
    """
    atoms, kinds = _distinct_examples(atoms, len(positive))
    judged = np.ones_like(positive) if situations is None else situations.judged
    count = kinds.max(initial=-1) + 1
    positives, negatives = (
        np.bincount(kinds[label & judged], minlength=count).astype(np.float32) for label in (positive, ~positive)
    )
    return _Kinds(atoms, kinds, positives, negatives, situations)


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
        on_offer: by cost, how many literals, and pairs of them, there are to choose from, see `counts_by_cost`.
        kinds: of examples.
        tolerance: share of either that may be judged wrongly.
        budget: most candidates.
        exception_bits: as in `enumerate_conjunctions`.
        least: bits of the best so far; at first those that it may take.
    """

    literals: list[Literal]
    on_offer: IntArray
    kinds: _Kinds
    tolerance: float
    budget: int
    exception_bits: float
    least: float
    candidates: int = 0
    found: list[tuple[float, int, float, tuple[int, ...]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Leave out literals that reject too many positives: no conjunction with them can separate."""
        counted = (self.kinds.positives + self.kinds.negatives) > 0
        self.positives, self.negatives = self.kinds.positives[counted], self.kinds.negatives[counted]
        self.shown, self.hidden = float(self.positives.sum()), float(self.negatives.sum())
        tables = np.zeros((len(self.literals), len(self.positives)), dtype=np.float32)
        for table, literal in zip(tables, self.literals, strict=True):
            table[:] = literal.truth[counted]
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
        better = np.argwhere(fit & (bits <= self.least))
        for i, j in better[np.argsort(bits[tuple(better.T)], kind="stable")]:
            if bits[i, j] > self.least:
                break
            chosen = (*beginning, after + int(i), after + int(j)) if length > 1 else (int(j),)
            if not self._is_possible(chosen):
                continue
            self.least = float(bits[i, j])
            missed = (self.shown - float(kept[i, j])) / max(1.0, self.shown)
            wrong = round(missed + float(accepted[i, j]) / max(1.0, self.hidden), 12)
            self.found.append((self.least, int(costs[i, j]), wrong, chosen))

    def _is_possible(self, chosen: tuple[int, ...]) -> bool:
        """Tell whether a conjunction may be taken."""
        if self.kinds.situations is None:
            return True
        return self.kinds.possible(np.logical_and.reduce([self.literals[rank].truth for rank in chosen]))

    def _errors(self, examples: float) -> float:
        """Return how many of so many examples may be judged wrongly."""
        return float(np.floor(self.tolerance * examples + 1e-9))

    def count_up_to(self, cost: int) -> int:
        """Return how many literals, and pairs of literals, cost no more than `cost`."""
        return int(self.on_offer[min(cost, len(self.on_offer) - 1)])

    def best(self) -> Predicate | None:
        """Return the candidate found that takes the fewest bits.

        Of equals it is the cheapest, then the most accurate, then the first by its text.
        """
        if not self.found:
            return None
        least = min(found[:3] for found in self.found)
        equals = [conjunction([self.literals[i].predicate for i in f[3]]) for f in self.found if f[:3] == least]
        return min(equals, key=str)


def counts_by_cost(costs: Sequence[int]) -> IntArray:
    """Count the literals, and pairs of different literals, that cost no more than 0, 1, ... together."""
    singles = np.bincount(np.array(costs, dtype=np.int64), minlength=1)
    ordered = np.convolve(singles, singles)
    ordered[::2] -= singles  # a literal is no pair with itself
    pairs = ordered // 2
    pairs[: len(singles)] += singles
    return np.asarray(np.cumsum(pairs), dtype=np.int64)
