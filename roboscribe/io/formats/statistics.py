"""Statistics of a feature, episode by episode and over all episodes, as LeRobot stores them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from roboscribe.io.atomic import Json
from roboscribe.world.layout import FloatArray

_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


@dataclass
class Statistics:
    """Statistics of one feature; those of numbers that an episode does not give (NaN) are 0.

    Over several episodes a quantile is the mean of theirs, weighted by frames: an exact one needs all frames at once.
    """

    _episodes: list[dict[str, FloatArray]] = field(default_factory=list)

    def add(self, values: FloatArray) -> dict[str, Json]:
        """Take in an episode (n, w) and return its statistics."""
        given = np.where(np.isfinite(values).all(axis=0), values, 0.0)
        quantiles = np.quantile(given, list(_QUANTILES.values()), axis=0)
        found = {
            "min": given.min(axis=0), "max": given.max(axis=0), "mean": given.mean(axis=0), "std": given.std(axis=0),
            "count": np.array([len(values)]),
            **dict(zip(_QUANTILES, quantiles, strict=True)),
        }  # fmt: skip
        self._episodes.append(found)
        return {name: value.tolist() for name, value in found.items()}

    def summary(self) -> dict[str, Json]:
        """Return the statistics of all episodes."""
        stacked = {name: np.stack([episode[name] for episode in self._episodes]) for name in self._episodes[0]}
        weights = stacked["count"] / stacked["count"].sum()
        mean = (weights * stacked["mean"]).sum(axis=0)
        variance = (weights * (stacked["std"] ** 2 + (stacked["mean"] - mean) ** 2)).sum(axis=0)
        whole = {
            "min": stacked["min"].min(axis=0), "max": stacked["max"].max(axis=0),
            "mean": mean, "std": np.sqrt(variance),
            "count": stacked["count"].sum(axis=0),
            **{name: (weights * stacked[name]).sum(axis=0) for name in _QUANTILES},
        }  # fmt: skip
        return {name: value.tolist() for name, value in whole.items()}
