"""The scene of PlaceCubesDrawer, compiled for stepping many copies, and for pictures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np

from roboscribe.envs.arm.chain import Chain
from roboscribe.envs.drawer import geometry
from roboscribe.envs.engine import columns, integration_state
from roboscribe.envs.suite.library import robosuite
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, IntArray

JOINTS = tuple(f"robot0_right_j{i}" for i in range(7))
FINGERS = ("gripper0_right_r_finger_joint", "gripper0_right_l_finger_joint")
OPEN_FINGERS = (-0.020833, 0.020833)
"""Where robosuite's fingers start."""
HAND = "gripper0_right_grip_site"
MARKERS = ("left_eef_target", "right_eef_target")
"""Mocap bodies that robosuite adds to every scene and that mark nothing here."""
ROBOT_PARTS = ("robot0_", "gripper0_")


@dataclass(frozen=True)
class Timing:
    """How a control step of 50 ms is divided.

    Args:
        evaluations: how often the arm's torques are computed anew.
        substeps: physics steps for each.
        euler: MuJoCo's default integrator, as in robosuite; else its implicit one, which bears longer steps.
    """

    evaluations: int
    substeps: int
    euler: bool

    @property
    def timestep(self) -> float:
        """Duration of a physics step, s."""
        return 1 / (geometry.FREQUENCY * self.evaluations * self.substeps)


TIMINGS = {"faithful": Timing(25, 1, euler=True), "fast": Timing(5, 2, euler=False)}


@lru_cache(maxsize=8)
def _xml(cubes: int) -> str:
    """Compose the scene; robosuite is imported late, as that takes seconds."""
    robosuite()
    from roboscribe.envs.drawer.suite_env import scene_xml

    return scene_xml(cubes)


def _spec(cubes: int) -> mujoco.MjSpec:
    """Read the scene, without robosuite's markers, its sensors, and the weight of the robot's own parts.

    Where the cabinet stands belongs to the state, so that one model serves every episode. robosuite
    computes the torques that hold the robot's weight; here gravity does not pull at it.
    """
    spec = mujoco.MjSpec.from_string(_xml(cubes))
    for name in MARKERS:
        spec.delete(spec.body(name))
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    for body in spec.bodies:
        if body.name.startswith(ROBOT_PARTS):
            body.gravcomp = 1.0
    spec.body("cabinet_main").mocap = True
    return spec


@lru_cache(maxsize=8)
def drawer_model(cubes: int, timing: str) -> mujoco.MjModel:
    """Compile the scene for stepping, without what is only seen (shared: never change it).

    Raises:
        TaskError: an unknown timing, or a number of cubes that does not fit.
    """
    if timing not in TIMINGS or not 1 <= cubes <= geometry.MOST_CUBES:
        found = f"timing {timing!r}, {cubes} cubes"
        msg = f"{found}: expected one of {tuple(TIMINGS)}, 1 to {geometry.MOST_CUBES}"
        raise TaskError(msg)
    spec = _spec(cubes)
    for geom in list(spec.geoms):
        if geom.contype == 0 and geom.conaffinity == 0:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    how = TIMINGS[timing]
    spec.option.timestep = how.timestep
    kind = mujoco.mjtIntegrator
    spec.option.integrator = kind.mjINT_EULER if how.euler else kind.mjINT_IMPLICITFAST
    return spec.compile()


@lru_cache(maxsize=2)
def picture_model(cubes: int) -> mujoco.MjModel:
    """Compile the scene with everything that is seen and the size of pictures that is wanted."""
    return _spec(cubes).compile()


class Places:
    """Where a model keeps what is observed and commanded: columns of integration states and of controls."""

    def __init__(self, model: mujoco.MjModel, cubes: int) -> None:
        """Look the columns up."""
        position = columns(model, int(mujoco.mjtState.mjSTATE_QPOS))
        speed = columns(model, int(mujoco.mjtState.mjSTATE_QVEL))
        control = columns(model, int(mujoco.mjtState.mjSTATE_CTRL))

        def joint(name: str) -> int:
            return int(position[model.joint(name).qposadr[0]])

        self.arm: IntArray = np.array([joint(name) for name in JOINTS])
        self.arm_speed: IntArray = np.array([speed[model.joint(name).dofadr[0]] for name in JOINTS])
        self.right, self.left = (joint(name) for name in FINGERS)
        self.extension = joint("cabinet_slide")
        self.cubes: IntArray = np.array([joint(f"cube{i}_joint0") for i in range(cubes)])[:, None] + np.arange(7)
        driven = {int(model.actuator_trnid[i, 0]): i for i in range(model.nu)}
        self.motors: IntArray = np.array([driven[model.joint(name).id] for name in JOINTS])
        self.grippers: IntArray = np.array([driven[model.joint(name).id] for name in FINGERS])
        self.controls = control
        self.cabinet: IntArray = columns(model, int(mujoco.mjtState.mjSTATE_MOCAP_POS))
        self.placed: IntArray = np.append(self.cabinet, columns(model, int(mujoco.mjtState.mjSTATE_MOCAP_QUAT)))
        self.grip_column = int(control[self.grippers[0]])
        ranges = model.actuator_ctrlrange
        self.torque_limit: FloatArray = ranges[self.motors, 1]
        self.grip_middle: FloatArray = ranges[self.grippers].mean(axis=1)
        self.grip_half = float(np.ptp(ranges[self.grippers[0]]) / 2)


def chain(model: mujoco.MjModel) -> Chain:
    """Describe the Sawyer's arm in a model of the scene."""
    return Chain(model, JOINTS, HAND)


def start(model: mujoco.MjModel, places: Places) -> FloatArray:
    """Return the integration state in which every episode starts, the cubes at no place yet."""
    state = integration_state(model, mujoco.MjData(model))
    state[places.arm] = geometry.START_JOINTS
    state[[places.right, places.left]] = OPEN_FINGERS
    state[places.controls[places.grippers]] = places.grip_middle
    state[places.cubes] = (0.0, 0.0, geometry.CABINET_TOP + geometry.HALF_CUBE, 1.0, 0.0, 0.0, 0.0)
    return state
