"""Looking on while a program runs: at every new state, and with a say in how long it goes on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.dsl.machine import Machine
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import World


@dataclass(frozen=True)
class Arrivals:
    """Rows of a running program that have come to new states, after it has decided what acts in them.

    Args:
        rows: (R,).
        episodes: (R,) ranks of their seeds.
        steps: (R,) control steps since their episodes began.
        states: (R, F).
        world: what they run in.
        machine: the program in all rows of the world.
    """

    rows: IntArray
    episodes: IntArray
    steps: IntArray
    states: FloatArray
    world: World
    machine: Machine


class Observer:
    """Looks on while a program runs, and may end episodes; as it stands it sees everything and does nothing."""

    def see(self, arrivals: Arrivals) -> BoolArray:
        """Look at new states; returns which rows (R,) are to end there. Called once for every state of an episode."""
        return np.zeros(len(arrivals.rows), dtype=np.bool_)

    def wants_episodes(self) -> bool:
        """Tell whether further episodes are to begin."""
        return True

    def allows(self, steps: int) -> bool:
        """Tell whether so many more control steps may be taken; where not, what has not ended is left out."""
        return True
