"""What a name such as `robosuite:Lift,robot=Sawyer,controller=OSC_POSE` asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from roboscribe.envs.suite.library import robosuite
from roboscribe.errors import TaskError, did_you_mean

HELD = "HELD"
"""Control of the hand's place with its direction held as it starts: 3 displacements and the fingers."""
MEMORYLESS = ("OSC_POSE", "OSC_POSITION", "JOINT_POSITION", "JOINT_TORQUE")
"""robosuite's controllers that remember nothing beyond a control step that a snapshot does not hold."""
IN_PYTHON = {
    "Wipe": "what is wiped is kept outside the simulator's state",
    "PickPlaceSingle": "which object it is about changes from episode to episode; take PickPlaceCan or another",
    "NutAssemblySingle": "which nut it is about changes from episode to episode; take NutAssemblySquare or another",
}
"""Environments that a state vector cannot describe, and why."""
DRAWER = "PlaceCubesDrawer"


@dataclass(frozen=True)
class SuiteRequest:
    """An environment of robosuite that is asked for.

    Args:
        environment: its class in robosuite.
        robot: one of robosuite's arms.
        controller: `HELD`, or one of `MEMORYLESS`.
        cubes: how many, of PlaceCubesDrawer.
        closed: whether its drawer has to be shut at the end.
    """

    environment: str
    robot: str = "Panda"
    controller: str = HELD
    cubes: int = 3
    closed: bool = False

    @property
    def held(self) -> bool:
        """Whether the hand keeps its direction."""
        return self.controller == HELD


def parse(text: str) -> SuiteRequest:
    """Read what stands behind `robosuite:`; imports nothing.

    Raises:
        TaskError: an unknown option, or a value that cannot be.
    """
    environment, *options = text.split(",")
    request = SuiteRequest(environment, "Sawyer" if environment == DRAWER else "Panda")
    for option in options:
        key, _, value = option.partition("=")
        own = {"cubes": "cubes=N", "closed": "closed=yes"} if environment == DRAWER else {}
        known = {"robot": "robot=NAME", "controller": "controller=NAME"} | own
        if key not in known or not value:
            msg = f"robosuite:{text}: option {option!r}, expected {' or '.join(known.values())}"
            raise TaskError(msg)
        request = _with(request, key, value)
    if request.controller not in (HELD, *MEMORYLESS):
        msg = f"robosuite:{text}: controller {request.controller!r}, expected one of {', '.join((HELD, *MEMORYLESS))}"
        raise TaskError(msg)
    return request


def _with(request: SuiteRequest, key: str, value: str) -> SuiteRequest:
    """Set one option.

    Raises:
        TaskError: a number of cubes that is none, or neither yes nor no.
    """
    if key == "robot":
        return replace(request, robot=value)
    if key == "controller":
        return replace(request, controller=value)
    if key == "closed":
        if value not in ("yes", "no"):
            msg = f"robosuite:{DRAWER}: closed={value}, expected yes or no"
            raise TaskError(msg)
        return replace(request, closed=value == "yes")
    if not value.isdecimal():
        msg = f"robosuite:{DRAWER}: {value} cubes, expected a number"
        raise TaskError(msg)
    return replace(request, cubes=int(value))


def check(request: SuiteRequest) -> None:
    """Refuse what cannot be a task.

    Raises:
        TaskError: robosuite has no such environment or robot, or it has two arms, or keeps its state to itself.
    """
    suite = robosuite()
    from robosuite.environments.base import REGISTERED_ENVS
    from robosuite.environments.manipulation.two_arm_env import TwoArmEnv
    from robosuite.models.robots.robot_model import REGISTERED_ROBOTS

    name, robot = request.environment, request.robot
    arms = sorted(known for known in suite.ALL_ROBOTS if len(getattr(REGISTERED_ROBOTS[known], "arms", ())) == 1)
    if name not in REGISTERED_ENVS:
        _unknown("environment", name, sorted(REGISTERED_ENVS))
    if issubclass(REGISTERED_ENVS[name], TwoArmEnv):
        msg = f"robosuite:{name} has two arms, and programs have one robot μ: expected an environment with one arm"
        raise TaskError(msg)
    if name in IN_PYTHON:
        msg = f"robosuite:{name} cannot be a task: {IN_PYTHON[name]}"
        raise TaskError(msg)
    if robot not in arms:
        _unknown("robot with one arm", robot, arms)


def _unknown(what: str, name: str, known: list[str]) -> None:
    msg = f"robosuite has no {what} {name!r}: {did_you_mean(name, known)}expected one of {', '.join(known)}"
    raise TaskError(msg)


def build(request: SuiteRequest) -> Any:  # noqa: ANN401 - robosuite has no types
    """Build an environment without pictures; the same request gives the same model in every process.

    Raises:
        TaskError: robosuite cannot build it.
    """
    check(request)
    suite = robosuite()
    from robosuite.controllers import load_composite_controller_config

    options: dict[str, Any] = {"has_renderer": False, "has_offscreen_renderer": False, "use_camera_obs": False}
    options |= {"hard_reset": False, "ignore_done": True, "renderer": "mujoco", "seed": 0, "control_freq": 20}
    if request.environment == DRAWER:
        options |= {"cubes": request.cubes, "closed": request.closed}
    else:
        config = load_composite_controller_config(controller="BASIC", robot=request.robot)
        if not request.held:
            config["body_parts"]["right"] = _arm(request.controller, config["body_parts"]["right"])
        options["controller_configs"] = config
    try:
        return suite.make(request.environment, robots=request.robot, **options)
    except (AssertionError, KeyError, ValueError, AttributeError) as error:
        msg = f"robosuite cannot build {request.environment} with {request.robot}, {request.controller}: {error!r}"
        raise TaskError(msg) from error


def _arm(controller: str, present: dict[str, Any]) -> dict[str, Any]:
    """Return robosuite's settings of an arm's controller, with the gripper's as they are."""
    from robosuite.controllers import load_part_controller_config

    settings: dict[str, Any] = load_part_controller_config(default_controller=controller)
    return {**settings, "gripper": present["gripper"]}
