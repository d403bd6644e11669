"""States by the names of their columns: "mu.position", "b1.position", "g(b1).position"."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from roboscribe.world.layout import ROBOT, FloatArray, Layout


def column_places(layout: Layout) -> dict[str, slice]:
    """Return where each named column lies in a state, in storage order."""
    owners = {ROBOT: "mu", **dict(enumerate(layout.names))}
    return {
        f"g({owners[index]}).{name}" if goal else f"{owners[index]}.{name}": place
        for (index, name, goal), place in layout.columns.items()
    }


def state_of(layout: Layout, values: Mapping[str, ArrayLike]) -> FloatArray:
    """Put named columns together.

    Args:
        layout: says which columns there are.
        values: every column by name, (..., w), or (...) where it is a single number; leading axes agree.

    Returns:
        (..., F).

    Raises:
        ValueError: a column is missing, unknown, or of another width.
    """
    places = column_places(layout)
    if set(values) != set(places):
        missing = ", ".join(name for name in places if name not in values) or "none"
        unknown = ", ".join(name for name in values if name not in places) or "none"
        msg = f"missing column {missing}, unknown column {unknown}; expected {', '.join(places)}"
        raise ValueError(msg)
    parts = [_part(name, values[name], place.stop - place.start) for name, place in places.items()]
    leading = {part.shape[:-1] for part in parts}
    if len(leading) > 1:
        msg = f"columns disagree about how many states there are: {sorted(leading)}"
        raise ValueError(msg)
    return np.concatenate(parts, axis=-1)


def _part(name: str, value: ArrayLike, width: int) -> FloatArray:
    """Return one column with its width as the last axis."""
    part = np.asarray(value, dtype=np.float64)
    if width == 1 and part.shape[-1:] != (1,):
        part = part[..., None]
    if part.shape[-1:] != (width,):
        msg = f"column {name}: found shape {part.shape}, expected {width} numbers along the last axis"
        raise ValueError(msg)
    return part
