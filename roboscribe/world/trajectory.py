"""One episode: states, actions, and what is needed to put a simulator back into any of its states."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout

NEVER = np.iinfo(np.int64).max
"""First step of what never holds."""
AGREEMENT = 0.95
"""Share of the demonstrations that must agree: the paper's are perfect, real ones nearly so."""


@dataclass(frozen=True)
class Trajectory:
    """A trajectory of an EFMDP.

    Args:
        layout: meaning of a state's columns.
        states: (T + 1, F), SI units.
        actions: (T, A) in [-1, 1]; None for states-only demonstrations.
        snapshots: (T + 1, S) full simulator states as `World.save` gives them; None when not stored.
        origin: what the simulator calls entity i is `origin[i]`; empty where the names agree.
    """

    layout: Layout
    states: FloatArray
    actions: FloatArray | None = None
    snapshots: FloatArray | None = None
    origin: tuple[int, ...] = ()

    def __len__(self) -> int:
        """T + 1, the count of states."""
        return len(self.states)

    def renamed(self, order: tuple[int, ...]) -> Trajectory:
        """Return the same episode with entity `order[i]` called `i`; snapshots keep the simulator's names."""
        origin = tuple(self.simulated(entity) for entity in order)
        return replace(self, states=self.layout.permute(self.states, order), origin=origin)

    def simulated(self, entity: int) -> int:
        """Return what the simulator calls an entity."""
        return self.origin[entity] if self.origin else entity


def first_true(truth: BoolArray, starts: IntArray) -> IntArray:
    """First true frame of each part of `truth` (S,), counted from where it starts, (C,); NEVER where there is none."""
    ends = np.append(starts[1:], len(truth))
    where = np.flatnonzero(truth)
    step = np.append(where, len(truth))[np.searchsorted(where, starts)]
    return np.where(step < ends, step - starts, NEVER).astype(np.int64)


def last_false(truth: BoolArray, starts: IntArray) -> IntArray:
    """Last false frame of each part of `truth` (S,), counted from where it starts, (C,); -1 where there is none."""
    undone, ends = np.flatnonzero(~truth), np.append(starts[1:], len(truth))
    last = np.append(-1, undone)[np.searchsorted(undone, ends)]
    return np.where(last >= starts, last - starts, -1).astype(np.int64)


def restored(truth: BoolArray, starts: IntArray) -> IntArray:
    """As `first_true`, but what holds at first, is undone and holds in the end counts from where it holds again."""
    first, last, lengths = first_true(truth, starts), last_false(truth, starts), np.diff(np.append(starts, len(truth)))
    return np.where((first == 0) & (last >= 0) & (last < lengths - 1), last + 1, first).astype(np.int64)
