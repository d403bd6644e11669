"""Figures of evaluations."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.evaluation import episode_seeds
from roboscribe.success_rate import wilson


def test_wilson_by_hand() -> None:
    """With z = 2 and 4 of 8: centre 1/2; half-width 2 sqrt(1/32 + 1/64) / (3/2) = sqrt(1/12)."""
    assert wilson(4, 8, z=2.0) == pytest.approx((0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)))


def test_wilson_of_certain_results_is_not_a_point() -> None:
    """All of n: the interval is [n / (n + z²), 1]."""
    low, high = wilson(500, 500)
    assert high == 1.0
    assert low == pytest.approx(500 / (500 + 1.959964**2), abs=1e-6)
    assert wilson(0, 500) == pytest.approx((1 - high, 1 - low))


def test_nothing_is_known_without_episodes() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


def test_seeds_are_their_purpose_s_own_and_begin_alike() -> None:
    few, many, other = (episode_seeds(*given) for given in ((1, "a", 5), (1, "a", 50), (1, "b", 50)))
    np.testing.assert_array_equal(few, many[:5])
    assert len(set(many) & set(other)) == 0
    assert not np.array_equal(many, episode_seeds(2, "a", 50))
