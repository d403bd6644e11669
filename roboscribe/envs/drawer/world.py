"""B copies of PlaceCubesDrawer on the batched engine, driven by operational-space control."""

from __future__ import annotations

import numpy as np

from roboscribe.envs.actions import checked
from roboscribe.envs.arm.osc import rotate, torques, turn_error
from roboscribe.envs.drawer import geometry
from roboscribe.envs.drawer.model import TIMINGS, Places, chain, drawer_model, start
from roboscribe.envs.engine import Engine
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import World

DOWN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""Axes of the hand that points straight down with its fingers along x."""
MOST_TURN = 0.5
"""Greatest rotation that is asked for in one control step, rad."""
GRIP_SPEED = 0.2
"""Share of half the fingers' range by which their target moves in a control step."""


def servo(rotation: FloatArray, wanted: FloatArray = DOWN) -> FloatArray:
    """Return the rotation input (..., 3) in [-1, 1] that turns the hand's axes (..., 3, 3) to where they shall be.

    robosuite's goals are relative to the present pose: commanded to keep it, the hand would turn away little by little.
    """
    return np.clip(turn_error(wanted, rotation) / MOST_TURN, -1.0, 1.0)


def _picked(states: FloatArray, columns: IntArray) -> FloatArray:
    """Take columns out of states (R, ...), row after row in memory.

    NumPy's own indexing orders memory by column, and products of matrices then differ in the last bit with R.
    """
    return np.take(states, columns, axis=1)


class DrawerWorld(World):
    """B rows of the scene with goals.

    Args:
        cubes: how many.
        closed: whether the drawer has to be shut at the end, which is its goal then.
        timing: "faithful" or "fast".
        batch: B.
        threads: simulation threads.
    """

    def __init__(self, cubes: int, closed: bool, timing: str, batch: int, threads: int = 2) -> None:
        """Build the engine; no row holds a state yet."""
        model = drawer_model(cubes, timing)
        self.batch = batch
        self.control_steps = 0
        self.timing = TIMINGS[timing]
        self.engine = Engine(model, batch, self.timing.substeps, threads)
        self._cubes = cubes
        self._places = Places(model, cubes)
        self._chain = chain(model)
        self._start = start(model, self._places)
        self._rest = np.array(geometry.START_JOINTS)
        self._closed = closed
        self._slots = np.full((batch, cubes, 3), np.nan)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes: row `rows[i]` gets the initial state that `seeds[i]` alone decides. Returns (R, F)."""
        states = np.repeat(self._start[None], len(rows), axis=0)
        for i, (row, seed) in enumerate(zip(rows, seeds, strict=True)):
            episode = geometry.draw(np.random.default_rng(int(seed)), self._cubes)
            states[i, self._places.cabinet], states[i, self._places.extension] = episode.cabinet, episode.ajar
            states[i, self._places.cubes[:, :2]] = episode.places
            self._slots[row] = episode.goals
        self.engine.put(rows, states, np.zeros((len(rows), self.engine.sensors.shape[1])))
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, 4), clipped to [-1, 1], for one control step. Returns (R, F).

        Three numbers displace the hand, in units of `geometry.REACH`; the sign of the fourth opens (+) or closes (−)
        the fingers a little.

        Raises:
            ValueError: an action is not finite, or a row was never reset.
        """
        actions = checked(rows, actions)
        self.control_steps += int((~self.engine.failed[rows]).sum())
        states = self.engine.states[rows]
        pose = self._chain.pose(_picked(states, self._places.arm))
        turn = rotate(servo(pose.rotation) * MOST_TURN)
        goal = (pose.hand + geometry.REACH * actions[:, :3], turn @ pose.rotation)
        motors = np.empty((len(rows), len(self._places.controls)))
        control = np.concatenate([motors, states[:, self._places.placed]], axis=1)
        control[:, self._places.grippers] = self._grip(states, actions[:, 3])
        for _ in range(self.timing.evaluations):
            states = self.engine.states[rows]
            control[:, self._places.motors] = self._drive(states, goal)
            self.engine.step(rows, control)
        return self.observe(rows)

    def _grip(self, states: FloatArray, command: FloatArray) -> FloatArray:
        """Return targets (R, 2) of the fingers' joints, one finger the mirror image of the other."""
        places = self._places
        closed = (states[:, places.grip_column] - places.grip_middle[0]) / places.grip_half
        closed = np.clip(closed - GRIP_SPEED * np.sign(command), -1.0, 1.0)
        return np.asarray(places.grip_middle + places.grip_half * closed[:, None] * np.array([1.0, -1.0]))

    def _drive(self, states: FloatArray, goal: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Return the motors' torques (R, 7) in integration states (R, ...) towards a pose of the hand."""
        angles, speeds = _picked(states, self._places.arm), _picked(states, self._places.arm_speed)
        limit = self._places.torque_limit
        return np.clip(torques(self._chain, angles, speeds, goal, self._rest), -limit, limit)

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""
        states, places = self.engine.states[rows], self._places
        pose = self._chain.pose(_picked(states, places.arm))
        speed = (pose.jacobian @ _picked(states, places.arm_speed)[..., None])[:, :3, 0]
        opening = geometry.PADS + states[:, places.left] - states[:, places.right]
        extension = states[:, places.extension]
        drawer = geometry.drawer_columns(states[:, places.cabinet], extension, 0.0 if self._closed else geometry.TRAVEL)
        goals = geometry.cube_goals(self._slots[rows], extension, self._closed)
        cubes = np.concatenate([states[:, places.cubes[:, :3]], goals], axis=2)
        parts = [pose.hand, opening[:, None], speed, drawer]
        return np.concatenate([*parts, cubes.reshape(len(rows), -1)], axis=1)

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        failed: BoolArray = self.engine.failed[rows]
        return failed

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S): integration state and slots."""
        return np.concatenate([self.engine.save(rows), self._slots[rows].reshape(len(rows), -1)], axis=1)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S). Returns (R, F).

        Raises:
            TaskError: the snapshots are of another scene.
        """
        split = self.engine.snapshot_size
        width = split + self._slots[0].size
        if snapshots.shape != (len(rows), width):
            msg = f"snapshots of shape {snapshots.shape}: expected {(len(rows), width)} for {self._cubes} cubes"
            raise TaskError(msg)
        self.engine.load(rows, snapshots[:, :split])
        self._slots[rows] = snapshots[:, split:].reshape(len(rows), -1, 3)
        return self.observe(rows)
