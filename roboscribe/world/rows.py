"""Records of arrays that belong together row by row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from roboscribe.world.layout import BoolArray, IntArray


class Rows:
    """Base of frozen dataclasses whose fields are arrays of one length: row i of each is about the same thing."""

    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]  # a dataclass

    def __len__(self) -> int:
        """Count the rows."""
        return len(next(iter(self._arrays().values())))

    def take(self, rows: IntArray | BoolArray) -> Self:
        """Return the rows at some ranks, or those where a mask is true."""
        return type(self)(**{name: array[rows] for name, array in self._arrays().items()})

    @classmethod
    def concatenated(cls, parts: Sequence[Self]) -> Self:
        """Put the rows of several records, at least one, behind each other."""
        arrays = [part._arrays() for part in parts]
        return cls(**{name: np.concatenate([each[name] for each in arrays]) for name in arrays[0]})
