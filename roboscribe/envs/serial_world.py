"""A world of simulators that know one robot each: whatever a user has needs no batches of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import World


class Simulator(Protocol):
    """One robot in one episode. States are rows of numbers in the order of the task's layout."""

    def reset(self, seed: int) -> FloatArray:
        """Start the episode that `seed` alone decides. Returns its first state (F,)."""

    def step(self, action: FloatArray) -> FloatArray:
        """Apply an action (A,) in [-1, 1] for one control step. Returns the next state (F,); not finite: it failed."""

    def save(self) -> FloatArray:
        """Return everything that decides the future, (S,)."""

    def load(self, snapshot: FloatArray) -> FloatArray:
        """Go back to what `save` gave, in this simulator or another one. Returns the state (F,)."""


class SerialWorld(World):
    """B simulators one after the other; a row's simulator is made when the row is first used.

    Args:
        make: makes a simulator.
        batch: B.
    """

    def __init__(self, make: Callable[[], Simulator], batch: int) -> None:
        """Remember what makes simulators; none exists yet."""
        self.batch = batch
        self.control_steps = 0
        self._make = make
        self._rows: dict[int, Simulator] = {}
        self._states: dict[int, FloatArray] = {}
        self._failed: set[int] = set()

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes. Returns (R, F)."""
        for row, seed in zip(rows.tolist(), seeds.tolist(), strict=True):
            self._keep(row, self._simulator(row).reset(seed))
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply actions (R, A), clipped to [-1, 1]; a row that fails goes back to where it was. Returns (R, F).

        Raises:
            ValueError: an action is not finite, or a row was never reset.
        """
        if not np.isfinite(actions).all():
            msg = f"actions are not finite: {actions[~np.isfinite(actions).all(axis=1)][0].tolist()}"
            raise ValueError(msg)
        self.observe(rows)
        for row, action in zip(rows.tolist(), np.clip(actions, -1.0, 1.0), strict=True):
            if row not in self._failed:
                self._step(row, action)
        return self.observe(rows)

    def _step(self, row: int, action: FloatArray) -> None:
        simulator = self._rows[row]
        before = simulator.save()
        state = np.asarray(simulator.step(action), dtype=np.float64)
        self.control_steps += 1
        if np.isfinite(state).all():
            self._states[row] = state.copy()
        else:
            simulator.load(before)
            self._failed.add(row)

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F).

        Raises:
            ValueError: a row was never reset or loaded.
        """
        fresh = [row for row in rows.tolist() if row not in self._states]
        if fresh:
            msg = f"row {fresh[0]} was never reset or loaded: reset it before use"
            raise ValueError(msg)
        return np.array([self._states[row] for row in rows.tolist()])

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` failed since they were reset or loaded."""
        return np.array([row in self._failed for row in rows.tolist()], dtype=np.bool_)

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S)."""
        self.observe(rows)
        return np.array([self._rows[row].save() for row in rows.tolist()])

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S). Returns (R, F)."""
        for row, snapshot in zip(rows.tolist(), snapshots, strict=True):
            self._keep(row, self._simulator(row).load(snapshot))
        return self.observe(rows)

    def _simulator(self, row: int) -> Simulator:
        if row not in self._rows:
            self._rows[row] = self._make()
        return self._rows[row]

    def _keep(self, row: int, state: FloatArray) -> None:
        self._states[row] = np.array(state, dtype=np.float64)
        self._failed.discard(row)
