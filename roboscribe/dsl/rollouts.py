"""What running a program leaves behind: trajectories, and how each episode ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Rollouts:
    """Episodes of one program, in the order of their seeds.

    Args:
        layout: meaning of the states.
        trajectories: one per episode; actions only where they were asked for.
        success: (E,) the task is solved, or, if asked so, the program reached its end.
        diverged: (E,) physics broke; such an episode is a failure.
        bound: entities in the order in which the program first bound them, by episode.
        control_steps: control steps simulated, over all episodes.
        lines: index into `controllers(program)` of what acted at each step, (T,) by episode; -1 for nothing.
        served: entity that the innermost loop was serving at each step, (T,) by episode; NULL outside loops.
        unreached: controller at work when the episode ended, by episode, which never had reached its subgoal for whom
            it served; "" where there was none.
    """

    layout: Layout
    trajectories: tuple[Trajectory, ...]
    success: BoolArray
    diverged: BoolArray
    bound: tuple[tuple[int, ...], ...]
    control_steps: int
    lines: tuple[IntArray, ...]
    served: tuple[IntArray, ...] = ()
    unreached: tuple[str, ...] = ()


@dataclass(frozen=True)
class FinishedEpisode:
    """One finished episode."""

    trajectory: Trajectory
    lines: IntArray
    served: IntArray
    success: bool
    diverged: bool
    bound: tuple[int, ...]
    unreached: str


def gather(layout: Layout, episodes: list[FinishedEpisode]) -> Rollouts:
    """Put finished episodes together."""
    return Rollouts(
        layout=layout,
        trajectories=tuple(each.trajectory for each in episodes),
        success=np.array([each.success for each in episodes], dtype=np.bool_),
        diverged=np.array([each.diverged for each in episodes], dtype=np.bool_),
        bound=tuple(each.bound for each in episodes),
        control_steps=sum(len(each.lines) for each in episodes),
        lines=tuple(each.lines for each in episodes),
        served=tuple(each.served for each in episodes),
        unreached=tuple(each.unreached for each in episodes),
    )


class Recorder:
    """Records what B rows do, and hands out each row's episode when it is over.

    Args:
        layout: meaning of the states.
        batch: B.
        horizon: most control steps of an episode.
        actions: count of numbers in an action if actions are to be kept, else 0.
    """

    def __init__(self, layout: Layout, batch: int, horizon: int, actions: int) -> None:
        """Make room for one episode in each row."""
        self._layout = layout
        self.horizon = horizon
        """Most control steps of an episode."""
        self._states = np.empty((batch, horizon + 1, layout.size))
        self._actions = np.empty((batch, horizon, actions))
        self._lines = np.empty((batch, horizon), dtype=np.int64)
        self._served = np.empty((batch, horizon), dtype=np.int64)
        self.steps: IntArray = np.zeros(batch, dtype=np.int64)
        """Control steps since the start of each row's episode. (B,)"""

    def start(self, rows: IntArray, states: FloatArray) -> None:
        """Begin episodes at their initial states (R, F)."""
        self.steps[rows] = 0
        self._states[rows, 0] = states

    def step(self, rows: IntArray, actions: FloatArray, lines: IntArray, served: IntArray, states: FloatArray) -> None:
        """Append one step: actions (R, A) of the controllers `lines` (R,), and the states (R, F) they led to."""
        now = self.steps[rows]
        if self._actions.shape[-1]:
            self._actions[rows, now] = actions
        self._lines[rows, now] = lines
        self._served[rows, now] = served
        self._states[rows, now + 1] = states
        self.steps[rows] = now + 1

    def cut(self, row: int, success: bool, diverged: bool, bound: list[int], unreached: str) -> FinishedEpisode:
        """Copy a row's episode out."""
        steps = int(self.steps[row])
        actions = self._actions[row, :steps].copy() if self._actions.shape[-1] else None
        trajectory = Trajectory(self._layout, self._states[row, : steps + 1].copy(), actions)
        lines, served = self._lines[row, :steps].copy(), self._served[row, :steps].copy()
        return FinishedEpisode(trajectory, lines, served, success, diverged, tuple(bound), unreached)
