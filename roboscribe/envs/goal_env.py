"""Environments of gymnasium-robotics behind their own interface: which can be a task, what is read, snapshots."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from roboscribe.envs import fetch
from roboscribe.envs.engine import INTEGRATION, integration_state
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, FloatArray, Layout, ObjectType

if TYPE_CHECKING:
    import gymnasium

CONTROL_STEP = 1 / fetch.FREQUENCY
HAND = "robot0:gripper_link"
PREFIX = "gym:"
FETCH = "gymnasium_robotics.envs.fetch."
"""Where the environments with a hand are, whose place programs speak of."""
REASONS = {
    "gymnasium_robotics.envs.shadow_dexterous_hand.": "its hand is five fingers, and programs speak of one place",
    "gymnasium_robotics.envs.maze.ant": "its robot is four legs, and programs speak of one place",
    "gymnasium_robotics.envs.maze.point": "its walls are not observed, and what is not observed no predicate can tell",
    "gymnasium_robotics.envs.franka_kitchen": "its goals are names of chores instead of places",
}
"""Environments with goals that cannot be a task, by where they are defined, and why."""
NO_GOALS = "it is not goal-conditioned: it observes no desired_goal"
OLD = "it needs mujoco_py, which is no longer maintained"
OTHERS = "expected one of"
TARGET = ObjectType("target", (Attribute("position", fetch.XYZ, "m", 0.0, 2.0),))
"""Where the hand of FetchReach has to go; a place is all it is."""


@cache
def _registered() -> Mapping[str, str]:
    """List the environments of gymnasium-robotics: by name, where each is defined."""
    import gymnasium
    import gymnasium_robotics  # prints a notice when it is imported, which has no place in a list of tasks

    gymnasium.register_envs(gymnasium_robotics)
    made = {name: str(spec.entry_point) for name, spec in gymnasium.registry.items()}
    return {name: entry for name, entry in made.items() if entry.startswith("gymnasium_robotics.")}


@cache
def usable() -> tuple[str, ...]:
    """List the environments that can be a task."""
    return tuple(sorted(name for name, entry in _registered().items() if _refusal(entry) is None))


def _refusal(entry: str) -> str | None:
    """Say why an environment that is defined there cannot be a task; None where it can."""
    if "MujocoPy" in entry:
        return OLD
    if entry.startswith(FETCH):
        return None
    return next((reason for place, reason in REASONS.items() if entry.startswith(place)), NO_GOALS)


def check(name: str) -> None:
    """Refuse what cannot be a task.

    Raises:
        TaskError: gymnasium-robotics has no such environment, or it cannot be mapped; the message says why.
    """
    known = _registered()
    if name not in known:
        near = get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        msg = f"gymnasium-robotics has no environment {name!r}: {hint}{OTHERS} {', '.join(usable())}"
        raise TaskError(msg)
    if (reason := _refusal(known[name])) is not None:
        msg = f"{PREFIX}{name} cannot be a task: {reason}; {OTHERS} {', '.join(usable())}"
        raise TaskError(msg)


def has_object(name: str) -> bool:
    """Tell whether an environment has an object that its goal is for; else the hand itself has to be somewhere."""
    return kind(name) != "FetchReach"


def kind(name: str) -> str:
    """Return an environment's name without what its rewards and its version are: "FetchPush"."""
    return name.split("-")[0].removesuffix("Dense")


def layout(name: str) -> Layout:
    """Describe the states of an environment."""
    return fetch.layout(fetch.Scene()) if has_object(name) else Layout(fetch.ROBOT_TYPE, (TARGET,))


def make_env(name: str, horizon: int) -> gymnasium.Env[dict[str, FloatArray], FloatArray]:
    """Build an environment with its own time limit moved to `horizon` control steps.

    Raises:
        TaskError: there is no such environment, or it cannot be a task.
    """
    check(name)
    import gymnasium

    return gymnasium.make(name, max_episode_steps=horizon, disable_env_checker=True)


def state_of(observation: Mapping[str, FloatArray]) -> FloatArray:
    """Turn an observation into a flat state: (19,) with an object, (10,) without.

    The environment gives displacements per control step, the object's relative to the hand's; states hold m/s.
    """
    seen, goal = observation["observation"], observation["desired_goal"]
    speeds = 5 if len(seen) == 10 else 20
    hand_speed = seen[speeds : speeds + 3] / CONTROL_STEP
    if len(seen) == 10:
        return np.concatenate([seen[:3], seen[3:5].sum(keepdims=True), hand_speed, goal])
    object_speed = seen[14:17] / CONTROL_STEP + hand_speed
    opening = seen[9:11].sum(keepdims=True)
    return np.concatenate([seen[:3], opening, hand_speed, seen[3:6], seen[11:14], object_speed, goal])


class GymSimulator:
    """One environment and its last state.

    Args:
        name: of the environment.
        horizon: control steps of an episode.
    """

    def __init__(self, name: str, horizon: int) -> None:
        """Build the environment."""
        self.env = make_env(name, horizon)
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
