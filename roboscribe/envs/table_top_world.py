"""B table-tops at once: where objects start, what is observed, and how far everything is done."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from roboscribe.envs import table_top_scene as scene
from roboscribe.envs.actions import checked
from roboscribe.envs.engine import Engine
from roboscribe.envs.fetch import ROBOT_TYPE, XYZ
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, BoolArray, FloatArray, IntArray, Layout, ObjectType
from roboscribe.world.task import World

PUSHED = np.array([0.0, 0.08, 0.0])
"""Goal of the mug, from its start, m. Success needs less than any of the three goals."""
EXTENDED, TURNED = 0.10, 0.6
"""Goals of the drawer's extension, m, and of the knob's angle, rad."""
PLACES = {
    "mug": ((-0.07, 0.07), (0.54, 0.62)),
    "drawer": ((-0.34, -0.26), (0.75, 0.87)),
    "faucet": ((0.22, 0.30), (0.74, 0.80)),
}
"""Where objects start, in x and y, m. Drawer and mug share no x: an opening drawer would push the mug back."""
POSITION = Attribute("position", XYZ, "m", -1.0, 1.5)
INITIAL = Attribute("initial_position", ("initial_x", "initial_y", "initial_z"), "m", -1.0, 1.5)
EXTENSION = Attribute("extension", ("extension",), "m", -0.02, 0.2)
ANGLE = Attribute("angle", ("angle",), "rad", -2.0, 2.0)


def layout(goals: bool) -> Layout:
    """Describe the state: 23 numbers with goals, 21 without; then the mug's initial position is in their place."""
    mug = ObjectType("mug", (POSITION,), (POSITION,)) if goals else ObjectType("mug", (POSITION, INITIAL))
    drawer = ObjectType("drawer", (POSITION, EXTENSION), (EXTENSION,) if goals else ())
    faucet = ObjectType("faucet", (POSITION, ANGLE), (ANGLE,) if goals else ())
    return Layout(ROBOT_TYPE, (mug, drawer, faucet))


def sample(rng: Generator) -> dict[str, FloatArray]:
    """Draw where the objects start, (2,) each, m."""
    return {name: np.array([rng.uniform(*x), rng.uniform(*y)]) for name, (x, y) in PLACES.items()}


class TableTopWorld(World):
    """B rows of the table-top.

    Args:
        goals: whether states have goals.
        timing: "faithful" or "fast".
        batch: B.
        threads: simulation threads.
    """

    def __init__(self, goals: bool, timing: str, batch: int, threads: int = 2) -> None:
        """Build the engine; no row holds a state yet."""
        model = scene.scene_model(timing)
        self.batch = batch
        self.control_steps = 0
        self.engine = Engine(model, batch, scene.TIMINGS[timing], threads)
        self._goals = goals
        self._places = scene.Places(model)
        self._began = np.full((batch, 3), np.nan)
        """Where the mugs were at the start, m."""

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes: row `rows[i]` gets the initial state that `seeds[i]` alone decides. Returns (R, F)."""
        start, drawn = scene.settled(), [sample(np.random.default_rng(int(seed))) for seed in seeds]
        states, sensors = (np.repeat(values[None], len(rows), axis=0) for values in (start.state, start.sensors))
        scene.lay_out(self._places, states, sensors, {name: np.array([d[name] for d in drawn]) for name in PLACES})
        self.engine.put(rows, states, sensors)
        self._began[rows] = sensors[:, self._places.sites["mug_centre"]]
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, 4), clipped to [-1, 1], for one control step. Returns (R, F).

        Raises:
            ValueError: an action is not finite, or a row was never reset.
        """
        actions = checked(rows, actions)
        self.control_steps += int((~self.engine.failed[rows]).sum())
        states, sensors = self.engine.states[rows], self.engine.sensors[rows]
        self.engine.step(rows, scene.control(self._places, states, sensors, actions))
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""
        states, sensors, began = self.engine.states[rows], self.engine.sensors[rows], self._began[rows]
        mug, bar, grip = (sensors[:, self._places.sites[name]] for name in ("mug_centre", "bar", "grip"))
        extension, angle = -states[:, [self._places.slide]], states[:, [self._places.knob]]
        robot = scene.robot(self._places, states, sensors)
        if not self._goals:
            return np.concatenate([robot, mug, began, bar, extension, grip, angle], axis=1)
        extended, turned = np.full((len(rows), 1), EXTENDED), np.full((len(rows), 1), TURNED)
        return np.concatenate([robot, mug, began + PUSHED, bar, extension, extended, grip, angle, turned], axis=1)

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        failed: BoolArray = self.engine.failed[rows]
        return failed

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S): integration state, sensor values, where the mug began."""
        return np.concatenate([self.engine.save(rows), self._began[rows]], axis=1)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S). Returns (R, F).

        Raises:
            TaskError: the snapshots are of another scene.
        """
        split = self.engine.snapshot_size
        if snapshots.shape != (len(rows), split + 3):
            msg = f"snapshots of shape {snapshots.shape}: expected {(len(rows), split + 3)} for the table-top"
            raise TaskError(msg)
        self.engine.load(rows, snapshots[:, :split])
        self._began[rows] = snapshots[:, split:]
        return self.observe(rows)
