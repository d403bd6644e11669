"""Statistics over seeds and tasks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from statistics import median

import numpy as np
from numpy.typing import NDArray
from scipy import stats

CONFIDENCE = 0.95
RESAMPLES = 10_000
TRIMMED = 0.25
"""Share that the interquartile mean leaves out at either end."""
Samples = Sequence[Sequence[float]]
"""One sample per task: its seeds' values."""
FEW_SEEDS = "Bootstrap intervals from five seeds or fewer are too narrow; they show the spread, they prove nothing."


@dataclass(frozen=True)
class Spread:
    """How values lie.

    Args:
        mean: of all values.
        iqm: interquartile mean.
        low: lower end of its 95 % interval; NaN where a task has a single value.
        high: upper end.
    """

    mean: float
    iqm: float
    low: float
    high: float


def iqm(values: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    """Return the interquartile mean along an axis."""
    trimmed: NDArray[np.float64] = np.asarray(stats.trim_mean(values, TRIMMED, axis=axis))
    return trimmed


def middle(values: Sequence[float]) -> float:
    """Return the interquartile mean of some values."""
    return float(iqm(np.asarray(values, np.float64)))


def spread(samples: Samples, seed: int = 0, resamples: int = RESAMPLES) -> Spread:
    """Return mean and interquartile mean of all values, with a bootstrap stratified by task.

    Args:
        samples: one per task, none of them empty.
        seed: of the resampling.
        resamples: how many.

    Source: scipy's percentile bootstrap of independent samples; every task is resampled for itself.
    """
    strata = [np.asarray(sample, np.float64) for sample in samples]
    joined = np.concatenate(strata)
    low, high = _interval(strata, seed, resamples)
    return Spread(float(joined.mean()), float(iqm(joined)), low, high)


def _interval(strata: list[NDArray[np.float64]], seed: int, resamples: int) -> tuple[float, float]:
    if min(len(sample) for sample in strata) < 2:
        return float("nan"), float("nan")

    def statistic(*resampled: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
        return iqm(np.concatenate(resampled, axis=axis), axis)

    found = stats.bootstrap(
        tuple(strata),
        statistic,
        paired=False,
        vectorized=True,
        method="percentile",
        n_resamples=resamples,
        confidence_level=CONFIDENCE,
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return float(found.low), float(found.high)


def improvement(ours: Mapping[str, Sequence[float]], theirs: Mapping[str, Sequence[float]]) -> float | None:
    """Return the probability that a run of ours is better than one of theirs, ties half, mean over common tasks.

    Args:
        ours: values of the seeds by task.
        theirs: the same of another method.

    Returns:
        The mean over tasks of the Mann-Whitney U statistic over the number of pairs; None without a common task.
    """
    tasks = [task for task in ours if task in theirs]
    shares = [_better(ours[task], theirs[task]) for task in tasks]
    return sum(shares) / len(shares) if shares else None


def _better(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Return the Mann-Whitney U statistic over the number of pairs."""
    mine, others = np.asarray(ours)[:, None], np.asarray(theirs)[None, :]
    return float(((mine > others) + 0.5 * (mine == others)).mean())


def steps_until(points: Sequence[tuple[int, float]], rate: float) -> float:
    """Return the control steps of the first evaluation that reaches a rate; infinity where none does."""
    return next((float(steps) for steps, success in points if success >= rate), inf)


def median_steps(reached: Sequence[float]) -> float:
    """Return the median over seeds, where "not reached" counts as infinity."""
    return float(median(reached))


def value_at(points: Sequence[tuple[int, float]], steps: float) -> float:
    """Return the last value at or before some control steps; 0 before the first. Points come in order."""
    return next((success for at, success in reversed(points) if at <= steps), 0.0)
