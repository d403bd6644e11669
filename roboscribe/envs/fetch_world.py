"""Tasks at the Fetch robot's table: B scenes at once, success, demonstrations and pictures."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.random import Generator

from roboscribe.envs import fetch, fetch_hand
from roboscribe.envs.actions import checked
from roboscribe.envs.demonstrator import ScriptedTask
from roboscribe.envs.engine import Engine
from roboscribe.envs.scene_painter import Marker, ScenePainter, Viewpoint
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.task import World

TOLERANCE = 0.05
"""An object is at its goal when their centres are closer than this, m."""
VIEWPOINT = Viewpoint((1.33, 0.75, 0.5), 1.35, 145.0, -24.0)
"""Where a camera sees the table."""
GOAL_RADIUS, GOAL_OPACITY = 0.03, 0.45


def at_goals(states: FloatArray) -> BoolArray:
    """Tell whether every object is closer than `TOLERANCE` to its goal; states (..., F), returns (...)."""
    seen = fetch.view(states)
    reached: BoolArray = (np.linalg.norm(seen.blocks - seen.goals, axis=-1) < TOLERANCE).all(axis=-1)
    return reached


@dataclass(frozen=True)
class FetchTask(ScriptedTask):
    """What all tasks at the Fetch robot's table have in common.

    Args:
        name: name in the catalogue.
        blocks: N, the number of objects.
        contact: "stable" or "paper".
        timing: "faithful" (20 x 2 ms) or "fast" (10 x 4 ms).
        horizon: control steps of an episode.
        crowded: objects may start where fingers find no room beside them.
        arm: the whole arm is simulated; without, the hand alone, see `fetch_hand`.
    """

    name: str
    blocks: int = 1
    contact: str = "stable"
    timing: str = "fast"
    horizon: int = 100
    action_size: int = 4
    frequency: float = fetch.FREQUENCY
    crowded: bool = False
    arm: bool = True

    @property
    def light(self) -> FetchTask:
        """The same with the hand alone."""
        return replace(self, arm=False)

    @property
    def scene(self) -> fetch.Scene:
        """What stands on the table."""
        return fetch.Scene.of_blocks(self.blocks)

    @cached_property
    def layout(self) -> Layout:
        """Meaning of a state's columns."""
        return fetch.layout(self.scene)

    @abstractmethod
    def sample(self, rng: Generator, start: fetch.Start) -> tuple[FloatArray, FloatArray]:
        """Draw an episode: the objects' places (N, 2) and their goals (N, 3), m."""

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: every object closer than `TOLERANCE` to its goal; states (..., F), returns (...)."""
        return at_goals(states)

    def world(self, batch: int) -> FetchWorld:
        """Build a world of `batch` rows."""
        return FetchWorld(self, batch)

    def painter(self, width: int, height: int) -> ScenePainter | None:
        """Draw the scene by MuJoCo, with the goals as translucent spheres; None without OpenGL."""
        return ScenePainter.opened(picture(self.scene), VIEWPOINT, goal_markers, (width, height))


def picture(scene: fetch.Scene) -> mujoco.MjModel:
    """Return a scene to draw: the objects in their colours, the scene's own markers and the mocap's cross hidden."""
    model = mujoco.MjModel.__copy__(fetch.base_model(scene))
    for index in range(len(scene.shapes)):
        geom = model.geom(f"object{index}")
        geom.matid, geom.rgba = -1, fetch.block_color(index)
    model.site_rgba[:, 3] = 0
    model.geom_rgba[model.geom_bodyid == model.body("robot0:mocap").id, 3] = 0
    return model


def goal_markers(state: FloatArray) -> list[Marker]:
    """Mark the goals that a state (F,) names, in their objects' colours."""
    colors = (fetch.block_color(index)[:3] for index in range(len(fetch.view(state).goals)))
    pairs = zip(fetch.view(state).goals, colors, strict=True)
    return [Marker(place, GOAL_RADIUS, (*color, GOAL_OPACITY)) for place, color in pairs]


