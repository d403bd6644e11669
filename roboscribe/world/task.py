"""The EFMDP as the learner sees it: `Task` says what is asked, `World` runs B copies of it at once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.states import state_of
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


@runtime_checkable
class Judge(Protocol):
    """A world that knows better than the states that it shows, which have errors."""

    def solved(self, rows: IntArray) -> BoolArray:
        """ψ_R of what is in `rows` (R,), whatever is seen."""


class Painter(Protocol):
    """Draws one task, state by state."""

    def __call__(self, state: FloatArray, snapshot: FloatArray) -> NDArray[np.uint8]:
        """Draw a state (F,) and the snapshot (S,) that belongs to it: RGB (height, width, 3)."""

    def close(self) -> None:
        """Give back what a graphics library holds."""


class Task(ABC):
    """What is asked of the robot; the base class of every task.

    A task declares its objects, runs, and knows when it is solved. `solved` is the black box ψ_R: the learner may query
    it, never read it. A demonstrator and a picture are its own affair: without the first, demonstrations come from
    files; without the second, positions are drawn.

    Attributes:
        name: by which `make_task` finds it.
        action_size: A.
        horizon: control steps of an episode.
        frequency: control steps per second.
    """

    name: str
    action_size: int
    horizon: int
    frequency: float
    most_rows: ClassVar[int] = 125
    """Rows of a world beyond which running more at once gains nothing."""

    @property
    def light(self) -> Task:
        """The same task in a lighter simulator, to learn in: same states, about the same motions; else itself."""
        return self

    def lasting(self, horizon: int) -> Self:
        """Return the same task with episodes of so many control steps."""
        if horizon == self.horizon:
            return self
        other = copy(self)
        object.__setattr__(other, "horizon", horizon)  # tasks are mostly frozen
        return other

    @property
    @abstractmethod
    def layout(self) -> Layout:
        """Objects and the columns of a state."""

    @abstractmethod
    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R on states of shape (..., F); returns (...)."""

    @abstractmethod
    def world(self, batch: int) -> World:
        """Build a world of `batch` rows; every row must be reset or loaded before it is stepped."""

    def read(self, observation: Any) -> FloatArray:  # noqa: ANN401 - whatever a robot or an environment gives
        """Turn what a robot or an environment observes into a state (F,), when a program drives it.

        A task whose environment observes something else overrides this.

        Args:
            observation: a state, or its columns by name ("mu.position", "b1.position", "g(b1).position").

        Raises:
            TaskError: a column is missing, or numbers are.
        """
        try:
            named = isinstance(observation, Mapping)
            state = state_of(self.layout, observation) if named else np.asarray(observation, dtype=np.float64)
        except (TypeError, ValueError) as error:
            msg = f"observation of {self.name}: {error}"
            raise TaskError(msg) from error
        if state.shape != (self.layout.size,):
            msg = f"observation of {self.name}: found shape {state.shape}, expected ({self.layout.size},)"
            raise TaskError(msg)
        return state

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect successful noisy scripted demonstrations (actions and snapshots included); reproducible by seed.

        Raises:
            TaskError: the task brings no demonstrator.
        """
        del episodes, seed
        msg = f"task {self.name} brings no demonstrator: give demonstrations in a file (--demos FILE)"
        raise TaskError(msg)

    def painter(self, width: int, height: int) -> Painter | None:
        """Return what draws the task in pictures of that size; None: positions are drawn schematically."""
        del width, height
        return None
