"""B copies of one MuJoCo model, stepped together by a pool of threads.

A row is a vector `mjSTATE_INTEGRATION` (time, positions, velocities, warm start, controls, mocap poses, ...) and the
sensor values of its last substep. Between control steps the solver's warm start is defined to be zero: MuJoCo's
rollout does not hand it out, and a fixed value keeps the vector complete, so that a saved row continues bit for bit
in any row of any batch, and in plain `mj_setState` and `mj_step` too.
"""

from __future__ import annotations

import logging
import os
from typing import TypeAlias

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from roboscribe.world.layout import BoolArray, FloatArray, IntArray

State: TypeAlias = mujoco.mjtState
INTEGRATION = int(State.mjSTATE_INTEGRATION)
PHYSICS = int(State.mjSTATE_FULLPHYSICS)
WARMSTART = int(State.mjSTATE_WARMSTART)
CONTROL = int(State.mjSTATE_CTRL) | int(State.mjSTATE_MOCAP_POS) | int(State.mjSTATE_MOCAP_QUAT)

log = logging.getLogger(__name__)
# Without a handler MuJoCo appends its warnings to a file in the working directory. Rows report them as failures.
mujoco.set_mju_user_warning(log.debug)


def columns(model: mujoco.MjModel, part: int) -> IntArray:
    """Return where the components `part` (bits of mjtState) lie in an integration state vector."""
    size = mujoco.mj_stateSize(model, INTEGRATION)
    found = np.empty(mujoco.mj_stateSize(model, part))
    mujoco.mj_extractState(model, np.arange(size, dtype=np.float64), INTEGRATION, found, part)
    return found.astype(np.int64)


def integration_state(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """Read the integration state vector of `data`."""
    state = np.empty(mujoco.mj_stateSize(model, INTEGRATION))
    mujoco.mj_getState(model, data, state, INTEGRATION)
    return state


def thread_count(wanted: int = 2) -> int:
    """Bound the number of simulation threads by the processors of this machine."""
    return max(1, min(wanted, os.cpu_count() or 1))


class Engine:
    """Rows of one model that step, are saved and are restored independently of each other.

    Args:
        model: the compiled model all rows share.
        batch: B, the number of rows.
        substeps: physics steps per control step.
        threads: size of the pool, bounded by the processors.
    """

    def __init__(self, model: mujoco.MjModel, batch: int, substeps: int, threads: int = 2) -> None:
        """Make room for B rows and start the threads; no row holds a state yet."""
        self.model = model
        self.batch = batch
        self.substeps = substeps
        self.interval = substeps * float(model.opt.timestep)
        self.states = np.full((batch, mujoco.mj_stateSize(model, INTEGRATION)), np.nan)
        self.sensors = np.full((batch, model.nsensordata), np.nan)
        self.failed = np.zeros(batch, dtype=np.bool_)
        self._physics = columns(model, PHYSICS)
        self._control = columns(model, CONTROL)
        self._warm = columns(model, WARMSTART)
        threads = min(thread_count(threads), batch)
        self._data = [mujoco.MjData(model) for _ in range(threads)]
        self._models = [model] * batch
        self._rollout = Rollout(nthread=threads)
        self._after = np.empty((batch, substeps, len(self._physics)))
        self._sensed = np.empty((batch, substeps, model.nsensordata))

    @property
    def snapshot_size(self) -> int:
        """Count of numbers that `save` returns for a row."""
        return int(self.states.shape[1] + self.sensors.shape[1])

    def step(self, rows: IntArray, control: FloatArray) -> None:
        """Hold `control` for one control step in `rows`; a row that leaves physics fails and stays where it was.

        Args:
            rows: (R,) distinct rows; those that failed before stand still.
            control: (R, nu + 7 nmocap) actuator commands, mocap positions, mocap quaternions.

        Raises:
            ValueError: a row was never set.
        """
        if np.isnan(self.states[rows, 0]).any():
            unset = rows[np.isnan(self.states[rows, 0])].tolist()
            msg = f"rows {unset} were never reset or loaded: reset them before stepping"
            raise ValueError(msg)
        running = ~self.failed[rows]
        rows, control = rows[running], control[running]
        if len(rows):
            self._advance(rows, np.ascontiguousarray(control))

    def _advance(self, rows: IntArray, control: FloatArray) -> None:
        """Run the substeps of `rows` and keep the results of those that stayed within physics."""
        count, before = len(rows), self.states[rows]
        after, sensed = self._after[:count], self._sensed[:count]
        self._rollout.rollout(
            self._models[:count],
            self._data,
            np.ascontiguousarray(before[:, self._physics]),
            np.ascontiguousarray(np.broadcast_to(control[:, None], (count, self.substeps, control.shape[1]))),
            control_spec=CONTROL,
            skip_checks=True,
            nstep=self.substeps,
            initial_warmstart=np.ascontiguousarray(before[:, self._warm]),
            state=after,
            sensordata=sensed,
        )
        good = self._stayed(before[:, 0], after[:, -1], sensed[:, -1])
        self.failed[rows[~good]] = True
        kept = rows[good]
        before[:, self._physics], before[:, self._control], before[:, self._warm] = after[:, -1], control, 0.0
        self.states[kept], self.sensors[kept] = before[good], sensed[good, -1]

    def _stayed(self, start: FloatArray, after: FloatArray, sensed: FloatArray) -> BoolArray:
        """Tell which rows ran every substep: MuJoCo resets the clock of a bad state, and a warning ends a rollout."""
        on_time = np.abs(after[:, 0] - start - self.interval) < 0.25 * self.model.opt.timestep
        finite: BoolArray = on_time & np.isfinite(after).all(axis=1) & np.isfinite(sensed).all(axis=1)
        return finite

    def put(self, rows: IntArray, states: FloatArray, sensors: FloatArray) -> None:
        """Put `rows` into integration states (R, ...) with the sensor values (R, ...) that belong to them."""
        self.states[rows], self.sensors[rows] = states, sensors
        self.failed[rows] = False

    def save(self, rows: IntArray) -> FloatArray:
        """Return (R, snapshot_size): integration state and sensor values of `rows`."""
        return np.concatenate([self.states[rows], self.sensors[rows]], axis=1)

    def load(self, rows: IntArray, snapshots: FloatArray) -> None:
        """Put `rows` into what `save` returned, bit for bit."""
        split = self.states.shape[1]
        self.put(rows, snapshots[:, :split], snapshots[:, split:])