class FetchWorld(World):
    """B rows of a Fetch scene with goals.

    Args:
        task: scene and options.
        batch: B.
        threads: simulation threads.
        scene: another than the task's, with as many objects.
    """

    def __init__(self, task: FetchTask, batch: int, threads: int = 2, scene: fetch.Scene | None = None) -> None:
        """Build the engine; no row holds a state yet."""
        scene = scene or task.scene
        whole = fetch.fetch_model(scene, task.contact, task.timing)
        model = whole if task.arm else fetch_hand.hand_model(scene, task.contact, task.timing)
        self.task = task
        self.batch = batch
        self.control_steps = 0
        self.engine = Engine(model, batch, fetch.TIMINGS[task.timing], threads)
        count = len(scene.shapes)
        self._places = fetch.Places(model, count)
        self._lighten = None if task.arm else fetch_hand.Lightening(whole, model)
        self._start = fetch.settled(scene)
        self._goals = np.full((batch, count, 3), np.nan)

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes: row `rows[i]` gets the initial state that `seeds[i]` alone decides. Returns (R, F)."""
        sensors = np.repeat(self._start.sensors[None], len(rows), axis=0)
        states = self._own(np.repeat(self._start.state[None], len(rows), axis=0), sensors)
        for i, (row, seed) in enumerate(zip(rows, seeds, strict=True)):
            places, self._goals[row] = self.task.sample(np.random.default_rng(int(seed)), self._start)
            states[i, self._places.block_xy] = places
            sensors[i, self._places.block_site[:, :2]] = places
        self.engine.put(rows, states, sensors)
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, 4), clipped to [-1, 1], for one control step. Returns (R, F).

        Raises:
            ValueError: an action is not finite, or a row was never reset.
        """
        actions = checked(rows, actions)
        self.control_steps += int((~self.engine.failed[rows]).sum())
        states, sensors = self.engine.states[rows], self.engine.sensors[rows]
        command = fetch.control(self._places, states, sensors, actions, pushing=self.task.scene.pushing)
        self.engine.step(rows, command)
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""
        return fetch.observe(self._places, self.engine.states[rows], self.engine.sensors[rows], self._goals[rows])

    @property
    def middle(self) -> FloatArray:
        """Where on the table episodes take place (2,), m."""
        return self._start.grip[:2]

    def push(self, row: int, index: int, velocity: FloatArray) -> None:
        """Add a horizontal velocity (2,), m/s, to an object's own."""
        self.engine.states[row, self._places.block_speed[index, :2]] += velocity

    def put_back(self, row: int, index: int, place: FloatArray) -> None:
        """Lay an object on the table at a place (2,), m, at rest."""
        pose = [*place, self._start.heights[index], 1.0, 0.0, 0.0, 0.0]
        self.engine.states[row, self._places.block_pose[index]] = pose
        self.engine.states[row, self._places.block_speed[index]] = 0.0

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        failed: BoolArray = self.engine.failed[rows]
        return failed

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S): integration state, sensor values, goals."""
        return np.concatenate([self.engine.save(rows), self._goals[rows].reshape(len(rows), -1)], axis=1)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S), those with the arm also where the hand is alone. Returns (R, F).

        Raises:
            TaskError: the snapshots are of another scene.
        """
        split, count = self.engine.snapshot_size, self._goals.shape[1]
        snapshots = self._without_arm(snapshots)
        if snapshots.shape != (len(rows), split + 3 * count):
            msg = f"snapshots of shape {snapshots.shape}: expected {(len(rows), split + 3 * count)} for {count} blocks"
            raise TaskError(msg)
        self.engine.load(rows, snapshots[:, :split])
        self._goals[rows] = snapshots[:, split:].reshape(len(rows), -1, 3)
        return self.observe(rows)

    def _own(self, states: FloatArray, sensors: FloatArray) -> FloatArray:
        """Return integration states (R, ...) of the whole scene as this world's engine keeps them."""
        return states if self._lighten is None else self._lighten(states, sensors)

    def _without_arm(self, snapshots: FloatArray) -> FloatArray:
        """Carry snapshots (R, S) of the whole scene over to this world; its own stay as they are."""
        split = self.engine.states.shape[1]
        extra = 0 if self._lighten is None else self._lighten.size - split
        if not extra or snapshots.shape[1] != self.engine.snapshot_size + self._goals[0].size + extra:
            return snapshots
        states, rest = snapshots[:, : split + extra], snapshots[:, split + extra :]
        return np.concatenate([self._own(states, rest), rest], axis=1)
