"""Whether a predicate says more than chance: among hundreds of expressions some separate by accident."""

from __future__ import annotations

from math import factorial

import numpy as np

from roboscribe.world.layout import BoolArray

CHANCE = 0.05
"""How many predicates may be expected to hold at every crossing by chance, as often as they hold in failing states."""
LEAST_BITS = 1.0
"""Bits below which a predicate says nothing: it does not even halve what is possible."""


def informative(
    bits: float, accepted: BoolArray, crossings: int, choices: int, atoms: int = 1, *, leaving: bool = False
) -> bool:
    """Tell whether a predicate says enough, and not by chance; arguments as below."""
    return enough_said(bits, crossings, choices, leaving=leaving) and not likely_chance(
        accepted, crossings, choices, atoms
    )


def enough_said(bits: float, crossings: int, choices: int, *, leaving: bool = False) -> bool:
    """Tell whether a predicate says more than it takes to name it.

    Args:
        bits: what it says about one crossing.
        crossings: how often the demonstrations agree with it; from few of them something always seems to follow.
        choices: how many expressions were on offer.
        leaving: whether it is about leaving something: almost anywhere is away from it.
    """
    return bool((bits >= LEAST_BITS or leaving) and bits * crossings >= np.log2(choices))


def likely_chance(accepted: BoolArray, crossings: int, choices: int, atoms: int = 1) -> bool:
    """Tell whether some predicate would hold at every crossing even if crossings were no more than failing states.

    Args:
        accepted: (M,) failing states on which the predicate holds.
        crossings: how often the demonstrations agree with it; of few, failing states would agree with much.
        choices: how many expressions were on offer, each with two sides.
        atoms: of how many of them the predicate consists; each has a threshold of its own, at the outermost crossing,
            so that more of them leave fewer states by chance.
    """
    share = (np.count_nonzero(accepted) + 1) / (len(accepted) + 2)
    # Each atom by itself lets pass what the greatest of as many uniform numbers does; these are multiplied.
    fitted = sum((-crossings * np.log(share)) ** n / factorial(n) for n in range(atoms))
    by_chance = atoms * np.log2(2 * choices) + crossings * np.log2(share) + np.log2(fitted)
    return bool(by_chance > np.log2(CHANCE))
