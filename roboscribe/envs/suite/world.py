"""B copies of an environment of robosuite; each row is a snapshot, which any process can go on from."""

from __future__ import annotations

import numpy as np

from roboscribe.envs.suite import workers
from roboscribe.envs.suite.bench import bench, check_size
from roboscribe.envs.suite.request import SuiteRequest
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import World


class SuiteWorld(World):
    """B rows of one environment.

    Args:
        request: which environment.
        batch: B.
        processes: how many serve the rows; None for what the machine has.
    """

    def __init__(self, request: SuiteRequest, batch: int, processes: int | None = None) -> None:
        """Start processes; no row holds a state yet."""
        self.batch = batch
        self.control_steps = 0
        self._request = request
        self._workers = workers.workers(request, processes or workers.process_count(batch))
        one = bench(request)
        self._snapshots = np.full((batch, one.snapshot_size), np.nan)
        self._states = np.full((batch, one.layout.size), np.nan)
        self._failed = np.zeros(batch, dtype=np.bool_)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes: row `rows[i]` gets the initial state that `seeds[i]` alone decides. Returns (R, F)."""
        self._put(rows, self._workers.do(workers.reset, np.asarray(seeds)))
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, A), clipped to [-1, 1]. Returns (R, F).

        Raises:
            ValueError: an action is not finite, or a row was never reset.
        """
        rows = np.asarray(rows)
        if not np.isfinite(actions).all():
            bad = ~np.isfinite(actions).all(axis=1)
            msg = f"actions of rows {rows[bad].tolist()} are not finite: {actions[bad][0].tolist()}"
            raise ValueError(msg)
        if np.isnan(self._snapshots[rows, 0]).any():
            unset = rows[np.isnan(self._snapshots[rows, 0])].tolist()
            msg = f"rows {unset} were never reset or loaded: reset them before stepping"
            raise ValueError(msg)
        running = ~self._failed[rows]
        if running.any():
            going, commands = rows[running], np.clip(actions[running], -1.0, 1.0)
            after, states, good = self._workers.do(workers.step, self._snapshots[going], commands)
            self._failed[going[~good]] = True
            self._put(going[good], (after[good], states[good], good[good]))
            self.control_steps += len(going)
        return self.observe(rows)

    def _put(self, rows: IntArray, moved: workers.Moved) -> None:
        """Remember where rows are."""
        self._snapshots[rows], self._states[rows], good = moved
        self._failed[rows] = ~good

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""
        return np.asarray(self._states[rows])

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        return np.asarray(self._failed[rows])

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S)."""
        return np.asarray(self._snapshots[rows])

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S). Returns (R, F).

        Raises:
            TaskError: the snapshots are of another environment.
        """
        check_size(snapshots.shape[1], self._snapshots.shape[1], self._request.environment)
        self._put(rows, self._workers.do(workers.load, np.asarray(snapshots)))
        return self.observe(rows)
