"""The last few observed states of every row: single observations are noisy."""

from __future__ import annotations

import numpy as np

from roboscribe.world.layout import FloatArray, IntArray


class Recent:
    """The last `count` states that each of `batch` rows observed.

    Args:
        batch: B, count of rows.
        count: how many states are kept.
        size: F, columns of a state.
    """

    def __init__(self, batch: int, count: int, size: int) -> None:
        """Begin with nothing seen."""
        self._kept = np.zeros((batch, count, size))
        self._seen = np.zeros(batch, dtype=np.int64)

    def forget(self, rows: IntArray) -> None:
        """Begin episodes in some rows (R,)."""
        self._seen[rows] = 0

    def see(self, rows: IntArray, states: FloatArray) -> None:
        """Note the states (R, F) that rows (R,) observe."""
        fresh = self._seen[rows] == 0
        self._kept[rows[fresh]] = states[fresh, None]
        self._kept[rows, self._seen[rows] % self._kept.shape[1]] = states
        self._seen[rows] += 1

    def mean(self, rows: IntArray) -> FloatArray:
        """Return the mean (R, F) of what rows (R,) saw last; at an episode's start its first state stands for more."""
        mean: FloatArray = self._kept[rows].mean(axis=1)
        return mean
