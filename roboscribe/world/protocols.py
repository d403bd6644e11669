"""The EFMDP as the learner sees it: `Task` says what is asked, `World` runs B copies of it at once."""

from __future__ import annotations

from typing import Protocol

from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import Trajectory


class World(Protocol):
    """B independent copies of one task. Rows never influence each other."""

    batch: int
    """B."""
    control_steps: int
    """Control steps simulated so far, summed over rows."""

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes: row `rows[i]` gets the initial state that `seeds[i]` alone decides. Returns (R, F)."""

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, A), clipped to [-1, 1], for one control step; other rows stand still. Returns (R, F)."""

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` (R,) left physics (not finite); they keep their last finite state until reset or load."""

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S) with everything that decides the future of a row, goals included, bit for bit."""

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S), of any row or world of the same task. Returns (R, F)."""


class Task(Protocol):
    """What is asked of the robot. `solved` is the black box ψ_R: the learner may query it, never read it."""

    @property
    def name(self) -> str:
        """What the task is called."""

    @property
    def layout(self) -> Layout:
        """Objects and the columns of a state."""

    @property
    def action_size(self) -> int:
        """A."""

    @property
    def horizon(self) -> int:
        """Control steps of an episode."""

    @property
    def frequency(self) -> float:
        """Control steps per second."""

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R on states of shape (..., F); returns (...)."""

    def world(self, batch: int) -> World:
        """Build a world of `batch` rows; every row must be reset or loaded before it is stepped."""

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect successful noisy scripted demonstrations (actions and snapshots included); reproducible by seed."""
