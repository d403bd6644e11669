"""Start states of a skill: simulator states in which its predecessor has just been reached by the program."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from roboscribe.rl.config import PoolConfig
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.rows import Rows


@dataclass(frozen=True)
class StartPool(Rows):
    """P snapshots a skill may start from.

    Args:
        snapshots: (P, S) as `World.save` gives them.
        states: (P, F) what is observed there.
        entities: (P, n) bound to the controller's variables.
        elapsed: (P,) control steps of the episode already spent.
        episode: (P,) rank of the episode each came from, ascending.
    """

    snapshots: FloatArray
    states: FloatArray
    entities: IntArray
    elapsed: IntArray
    episode: IntArray

    def capped(self, tries: int) -> StartPool:
        """Keep the first `tries` starts with the same entities of each episode, lest failing again fills the pool."""
        seen: Counter[tuple[int, ...]] = Counter()
        kept = []
        for row, key in enumerate(zip(self.episode.tolist(), *self.entities.T.tolist(), strict=True)):
            seen[key] += 1
            if seen[key] <= tries:
                kept.append(row)
        return self.take(np.array(kept, np.int64))

    def oversample_hard(self, hard: BoolArray, most: int = PoolConfig.repeats) -> StartPool:
        """Repeat the starts that are `hard` (P,) until they are half of all, each `most` times at most."""
        rows, times = np.flatnonzero(hard), max(1, len(hard) // max(1, int(hard.sum())) - 1)
        return self.take(np.sort(np.concatenate([np.flatnonzero(~hard), np.repeat(rows, min(times, most))])))
