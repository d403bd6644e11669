"""Statistics over seeds and tasks, against values worked out by hand."""

from __future__ import annotations

from itertools import product
from math import inf, isnan

import numpy as np
import pytest

from roboscribe.stages.paper.statistics import Spread, improvement, median_steps, middle, spread, steps_until, value_at


def test_the_interquartile_mean_leaves_a_quarter_out_at_either_end() -> None:
    assert middle([0.0, 0.2, 0.4, 1.0]) == pytest.approx(0.3)
    assert middle([1.0, 0.0, 0.5, 0.6, 0.7]) == pytest.approx(0.6)  # 5 / 4 rounds to one at either end
    assert middle([0.9]) == 0.9


def test_an_interval_of_two_seeds_is_that_of_all_their_resamples() -> None:
    """Resamples of (0, 1) are 00, 01, 10 and 11: a quarter each of means 0 and 1, so that 95 % span everything."""
    found = spread([[0.0, 1.0]])
    assert (found.mean, found.iqm, found.low, found.high) == (0.5, 0.5, 0.0, 1.0)


def test_tasks_are_resampled_each_for_itself() -> None:
    """A stratum of zeros and one of ones: every stratified resample is the same; unstratified ones are not."""
    found = spread([[0.0] * 4, [1.0] * 4])
    assert (found.iqm, found.low, found.high) == (0.5, 0.5, 0.5)


def test_the_interval_is_the_percentiles_of_all_resamples() -> None:
    """Two tasks of three and two seeds have 27 * 4 equally likely resamples, which can be listed."""
    first, second = [0.2, 0.5, 0.9], [0.1, 0.8]
    listed = [middle([*a, *b]) for a, b in product(product(first, repeat=3), product(second, repeat=2))]
    low, high = np.quantile(listed, [0.025, 0.975], method="inverted_cdf")
    found = spread([first, second], resamples=40_000)
    assert found.low == pytest.approx(low, abs=0.02)
    assert found.high == pytest.approx(high, abs=0.02)


def test_the_seed_decides_the_interval() -> None:
    samples = [[0.1, 0.2, 0.5, 0.7, 0.9], [0.3, 0.4, 0.45, 0.8, 1.0]]
    assert spread(samples, seed=1, resamples=200) == spread(samples, seed=1, resamples=200)
    assert spread(samples, seed=1, resamples=200) != spread(samples, seed=2, resamples=200)


def test_one_seed_has_no_interval() -> None:
    found = spread([[0.7]])
    assert isinstance(found, Spread)
    assert (found.mean, found.iqm) == (0.7, 0.7)
    assert isnan(found.low)
    assert isnan(found.high)


def test_seeds_that_agree_have_an_interval_of_no_width() -> None:
    found = spread([[1.0] * 5])
    assert (found.low, found.high) == (1.0, 1.0)


def test_the_probability_of_improvement_counts_ties_half() -> None:
    """(1, 0.5) against (0.5, 0): three of four pairs are won, one is a tie."""
    assert improvement({"a": [1.0, 0.5]}, {"a": [0.5, 0.0]}) == pytest.approx(3.5 / 4)
    assert improvement({"a": [1.0], "b": [0.0]}, {"a": [0.0], "b": [0.0], "c": [1.0]}) == pytest.approx(0.75)
    assert improvement({"a": [1.0]}, {"b": [1.0]}) is None


def test_steps_until_a_rate() -> None:
    points = [(100, 0.2), (200, 0.95), (300, 0.4), (400, 0.99)]
    assert steps_until(points, 0.9) == 200
    assert steps_until(points, 0.999) == inf


def test_not_reached_counts_in_the_median() -> None:
    assert median_steps([10.0, 20.0, inf]) == 20.0
    assert median_steps([10.0, inf, inf]) == inf
    assert median_steps([10.0, 20.0, inf, inf]) == inf


def test_the_value_is_that_of_the_last_evaluation() -> None:
    points = [(100, 0.5), (200, 0.2)]
    assert [value_at(points, x) for x in (99, 100, 199, 200, 1e9)] == [0.0, 0.5, 0.5, 0.2, 0.2]
