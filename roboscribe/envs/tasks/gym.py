"""Unmodified environments of gymnasium-robotics as tasks: an outside check on everything learned here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import mujoco
import numpy as np

from roboscribe.envs import fetch, multi_block_demonstrator, push_demonstrator
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script, ScriptedTask
from roboscribe.envs.engine import INTEGRATION, integration_state
from roboscribe.envs.fetch_world import at_goals
from roboscribe.envs.serial_world import SerialWorld
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, Layout

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


def state_of(observation: Mapping[str, FloatArray]) -> FloatArray:
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

    def world(self, batch: int) -> SerialWorld:
        """Build a world of `batch` environments."""
        return SerialWorld(partial(GymSimulator, self), batch)

    def read(self, observation: Any) -> FloatArray:  # noqa: ANN401 - as declared
        """Turn what the environment observes into a state (F,); a state stays as it is."""
        own = isinstance(observation, Mapping) and "desired_goal" in observation
        return super().read(state_of(observation) if own else observation)

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


class GymSimulator:
    """One environment and its last state."""

    def __init__(self, task: GymFetch) -> None:
        """Build the environment."""
        self.env = make_env(task.environment, task.horizon)
        # The adapter needs the simulation behind the environment's interface: its attributes are not typed there.
        inner: Any = self.env.unwrapped
        self.inner = inner
        self.hand = int(inner.model.body(HAND).id)
        self.state = self.reset(0)

    def reset(self, seed: int) -> FloatArray:
        """Start the episode of a seed as the environment's own `reset(seed=...)` does."""
        observation, _ = self.env.reset(seed=seed)
        self.state = state_of(observation)
        return self.state

    def step(self, action: FloatArray) -> FloatArray:
        """Step; NaN where physics broke (MuJoCo resets the clock of a bad state)."""
        clock = float(self.inner.data.time)
        observation = self.env.step(action)[0]
        on_time = abs(self.inner.data.time - clock - CONTROL_STEP) < 1e-6
        self.state = state_of(observation) if on_time else np.full_like(self.state, np.nan)
        return self.state

    def save(self) -> FloatArray:
        """Return integration state, the hand's pose (the next action starts from it) and the state."""
        data = self.inner.data
        pose = (data.xpos[self.hand], data.xquat[self.hand])
        return np.concatenate([integration_state(self.inner.model, data), *pose, self.state])

    def load(self, snapshot: FloatArray) -> FloatArray:
        """Put the environment back into a saved state."""
        model, data = self.inner.model, self.inner.data
        physics, pose, state = np.split(snapshot, np.cumsum([mujoco.mj_stateSize(model, INTEGRATION), 7]))
        if state.shape != self.state.shape:
            msg = f"a snapshot of {len(snapshot)} numbers: expected {len(physics) + 7 + self.state.size}"
            raise TaskError(msg)
        mujoco.mj_setState(model, data, physics, INTEGRATION)
        mujoco.mj_forward(model, data)
        mujoco.mj_setState(model, data, physics, INTEGRATION)
        data.xpos[self.hand], data.xquat[self.hand] = pose[:3], pose[3:]
        self.state = state.copy()
        self.inner.goal = state[-3:].copy()
        return self.state
