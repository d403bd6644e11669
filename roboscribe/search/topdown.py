"""TOPDOWNENUM: the cheapest conjunction of literals that separates labelled examples.

    P → L | L ∧ P            L → U | ¬U | ∃v'. C | ¬∃v'. C            C → A | ¬A | A ∧ A (literals)

U are atoms about the entity itself, A atoms about it and another one. Truth tables are bitsets over the examples, so
a candidate costs a few machine words; candidates with the truth table of a cheaper one are dropped.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import conjunction
from roboscribe.dsl.syntax import And, Exists, Not, Predicate, Var
from roboscribe.world.layout import BoolArray

LONGEST = 3
"""Most literals of a conjunction."""
EXISTS_COST = 1


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


@dataclass(frozen=True, eq=False)
class _Entry:
    predicate: Predicate
    cost: int
    bits: NDArray[np.uint8]


def top_down_enum(atoms: Atoms, positive: BoolArray, tolerance: float) -> Predicate | None:
    """Enumerate conjunctions, cheapest first, until one separates the examples.

    Args:
        atoms: literals' atoms with their truth on X examples.
        positive: (X,) labels.
        tolerance: share of the positives that may be rejected, and of the negatives that may be accepted.

    Returns:
        The cheapest separating predicate, of equals the most accurate; None when there is none.

    Source: TOPDOWNENUM in Algorithm 6, line 15.
    """
    labels = np.packbits(positive)
    literals = [e for e in _distinct(_literals(atoms, len(positive))) if _misses(e.bits, labels, positive) <= tolerance]
    found: list[tuple[int, float, str, Predicate]] = []
    for length in range(1, LONGEST + 1):
        for chosen in combinations(literals, length):
            bits = np.bitwise_and.reduce([e.bits for e in chosen])
            missed, accepted = _misses(bits, labels, positive), _accepts(bits, labels, positive)
            if missed <= tolerance and accepted <= tolerance:
                predicate = conjunction([e.predicate for e in chosen])
                found.append((sum(e.cost for e in chosen), missed + accepted, str(predicate), predicate))
    return min(found, key=lambda f: f[:3])[3] if found else None


def _literals(atoms: Atoms, examples: int) -> list[_Entry]:
    """All literals, cheapest first."""
    entries = [_Entry(a.predicate, a.cost, np.packbits(a.truth)) for a in atoms.outer]
    entries += _existentials(atoms)
    full = np.packbits(np.ones(examples, dtype=np.bool_))  # padding bits stay 0
    negated = [_Entry(Not(e.predicate), e.cost, ~e.bits & full) for e in entries]
    return sorted([*entries, *negated], key=lambda e: (e.cost, str(e.predicate)))


def _existentials(atoms: Atoms) -> list[_Entry]:
    """∃v'. C for one and two literals, over all pairs at once."""
    if not atoms.inner:
        return []
    signed = [s for a in atoms.inner for s in (a, Literal(Not(a.predicate), a.cost, ~a.truth))]
    packed = np.stack([np.packbits(s.truth, axis=-1) for s in signed])
    single = np.bitwise_or.reduce(packed, axis=1)
    found = [_exists(atoms, s.predicate, s.cost, bits) for s, bits in zip(signed, single, strict=True)]
    for i, one in enumerate(signed[:-1]):
        both = np.bitwise_or.reduce(packed[i + 1 :] & packed[i], axis=1)
        rest = zip(signed[i + 1 :], both, strict=True)
        found += [_exists(atoms, And(*_ordered(one, s)), one.cost + s.cost, bits) for s, bits in rest]
    return found


def _ordered(one: Literal, other: Literal) -> tuple[Predicate, Predicate]:
    """Comparisons before learned predicates, as a reader meets them in Eq. 4."""
    first, second = (one, other) if one.cost >= other.cost else (other, one)
    return first.predicate, second.predicate


def _exists(atoms: Atoms, body: Predicate, cost: int, bits: NDArray[np.uint8]) -> _Entry:
    return _Entry(Exists(atoms.var, atoms.kind, body), cost + EXISTS_COST, bits)


def _distinct(entries: list[_Entry]) -> list[_Entry]:
    """Observational equivalence: of literals with one truth table keep the first, that is the cheapest."""
    seen: dict[bytes, _Entry] = {}
    for entry in entries:
        seen.setdefault(entry.bits.tobytes(), entry)
    return list(seen.values())


_ONES = np.array([bin(byte).count("1") for byte in range(256)], dtype=np.int64)


def _misses(bits: NDArray[np.uint8], labels: NDArray[np.uint8], positive: BoolArray) -> float:
    return float(_ONES[labels & ~bits].sum() / max(1, positive.sum()))


def _accepts(bits: NDArray[np.uint8], labels: NDArray[np.uint8], positive: BoolArray) -> float:
    return float(_ONES[~labels & bits].sum() / max(1, (~positive).sum()))
