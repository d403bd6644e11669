"""Thresholds: where those of predicates lie, and how much a predicate says with them."""

from __future__ import annotations

import numpy as np

from roboscribe.dsl.syntax import Norm
from roboscribe.search.candidates import MOST_BITS
from roboscribe.search.features import Feature
from roboscribe.world.layout import FloatArray
from roboscribe.world.trajectory import AGREEMENT
from roboscribe.world.units import in_si, is_angle, is_length

SLACK = 0.25
"""How far a threshold lies beyond the positives, in ranges of the positives: a sample's extreme is not the
population's, and a predicate must also fit the entities and episodes to come."""
ACCIDENT = 0.05
"""How seldom samples fall as short of their population's extreme as a threshold allows for."""
FEW = 0.02
"""Share of the negatives that slack may accept; where it would accept more it goes half-way to the next negative."""
PRECISE_LENGTH, PRECISE_ANGLE = 5e-4, 0.02
"""Lengths (m) and angles (rad) that do not matter: blocks that are let go turn by half a degree."""
LEAST_SLACK = 0.001
"""The same in spreads, where all positives are alike."""
ALIKE, STOP = 1 / 1000, 1 / 16
"""Positives within the first share of the usual range stand at a stop; there slack is the second share of that range:
they say where what moved was stopped, and nothing of how far short of there would do."""
DIGITS = (3, 4, 5, 6)
"""Significant digits that a threshold may have."""


def usual_range(values: FloatArray, numbers: int = 0) -> float:
    """Return how far apart nine tenths of values (S,) lie, or all of them where those do not differ.

    Lengths of so many numbers are measured from zero, as are the balls that bound them: a mug that is seldom near its
    place may yet be anywhere around it.
    """
    if numbers:
        return float(np.quantile(values, 0.95))
    return float(np.subtract(*np.quantile(values, (0.95, 0.05)))) or float(np.ptp(values))


def too_fine(feature: Feature, usual: float, pos: FloatArray, neg: FloatArray) -> bool:
    """Tell whether a feature varies by less than robots and their sensors are precise.

    Args:
        feature: of a length or an angle; other numbers have no scale of their own.
        usual: its `usual_range`.
        pos: (P,) positives.
        neg: (M,) negatives.
    """
    precise = PRECISE_LENGTH if is_length(feature.unit) else PRECISE_ANGLE if is_angle(feature.unit) else 0.0
    apart = abs(float(np.median(pos)) - float(np.median(neg))) if neg.size else 0.0
    return max(usual, apart) * in_si(feature.unit) < precise


def far_side(pos: FloatArray) -> float:
    """Return where positives (P,) end that are to lie below a threshold, at the side that it does not bound.

    What a few reach beyond what is needed (a mug that is to be pushed rolls on) says nothing about the threshold: a
    twentieth is left out where the others lie in less than half of the whole range.
    """
    extreme, end, usual_end = near_side(pos), float(pos.min()), float(np.quantile(pos, 1.0 - AGREEMENT))
    return usual_end if extreme - usual_end < 0.5 * (extreme - end) else end


def near_side(pos: FloatArray) -> float:
    """Return where positives (P,) end that are to lie below a threshold, at the side that it bounds.

    A few that lie far from all others (what was served is brushed aside again later) are accidents: a twentieth is left
    out where the others lie in less than half of the whole range.
    """
    ordered = np.sort(pos)
    usual = float(ordered[-1 - int((1.0 - AGREEMENT) * len(pos))])
    return usual if usual - ordered[0] < 0.5 * (ordered[-1] - ordered[0]) else float(ordered[-1])


