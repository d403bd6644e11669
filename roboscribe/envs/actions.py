"""What every simulated robot does with the actions that it is given."""

from __future__ import annotations

import numpy as np

from roboscribe.world.layout import FloatArray, IntArray


def checked(rows: IntArray, actions: FloatArray) -> FloatArray:
    """Clip actions (R, A) to [-1, 1].

    Raises:
        ValueError: an action is not finite.
    """
    bad = ~np.isfinite(actions).all(axis=1)
    if bad.any():
        msg = f"actions of rows {np.asarray(rows)[bad].tolist()} are not finite: {actions[bad][0].tolist()}"
        raise ValueError(msg)
    return np.clip(actions, -1.0, 1.0)
