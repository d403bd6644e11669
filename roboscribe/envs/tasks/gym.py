"""Unmodified environments of gymnasium-robotics as tasks: an outside check on everything learned here."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import mujoco
import numpy as np

from roboscribe.envs import fetch, multi_block_demonstrator, push_demonstrator
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script, ScriptedTask
from roboscribe.envs.engine import INTEGRATION, integration_state
from roboscribe.envs.fetch_world import at_goals, checked
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.task import World

if TYPE_CHECKING:
    import gymnasium

CONTROL_STEP = 1 / fetch.FREQUENCY
HAND = "robot0:gripper_link"
PREFIX = "gym:"


def make_env(name: str, horizon: int) -> gymnasium.Env[dict[str, FloatArray], FloatArray]:
    """Build an environment with its own time limit moved to `horizon` control steps.

    Raises:
        TaskError: there is no such environment.
    """
    import gymnasium
    import gymnasium_robotics  # prints a notice when it is imported, which has no place in a list of tasks

    gymnasium.register_envs(gymnasium_robotics)
    return gymnasium.make(name, max_episode_steps=horizon, disable_env_checker=True)


def state_of(observation: dict[str, FloatArray]) -> FloatArray:
    """Turn an observation into a flat state (19,) of the one-block scene.

    The environment gives displacements per control step, the block's relative to the hand's; states hold m/s.
    """
    seen = observation["observation"]
    hand_speed = seen[20:23] / CONTROL_STEP
    block_speed = seen[14:17] / CONTROL_STEP + hand_speed
    opening = seen[9:11].sum(keepdims=True)
    goal = observation["desired_goal"]
    return np.concatenate([seen[:3], opening, hand_speed, seen[3:6], seen[11:14], block_speed, goal])


@dataclass(frozen=True)
class GymFetch(ScriptedTask):
    """An environment of the Fetch robot with one block, asked the same question as our task of one block.

    Args:
        name: name in the catalogue.
        scripted: what solves it.
        horizon: control steps of an episode.
    """

    name: str
    scripted: Script
    horizon: int = 100
    action_size: int = 4
    frequency: float = fetch.FREQUENCY
    most_rows: ClassVar[int] = 8

    @property
    def environment(self) -> str:
        """Its name in Gymnasium."""
        return self.name.removeprefix(PREFIX)

    @cached_property
    def layout(self) -> Layout:
        """Meaning of a state's columns."""
        return fetch.layout(fetch.Scene())

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: the block at its goal; states (..., F), returns (...)."""
        return at_goals(states)

    def world(self, batch: int) -> GymWorld:
        """Build a world of `batch` environments."""
        return GymWorld(self, batch)

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return self.scripted


SCRIPTS = {"FetchPickAndPlace-v4": multi_block_demonstrator.SINGLE, "FetchPush-v4": push_demonstrator.PUSH}
"""What solves each environment."""


@register(*(PREFIX + name for name in SCRIPTS))
def gym_fetch(request: Request) -> GymFetch:
    """Make a task of an environment of gymnasium-robotics."""
    return GymFetch(request.name, SCRIPTS[request.name.removeprefix(PREFIX)])


class Row:
    """One environment, its last state, and whether it left physics."""

    def __init__(self, task: GymFetch) -> None:
        """Build the environment."""
        self.env = make_env(task.environment, task.horizon)
        # The adapter needs the simulation behind the environment's interface: its attributes are not typed there.
        inner: Any = self.env.unwrapped
        self.inner = inner
        self.hand = int(inner.model.body(HAND).id)
        self.state_size = task.layout.size
        self.state = np.empty(0)
        self.failed = False

    def reset(self, seed: int) -> None:
        """Start the episode of a seed."""
        observation, _ = self.env.reset(seed=seed)
        self.state, self.failed = state_of(observation), False

    def step(self, action: FloatArray) -> None:
        """Step; what leaves physics goes back to where it was and fails (MuJoCo resets the clock of a bad state)."""
        before, clock = self.save(), float(self.inner.data.time)
        observation = self.env.step(action)[0]
        state = state_of(observation)
        on_time = abs(self.inner.data.time - clock - CONTROL_STEP) < 1e-6
        if on_time and np.isfinite(state).all():
            self.state = state
        else:
            self.load(before)
            self.failed = True

    def save(self) -> FloatArray:
        """Return integration state, the hand's pose (the next action starts from it) and the state."""
        data = self.inner.data
        pose = (data.xpos[self.hand], data.xquat[self.hand])
        return np.concatenate([integration_state(self.inner.model, data), *pose, self.state])

    def load(self, snapshot: FloatArray) -> None:
        """Put the environment back into a saved state."""
        model, data = self.inner.model, self.inner.data
        physics, pose, state = np.split(snapshot, np.cumsum([mujoco.mj_stateSize(model, INTEGRATION), 7]))
        if state.shape != (self.state_size,):
            msg = f"a snapshot of {len(snapshot)} numbers: expected {len(physics) + 7 + self.state_size}"
            raise TaskError(msg)
        mujoco.mj_setState(model, data, physics, INTEGRATION)
        mujoco.mj_forward(model, data)
        mujoco.mj_setState(model, data, physics, INTEGRATION)
        data.xpos[self.hand], data.xquat[self.hand] = pose[:3], pose[3:]
        self.state, self.failed = state.copy(), False
        self.inner.goal = state[-3:].copy()


class GymWorld(World):
    """B environments in a loop; a row's environment is built when the row is first used."""

    def __init__(self, task: GymFetch, batch: int) -> None:
        """Remember the size; no environment exists yet."""
        self.batch = batch
        self.control_steps = 0
        self._task = task
        self._rows: dict[int, Row] = {}

    def _row(self, row: int) -> Row:
        """Return a row that was reset or loaded before.

        Raises:
            ValueError: it was not.
        """
        if int(row) not in self._rows:
            msg = f"row {int(row)} was never reset or loaded: reset it before use"
            raise ValueError(msg)
        return self._rows[int(row)]

    def _ready(self, row: int) -> Row:
        """Return a row, building its environment if need be."""
        if int(row) not in self._rows:
            self._rows[int(row)] = Row(self._task)
            self._rows[int(row)].reset(0)
        return self._rows[int(row)]

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Start episodes as the environment's own `reset(seed=...)` does. Returns (R, F)."""
        for row, seed in zip(rows, seeds, strict=True):
            self._ready(row).reset(int(seed))
        return self.observe(rows)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Apply `actions` (R, 4), clipped to [-1, 1]. Returns (R, F)."""
        for row, action in zip(rows, checked(rows, actions), strict=True):
            one = self._row(row)
            if not one.failed:
                one.step(action)
                self.control_steps += 1
        return self.observe(rows)

    def observe(self, rows: IntArray) -> FloatArray:
        """Return the present states (R, F) of `rows`."""
        return np.array([self._row(row).state for row in rows])

    def diverged(self, rows: IntArray) -> BoolArray:
        """Which of `rows` left physics."""
        return np.array([self._row(row).failed for row in rows], dtype=np.bool_)

    def save(self, rows: IntArray) -> FloatArray:
        """Return snapshots (R, S)."""
        return np.array([self._row(row).save() for row in rows])

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        """Put `rows` into saved states (R, S). Returns (R, F)."""
        for row, snapshot in zip(rows, snapshots, strict=True):
            self._ready(row).load(snapshot)
        return self.observe(rows)
