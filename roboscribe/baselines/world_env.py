"""A whole task as an environment of Stable-Baselines3: every row an episode from start to success or horizon."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from roboscribe.rl.checkpoint import Arrays
from roboscribe.rl.vec_env import RowsEnv
from roboscribe.world import Task, World
from roboscribe.world.layout import IntArray

Float32Array = NDArray[np.float32]
SEEDS = 2**31
"""Initial states among which episodes draw."""


class WorldEnv(RowsEnv):
    """B rows of a task. Observations are states; the reward is 1 in the step that solves the task, which ends it."""

    def __init__(self, task: Task, batch: int, rng: np.random.Generator) -> None:
        """Build a world of `batch` rows; `reset` starts it."""
        self.task, self.rng = task, rng
        self.world: World = task.world(batch)
        self.rows: IntArray = np.arange(batch)
        self.steps: IntArray = np.zeros(batch, np.int64)
        self.states = np.zeros((batch, task.layout.size))
        self.actions: Float32Array = np.zeros((batch, task.action_size), np.float32)
        bounds = np.full(task.layout.size, np.inf, np.float32)
        super().__init__(batch, spaces.Box(-bounds, bounds), spaces.Box(-1.0, 1.0, (task.action_size,), np.float32))

    def reset(self) -> Float32Array:
        """Start every row afresh."""
        self._begin(self.rows)
        return self.states.astype(np.float32)

    def _begin(self, rows: IntArray) -> None:
        self.states[rows] = self.world.reset(rows, self.rng.integers(SEEDS, size=len(rows)))
        self.steps[rows] = 0

    def step_async(self, actions: Float32Array) -> None:
        """Keep the actions for `step_wait`."""
        self.actions = actions

    def step_wait(self) -> tuple[Float32Array, Float32Array, NDArray[np.bool_], list[dict[str, object]]]:
        """Apply the kept actions; rows that end begin anew."""
        after = self.world.step(self.rows, self.actions.astype(np.float64)).copy()
        self.states[:] = after
        self.steps += 1
        lost = self.world.diverged(self.rows)
        solved = self.task.solved(after) & ~lost
        late = (self.steps >= self.task.horizon) & ~solved & ~lost
        ended = np.flatnonzero(solved | lost | late)
        notes: list[dict[str, object]] = [{} for _ in self.rows]
        for row in ended:
            final = after[row].astype(np.float32)
            notes[row] = {"terminal_observation": final, "TimeLimit.truncated": bool(late[row])}
        if len(ended):
            self._begin(ended)
        return self.states.astype(np.float32), solved.astype(np.float32), solved | lost | late, notes

    def save(self) -> tuple[Arrays, Mapping[str, object]]:
        """Return all that decides the future: arrays, and the state of the random generator as JSON values."""
        arrays: Arrays = {"snapshots": self.world.save(self.rows), "states": self.states, "steps": self.steps}
        return {name: array.copy() for name, array in arrays.items()}, self.rng.bit_generator.state

    def restore(self, arrays: Arrays, generator: Mapping[str, object]) -> None:
        """Return to what `save` gave."""
        self.world.load(self.rows, np.asarray(arrays["snapshots"], np.float64))
        self.states[:] = arrays["states"]
        self.steps[:] = arrays["steps"]
        self.rng.bit_generator.state = dict(generator)
