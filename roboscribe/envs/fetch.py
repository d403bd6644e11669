"""The Fetch robot at its table, with any number of blocks and other rigid objects.

The scene is the one that the installed gymnasium-robotics package ships for FetchPickAndPlace, extended by objects
and by the sensors that observations need. One block gives that environment's own dynamics.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from roboscribe.envs.engine import columns, integration_state
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, FloatArray, IntArray, Layout, ObjectType

CONTACTS = ("stable", "paper")
TIMINGS = {"faithful": 20, "fast": 10}
FREQUENCY = 25.0
"""Control steps per second."""
HEIGHT, PUSHING_HEIGHT = 0.2, 0.0
"""How far above its home the hand starts, to pick and to push, m."""
REACH = 0.05
"""Displacement of the end effector that an action of 1 asks for, m."""
BLOCK_SIZE = 0.05
"""Edge of a block, m."""
TABLE = 0.4
"""Height of the table's top, m."""
FINGERS = ("robot0:r_gripper_finger_joint", "robot0:l_gripper_finger_joint")
COLORS = ((0.85, 0.25, 0.2), (0.2, 0.45, 0.85), (0.25, 0.65, 0.3), (0.9, 0.7, 0.15), (0.55, 0.3, 0.7), (0.2, 0.65, 0.7))

XYZ = ("x", "y", "z")
ROBOT_TYPE = ObjectType(
    "EE",
    (
        Attribute("position", XYZ, "m", -1.0, 3.0),
        Attribute("opening", ("opening",), "m", -0.05, 0.15),
        Attribute("velocity", ("vx", "vy", "vz"), "m/s", -20.0, 20.0),
    ),
)
HAND, OPENING, VELOCITY, OBJECTS = slice(0, 3), 3, slice(4, 7), 7
"""Columns of the robot's attributes, and the first one of the objects."""
PER_OBJECT, GOAL = 12, 9
"""Columns of an object and its goal: position, rotation, velocity; then, from the second number on, the goal."""


@dataclass(frozen=True)
class Shape:
    """A kind of rigid object.

    Args:
        kind: name of its type.
        half: half of its extents along x, y and z, m; of a cylinder, whose axis is z: radius, radius, half height.
        round: whether it is a cylinder.
        mass: kg.
    """

    kind: str
    half: tuple[float, float, float] = (BLOCK_SIZE / 2,) * 3
    round: bool = False
    mass: float = 2.0

    @property
    def geometry(self) -> mujoco.mjtGeom:
        """Its primitive in MuJoCo."""
        return mujoco.mjtGeom.mjGEOM_CYLINDER if self.round else mujoco.mjtGeom.mjGEOM_BOX

    @property
    def size(self) -> tuple[float, float, float]:
        """What MuJoCo calls its size."""
        return (self.half[0], self.half[2], 0.0) if self.round else self.half


BLOCK = Shape("block")


@dataclass(frozen=True)
class Scene:
    """What stands on the table, and how the hand is.

    Args:
        shapes: the objects.
        pushing: the fingers stay closed and the hand starts at the table, as in FetchPush.
        friction: of everything, in multiples of the file's.
    """

    shapes: tuple[Shape, ...] = (BLOCK,)
    pushing: bool = False
    friction: float = 1.0

    @staticmethod
    def of_blocks(count: int, *, pushing: bool = False) -> Scene:
        """Return a scene of equal blocks."""
        return Scene((BLOCK,) * count, pushing)


def object_type(kind: str) -> ObjectType:
    """Describe objects of one kind: pose and velocity; the position is what goals are given for."""
    attributes = (
        Attribute("position", XYZ, "m", -2.0, 3.0),
        Attribute("rotation", ("rx", "ry", "rz"), "rad", -np.pi, np.pi),
        Attribute("velocity", ("vx", "vy", "vz"), "m/s", -50.0, 50.0),
    )
    return ObjectType(kind, attributes, (Attribute("position", XYZ, "m", 0.0, 2.0),))


def layout(scene: Scene) -> Layout:
    """Describe the state of a scene: 7 numbers of the end effector, then 9 + 3 of each object and its goal."""
    return Layout(ROBOT_TYPE, tuple(object_type(shape.kind) for shape in scene.shapes))