def bits(pos: FloatArray, threshold: float, usual: float, feature: Feature, sign: float) -> float:
    """Return how much the positives say: how narrow they are among the usual values, as a binary logarithm.

    Args:
        pos: (P,) values of the positives, in the direction of `sign`.
        threshold: below which they lie.
        usual: range of what the feature is otherwise, see `usual_range`.
        feature: of how many numbers it bounds the length counts, too: a ball's volume falls with their count.
        sign: 1 where it lies below, -1 where it lies above.
    """
    few = (len(pos) + 1) / max(1, len(pos) - 1)  # a population is that much wider than a sample
    # The slack that we add to a threshold is not what the positives say; a ball is what it is said to be.
    width = threshold if ball(feature, sign) else few * (near_side(pos) - far_side(pos))
    if usual == 0.0:
        return 0.0
    return float(max(1, ball(feature, sign)) * np.clip(np.log2(usual / max(width, 1e-9)), 0.0, MOST_BITS))


def unseen(samples: int, numbers: int) -> float:
    """Return how far beyond the extreme of samples their population may reach, with 95 % confidence.

    Args:
        samples: how many there are, evenly spread over an interval, or over a ball about zero.
        numbers: dimensions of the ball; 0 for an interval.

    Returns:
        Share of the range of the samples, or of their greatest length.
    """
    freedom = samples * numbers if numbers else samples - 1
    return float(ACCIDENT ** (-1 / max(1, freedom)) - 1)


def ball(feature: Feature, sign: float) -> int:
    """Return how many numbers a feature bounds the length of, where it lies below a threshold; else 0."""
    return feature.detail if isinstance(feature.term, Norm) and sign > 0 else 0


def bound(
    pos: FloatArray,
    neg: FloatArray,
    spread: float,
    usual: float,
    before: FloatArray | None = None,
    numbers: int = 0,
    least: float = 0.0,
) -> tuple[float, float]:
    """Choose the threshold below which all positives lie, and measure the gap from them to the next negative.

    Args:
        pos: (P,) values to lie below.
        neg: (M,) values that had better not.
        spread: what counts as the gap where no negative lies beyond the positives, and as the unit of least slack.
        usual: range of what the feature is otherwise, see `usual_range`.
        before: (P,) values right before the goal; those beyond the positives show that the goal is what sets them.
        numbers: of how many numbers the values are the length; 0 where they are none.
        least: slack of which the demonstrations show nothing.
    """
    extreme = near_side(pos)
    rejected = neg[neg > extreme]
    gap = float(rejected.min()) - extreme if rejected.size else spread
    width = extreme - far_side(pos)
    slack = max(
        SLACK * width,
        unseen(len(pos), numbers) * (extreme if numbers else width),
        LEAST_SLACK * spread,
        least,
        STOP * usual if width < ALIKE * usual and len(pos) > 1 else 0.0,  # one is always like itself
    )
    for values in (neg, pos if before is None else before):
        near = values[values > extreme]
        if near.size and np.mean((values > extreme) & (values < extreme + slack)) > FEW:
            slack = min(slack, 0.5 * (float(near.min()) - extreme))
    return _rounded(extreme + slack, extreme, neg), gap


def beyond(value: float, threshold: float, spread: float, neg: FloatArray) -> float:
    """Return a threshold that a value lies below, too: the one there is, or one just beyond the value.

    Args:
        value: of what is as it should be; -inf where there is none.
        threshold: as `bound` chose it.
        spread: unit of the slack beyond the value.
        neg: (M,) values that had better not lie below; they stay on their sides where the digits of a number allow it.
    """
    least = value + LEAST_SLACK * spread
    return threshold if least <= threshold else _rounded(least, value, neg)


def _rounded(value: float, extreme: float, neg: FloatArray) -> float:
    """Round a threshold to the fewest significant digits, at least three, with which it parts the same samples.

    Source:  Sec. 4.2.1.
    Departs: thresholds are rounded when they are learned, so that what prints is what separates.
    """
    wanted = neg < value
    for digits in DIGITS:
        rounded = _rounded_up(value, digits)
        if rounded > extreme and np.array_equal(neg < rounded, wanted):
            return rounded
    return _rounded_up(value, DIGITS[-1])


def _rounded_up(value: float, digits: int) -> float:
    """Round to significant digits, never downwards, so that what was below stays below."""
    if value == 0.0:
        return 1e-6
    unit = 10.0 ** (np.floor(np.log10(abs(value))) - digits + 1)
    return float(f"{np.ceil(value / unit) * unit:.{digits}g}")
