"""One episode: states, actions, and what is needed to put a simulator back into any of its states."""

from __future__ import annotations

from dataclasses import dataclass

from roboscribe.world.layout import FloatArray, Layout


@dataclass(frozen=True)
class Trajectory:
    """A trajectory of an EFMDP.

    Args:
        layout: meaning of a state's columns.
        states: (T + 1, F), SI units.
        actions: (T, A) in [-1, 1]; None for states-only demonstrations.
        snapshots: (T + 1, S) full simulator states as `World.save` gives them; None when not stored.
    """

    layout: Layout
    states: FloatArray
    actions: FloatArray | None = None
    snapshots: FloatArray | None = None

    def __len__(self) -> int:
        """T + 1, the count of states."""
        return len(self.states)

    def renamed(self, order: tuple[int, ...]) -> Trajectory:
        """Return the same episode with entity `order[i]` called `i` (snapshots keep the simulator's indices)."""
        return Trajectory(self.layout, self.layout.permute(self.states, order), self.actions, self.snapshots)