class View(NamedTuple):
    """States of a Fetch scene by name: views of arrays (..., F), not copies.

    Attributes:
        hand: (..., 3) position of the end effector, m.
        opening: (...) distance between the fingers, m.
        velocity: (..., 3) of the end effector, m/s.
        blocks: (..., N, 3) positions of the objects, m.
        goals: (..., N, 3) where they belong, m.
    """

    hand: FloatArray
    opening: FloatArray
    velocity: FloatArray
    blocks: FloatArray
    goals: FloatArray


def view(states: FloatArray) -> View:
    """Name the parts of states (..., F)."""
    count = (states.shape[-1] - OBJECTS) // PER_OBJECT  # spelled out: of no states NumPy cannot work it out
    objects = states[..., OBJECTS:].reshape(*states.shape[:-1], count, PER_OBJECT)
    hand, opening, velocity = states[..., HAND], states[..., OPENING], states[..., VELOCITY]
    return View(hand, opening, velocity, objects[..., :3], objects[..., GOAL:])


def scene_file() -> Path:
    """Find the scene of the installed package without importing it.

    Raises:
        TaskError: gymnasium-robotics is not installed, or ships no such file.
    """
    package = find_spec("gymnasium_robotics")
    if package is None or package.origin is None:
        msg = "the Fetch scene comes with gymnasium-robotics, which is not installed: pip install gymnasium-robotics"
        raise TaskError(msg)
    path = Path(package.origin).parent / "envs" / "assets" / "fetch" / "pick_and_place.xml"
    if not path.is_file():
        msg = f"the Fetch scene {path} does not exist: reinstall gymnasium-robotics"
        raise TaskError(msg)
    return path


def block_color(index: int) -> tuple[float, float, float, float]:
    """Return the colour of a block and its goal, opaque."""
    return (*COLORS[index % len(COLORS)], 1.0)


def _add_object(spec: mujoco.MjSpec, index: int, shape: Shape) -> None:
    """Add an object made as the scene's block, further along the table's near edge."""
    body = spec.worldbody.add_body(name=f"object{index}", pos=[BLOCK_SIZE / 2] * 3)
    joint = body.add_joint(name=f"object{index}:joint", type=mujoco.mjtJoint.mjJNT_FREE)
    # Linear damping alone: the further numbers are coefficients of the square and the cube of the speed.
    joint.damping[0] = 0.01
    body.add_geom(
        name=f"object{index}",
        type=shape.geometry,
        size=shape.size,
        condim=3,
        mass=shape.mass,
        material="block_mat",
    )
    body.add_site(name=f"object{index}", size=[0.02] * 3)


def _add_sensors(spec: mujoco.MjSpec, blocks: int) -> None:
    """Add what a control step reads: hand pose (for the mocap), grip site, block sites."""
    body, site, sensor = mujoco.mjtObj.mjOBJ_XBODY, mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtSensor
    wanted = [
        ("robot0:gripper_link", body, sensor.mjSENS_FRAMEPOS),
        ("robot0:gripper_link", body, sensor.mjSENS_FRAMEQUAT),
        ("robot0:grip", site, sensor.mjSENS_FRAMEPOS),
        ("robot0:grip", site, sensor.mjSENS_FRAMELINVEL),
    ]
    for index in range(blocks):
        wanted += [(f"object{index}", site, kind) for kind in (sensor.mjSENS_FRAMEPOS, sensor.mjSENS_FRAMEQUAT)]
    for name, kind, what in wanted:
        spec.add_sensor(name=f"{name}:{what.name}", type=what, objtype=kind, objname=name)


def file_spec() -> mujoco.MjSpec:
    """Read the scene of the installed package, to be changed before it is compiled."""
    return mujoco.MjSpec.from_file(str(scene_file()))


