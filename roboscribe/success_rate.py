"""How sure a success rate is that was measured in a few episodes."""

from __future__ import annotations

from math import sqrt

Z95 = 1.959963984540054
"""Standard normal quantile of a two-sided 95 % interval."""


def wilson(successes: float, episodes: int, z: float = Z95) -> tuple[float, float]:
    """Return the Wilson score interval of a success rate; (0, 1) without episodes."""
    if episodes == 0:
        return 0.0, 1.0
    rate, share = successes / episodes, z * z / episodes
    centre = (rate + share / 2) / (1 + share)
    half = z * sqrt(rate * (1 - rate) / episodes + share / (4 * episodes)) / (1 + share)
    return max(0.0, centre - half), min(1.0, centre + half)
