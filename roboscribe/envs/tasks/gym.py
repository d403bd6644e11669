"""Unmodified environments of gymnasium-robotics as tasks: an outside check on everything learned here.

`gym:NAME` takes any of its goal-conditioned environments with a hand: FetchReach, FetchPush, FetchSlide and
FetchPickAndPlace, with sparse or dense rewards, which nothing here looks at. Others are refused with the reason.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from roboscribe.envs import fetch, goal_env, multi_block_demonstrator, push_demonstrator, reach_demonstrator
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script, ScriptedTask
from roboscribe.envs.fetch_world import TOLERANCE, at_goals
from roboscribe.envs.goal_env import PREFIX, kind
from roboscribe.envs.serial_world import SerialWorld
from roboscribe.world.layout import BoolArray, FloatArray, Layout
from roboscribe.world.task import Task

SCRIPTS = {
    "FetchPickAndPlace": multi_block_demonstrator.SINGLE,
    "FetchPush": push_demonstrator.PUSH,
    "FetchReach": reach_demonstrator.REACH,
}
"""What solves each environment, whatever its rewards and its version; how a puck is to be slid no script knows."""
HORIZONS = {"FetchReach": 50}
"""Control steps of an episode; others have `LONG`."""
LONG = 100


LISTED = tuple(f"{PREFIX}{name}-v4" for name in (*SCRIPTS, "FetchSlide"))


@dataclass(frozen=True)
class GymTask(Task):
    """An environment of the Fetch robot, asked the same question as our tasks of one block.

    Args:
        name: name in the catalogue.
        horizon: control steps of an episode.
    """

    name: str
    horizon: int = LONG
    action_size: int = 4
    frequency: float = fetch.FREQUENCY
    most_rows: ClassVar[int] = 8

    @property
    def environment(self) -> str:
        """Its name in Gymnasium."""
        return self.name.removeprefix(PREFIX)

    @property
    def layout(self) -> Layout:
        """Meaning of a state's columns."""
        return goal_env.layout(self.environment)

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: the object at its goal, or the hand where it has to be; states (..., F), returns (...)."""
        if goal_env.has_object(self.environment):
            return at_goals(states)
        reached: BoolArray = np.linalg.norm(states[..., 7:10] - states[..., :3], axis=-1) < TOLERANCE
        return reached

    def world(self, batch: int) -> SerialWorld:
        """Build a world of `batch` environments."""
        return SerialWorld(partial(goal_env.GymSimulator, self.environment, self.horizon), batch)

    def read(self, observation: Any) -> FloatArray:  # noqa: ANN401 - as declared
        """Turn what the environment observes into a state (F,); a state stays as it is."""
        own = isinstance(observation, Mapping) and "desired_goal" in observation
        return super().read(goal_env.state_of(observation) if own else observation)


@dataclass(frozen=True)
class ScriptedGymTask(GymTask, ScriptedTask):
    """An environment of the Fetch robot for which there is a script."""

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return SCRIPTS[kind(self.environment)]


@register(f"{PREFIX}NAME", examples=LISTED)
def gym_task(request: Request) -> GymTask:
    """Make a task of an environment of gymnasium-robotics.

    Raises:
        TaskError: there is no such environment, or it cannot be a task.
    """
    environment = request.blanks[0]
    if request.name not in LISTED:  # looking the others up takes a second
        goal_env.check(environment)
    made = ScriptedGymTask if kind(environment) in SCRIPTS else GymTask
    return made(request.name, HORIZONS.get(kind(environment), LONG))