def add_objects(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Put a scene's objects in place of the file's one, and the sensors that observations need."""
    first = scene.shapes[0]
    if first != BLOCK:
        geom = spec.geom("object0")
        geom.type, geom.size, geom.mass = first.geometry, first.size, first.mass
    for index, shape in enumerate(scene.shapes[1:], start=1):
        _add_object(spec, index, shape)
    _add_sensors(spec, len(scene.shapes))


@lru_cache(maxsize=8)
def base_model(scene: Scene) -> mujoco.MjModel:
    """Compile a scene with the file's own contact model and timing (shared: never change it).

    Departs: from the file in one pair of the robot's own hulls, torso and shoulder, which is not tested for contact.
        They stay 11 mm or more apart wherever the hand works, but MuJoCo 3.9 reports a false contact at isolated
        poses (geometric distance 0 instead of 16 mm), and testing the pair takes a third of a physics step.
    """
    spec = file_spec()
    spec.add_exclude(bodyname1="robot0:torso_lift_link", bodyname2="robot0:shoulder_lift_link")
    add_objects(spec, scene)
    model = spec.compile()
    model.geom_friction[:] *= scene.friction
    # As gymnasium-robotics does before its first step: the mocap shall coincide with the hand it is welded to.
    model.eq_data[model.eq_type == mujoco.mjtEq.mjEQ_WELD, :7] = [0, 0, 0, 0, 0, 0, 1]
    return model


@lru_cache(maxsize=8)
def fetch_model(scene: Scene, contact: str, timing: str) -> mujoco.MjModel:
    """Return a scene under a contact model ("stable", "paper") and a timing ("faithful", "fast"); shared.

    Raises:
        TaskError: an unknown contact model or timing, or no object.
    """
    if not scene.shapes:
        msg = "no object on the table: expected at least 1"
        raise TaskError(msg)
    return configured(base_model(scene), contact, timing)


def configured(base: mujoco.MjModel, contact: str, timing: str) -> mujoco.MjModel:
    """Return a copy of a compiled scene under a contact model and a timing.

    Raises:
        TaskError: an unknown contact model or timing.
    """
    if contact not in CONTACTS or timing not in TIMINGS:
        msg = f"contact {contact!r}, timing {timing!r}: expected one of {CONTACTS}, one of {tuple(TIMINGS)}"
        raise TaskError(msg)
    model = mujoco.MjModel.__copy__(base)
    if contact == "stable":
        model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        model.opt.impratio = 10
    if timing == "fast":
        model.opt.timestep = 0.004
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return model


def joint_column(model: mujoco.MjModel, name: str) -> int:
    """Return the column of a joint's first position in an integration state vector."""
    return int(columns(model, int(mujoco.mjtState.mjSTATE_QPOS))[model.joint(name).qposadr[0]])


@dataclass(frozen=True)
class Start:
    """The settled scene that every episode starts from; only the objects' places on the table differ."""

    state: FloatArray
    """Integration state."""
    sensors: FloatArray
    grip: FloatArray
    """Position of the end effector (3,), m."""
    heights: FloatArray
    """Height of each resting object's centre (N,), m."""


def _lay_out(data: mujoco.MjData, scene: Scene) -> None:
    """Set the joints as gymnasium-robotics does; further objects lie in rows of five beside the first."""
    for name, value in (("robot0:slide0", 0.405), ("robot0:slide1", 0.48), ("robot0:slide2", 0.0)):
        data.joint(name).qpos[:] = value
    for index, shape in enumerate(scene.shapes):
        place = (1.25 + 0.07 * (index % 5), 0.53 + 0.07 * (index // 5))
        height = TABLE + shape.half[2] - BLOCK_SIZE / 2
        data.joint(f"object{index}:joint").qpos[:] = (*place, height, 1, 0, 0, 0)


@lru_cache(maxsize=8)
def settled(scene: Scene) -> Start:
    """Bring the hand to its start, as the environments of gymnasium-robotics do, with the file's own contacts."""
    model = base_model(scene)
    data = mujoco.MjData(model)
    _lay_out(data, scene)
    mujoco.mj_forward(model, data)
    above = PUSHING_HEIGHT if scene.pushing else HEIGHT
    data.mocap_pos[0] = data.site("robot0:grip").xpos + np.array([-0.498, 0.005, -0.431 + above])
    data.mocap_quat[0] = (1.0, 0.0, 1.0, 0.0)
    mujoco.mj_step(model, data, nstep=10 * TIMINGS["faithful"])
    grip = data.site("robot0:grip").xpos.copy()
    heights = np.array([data.site(f"object{index}").xpos[2] for index in range(len(scene.shapes))])
    time, qpos, qvel = data.time, data.qpos.copy(), data.qvel.copy()
    mujoco.mj_resetData(model, data)
    data.time, data.qpos[:], data.qvel[:] = time, qpos, qvel
    mujoco.mj_forward(model, data)
    data.qacc_warmstart[:] = 0
    return Start(integration_state(model, data), data.sensordata.copy(), grip, heights)


def euler(quaternions: FloatArray) -> FloatArray:
    """Turn unit quaternions (..., 4), w first, into intrinsic x-y-z angles (..., 3) in rad."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    sine = np.clip(2 * (x * z + w * y), -1.0, 1.0)
    first = np.arctan2(2 * (w * x - y * z), 1 - 2 * (x * x + y * y))
    third = np.arctan2(2 * (w * z - x * y), 1 - 2 * (y * y + z * z))
    return np.stack([first, np.arcsin(sine), third], axis=-1)


class Places:
    """Where a Fetch model keeps what is observed and commanded: columns of integration states and of sensors."""

    hand, grip, grip_speed = slice(0, 7), slice(7, 10), slice(10, 13)
    """Sensors of the hand's pose, and of the end effector's place and velocity."""

    def __init__(self, model: mujoco.MjModel, blocks: int) -> None:
        """Look the columns up."""
        self.fingers: IntArray = np.array([joint_column(model, name) for name in FINGERS])
        first = np.array([joint_column(model, f"object{i}:joint") for i in range(blocks)])
        speed = columns(model, int(mujoco.mjtState.mjSTATE_QVEL))
        self.block_xy: IntArray = first[:, None] + np.arange(2)
        self.block_pose: IntArray = first[:, None] + np.arange(7)
        dofs = np.array([model.joint(f"object{i}:joint").dofadr[0] for i in range(blocks)])
        self.block_speed: IntArray = speed[dofs[:, None] + np.arange(3)]
        sensor = 13 + 7 * np.arange(blocks)[:, None]
        self.block_site: IntArray = sensor + np.arange(3)
        self.block_turn: IntArray = sensor + np.arange(3, 7)


def control(
    places: Places, states: FloatArray, sensors: FloatArray, actions: FloatArray, *, pushing: bool = False
) -> FloatArray:
    """Turn actions into what a control step holds.

    Args:
        places: columns of the model.
        states: (R, ...) integration states.
        sensors: (R, ...) sensor values.
        actions: (R, 4) in [-1, 1]: displacement of the end effector in units of `REACH`; finger command, an offset
            from the fingers' present positions.
        pushing: the fingers stay closed, whatever is commanded.

    Returns:
        (R, 9): finger targets, mocap position, mocap quaternion. The fixed orientation is added to the hand's, as
        gymnasium-robotics does; MuJoCo normalises the sum.
    """
    hand = sensors[:, places.hand]
    fingers = np.zeros((len(states), 2)) if pushing else states[:, places.fingers] + actions[:, 3:]
    return np.concatenate([fingers, hand[:, :3] + actions[:, :3] * REACH, hand[:, 3:] + (1.0, 0.0, 1.0, 0.0)], axis=1)


def observe(places: Places, states: FloatArray, sensors: FloatArray, goals: FloatArray) -> FloatArray:
    """Build flat states (R, F) from integration states, sensor values and goals (R, N, 3).

    Joints and the blocks' velocities are those of the step's end; what sensors see (poses, the hand's velocity) is that
    of the beginning of its last substep, as in gymnasium-robotics, which computes the hand's velocity at the end.
    """
    opening = states[:, places.fingers].sum(axis=1, keepdims=True)
    robot = np.concatenate([sensors[:, places.grip], opening, sensors[:, places.grip_speed]], axis=1)
    turns = euler(sensors[:, places.block_turn])
    blocks = [sensors[:, places.block_site], turns, states[:, places.block_speed], goals]
    return np.concatenate([robot, np.concatenate(blocks, axis=2).reshape(len(states), -1)], axis=1)
