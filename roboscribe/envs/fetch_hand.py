"""The Fetch robot's hand alone, on rails where the arm would hold it: the same scene, in half the time.

The arm's 22 hulls and 13 joints take most of a physics step, and the mocap that leads the hand hides nearly all that
they do. Here the hand moves along three slides, turned as the mocap would turn it, with the inertia and the damping
that the arm has at the hand; fingers, objects, contacts, sensors, actions and states are those of the whole scene.
After 20 steps of random actions the two hands are less than 3 mm apart.
"""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np

from roboscribe.envs import fetch
from roboscribe.envs.engine import INTEGRATION, columns, integration_state
from roboscribe.world.layout import FloatArray, IntArray

HAND = "robot0:gripper_link"
RAILS = ("rail:x", "rail:y", "rail:z")
HOME = (1.342, 0.749, 0.555)
"""Where the hand is when its slides are at zero, m."""
DOWN = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
"""How the mocap holds the hand, a quaternion."""
ARM_INERTIA = (14.0, 12.0, 20.0)
"""What the arm's joints add to the hand's 1.5 kg at its home, in each direction, kg: (J M^-1 J^T)^-1 of the arm."""
DAMPING = 10.0
"""Rate at which the arm's joints slow the hand, 1/s."""
QPOS, QVEL = int(mujoco.mjtState.mjSTATE_QPOS), int(mujoco.mjtState.mjSTATE_QVEL)
SHARED = tuple(
    int(part)
    for part in (
        mujoco.mjtState.mjSTATE_TIME,
        mujoco.mjtState.mjSTATE_CTRL,
        mujoco.mjtState.mjSTATE_MOCAP_POS,
        mujoco.mjtState.mjSTATE_MOCAP_QUAT,
    )
)
"""Parts of an integration state that are the same with and without the arm."""


@lru_cache(maxsize=8)
def hand_model(scene: fetch.Scene, contact: str, timing: str) -> mujoco.MjModel:
    """Return a scene with the hand alone under a contact model and a timing; shared.

    Raises:
        TaskError: an unknown contact model or timing.
    """
    return fetch.configured(_base_model(scene), contact, timing)


@lru_cache(maxsize=8)
def _base_model(scene: fetch.Scene) -> mujoco.MjModel:
    """Compile a scene with the hand alone."""
    spec, donor = fetch.file_spec(), fetch.file_spec()
    _remove_robot(spec)
    for material in [each for each in donor.materials if not each.name.startswith("robot0:")]:
        donor.delete(material)
    for texture in list(donor.textures):
        donor.delete(texture)
    frame = spec.worldbody.add_frame(pos=HOME, quat=DOWN)
    hand = frame.attach_body(donor.body(HAND), "", "")
    hand.pos = (0.0, 0.0, 0.0)
    _add_rails(hand)
    _lead_by_mocap(spec)
    fetch.add_objects(spec, scene)
    model = spec.compile()
    model.geom_friction[:] *= scene.friction
    # The two points that are to coincide are the bodies' own origins; the compiler takes where they were apart.
    model.eq_data[0, :6] = 0.0
    return model


def _remove_robot(spec: mujoco.MjSpec) -> None:
    """Leave floor, table, light, mocap and the first object."""
    robot = [body for body in spec.worldbody.bodies if body.name == "robot0:base_link"]
    parts = [*spec.equalities, *spec.excludes, *spec.actuators, *robot, *spec.meshes]
    materials = [each for each in spec.materials if each.name.startswith("robot0:")]
    for part in (*parts, *materials, *spec.textures):
        spec.delete(part)


def _add_rails(hand: mujoco.MjsBody) -> None:
    """Let the hand slide along the world's axes, as heavy as with the arm behind it."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.array(DOWN))
    for name, axis, inertia in zip(RAILS, matrix.reshape(3, 3), ARM_INERTIA, strict=True):
        joint = hand.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=inertia)
        joint.damping[0] = DAMPING * inertia


def _lead_by_mocap(spec: mujoco.MjSpec) -> None:
    """Tie the hand's origin to the mocap's, as softly as the file welds them."""
    for weld in list(spec.equalities):
        solref, solimp = weld.solref.copy(), weld.solimp.copy()
        spec.delete(weld)
    body = mujoco.mjtObj.mjOBJ_BODY
    tie = spec.add_equality(
        type=mujoco.mjtEq.mjEQ_CONNECT, name1="robot0:mocap", name2=HAND, objtype=body, solref=solref
    )
    tie.solimp = solimp
    tie.data[:3] = 0.0


class Lightening:
    """Carries states of a whole scene over to the hand alone.

    Args:
        arm: model of the whole scene.
        hand: model of the hand alone.
    """

    def __init__(self, arm: mujoco.MjModel, hand: mujoco.MjModel) -> None:
        """Look the columns up that both have."""
        data = mujoco.MjData(hand)
        mujoco.mj_forward(hand, data)
        self._blank = integration_state(hand, data)
        self._home = data.body(HAND).xpos.copy()
        self._rails = [fetch.joint_column(hand, name) for name in RAILS]
        self._rail_speeds = columns(hand, QVEL)[[hand.joint(name).dofadr[0] for name in RAILS]]
        names = [hand.joint(index).name for index in range(hand.njnt)]
        common = [name for name in names if name not in RAILS]
        self._from, self._to = _shared(arm, common), _shared(hand, common)
        self.size = int(mujoco.mj_stateSize(arm, INTEGRATION))
        """Length of an integration state of the whole scene."""

    def __call__(self, states: FloatArray, sensors: FloatArray) -> FloatArray:
        """Return states (R, ...) of the hand alone for states (R, ...) and sensor values (R, ...) of a whole scene.

        What sensors see of the hand is as old as a substep.
        """
        light = np.repeat(self._blank[None], len(states), axis=0)
        light[:, self._to] = states[:, self._from]
        light[:, self._rails] = sensors[:, fetch.Places.hand][:, :3] - self._home
        light[:, self._rail_speeds] = sensors[:, fetch.Places.grip_speed]
        return light


def _shared(model: mujoco.MjModel, joints: list[str]) -> IntArray:
    """Return the columns of what a state says of joints, by name, and of the parts that every scene has."""
    qpos, qvel = columns(model, QPOS), columns(model, QVEL)
    found = [columns(model, part) for part in SHARED]
    for name in joints:
        joint = model.joint(name)
        found.append(qpos[joint.qposadr[0] : joint.qposadr[0] + len(joint.qpos0)])
        found.append(qvel[joint.dofadr[0] : joint.dofadr[0] + len(joint.damping)])
    return np.concatenate(found)
