"""The Sawyer of Meta-World at its table with a mug, a drawer and a faucet: model, control and observation.

Robot, table and objects are those that the installed metaworld package ships, each in a file of its own, put together
in one model. Drawer and faucet stand on mocap bodies, so that their places belong to the state and one model serves
every row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

from roboscribe.envs.engine import columns, integration_state
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, IntArray

TIMINGS = {"faithful": 16, "fast": 6}
"""Substeps of a control step: of 2.5 ms, the files' own, or of 6.7 ms."""
FREQUENCY = 25.0
"""Control steps per second; Meta-World's own are 80, in which a hand hardly moves."""
REACH = 0.05
"""Displacement of the hand that an action of 1 asks for, m; about half of it is reached."""
LOWEST, HIGHEST = np.array([-0.45, 0.38, 0.056]), np.array([0.45, 0.92, 0.40])
"""Where the hand may be sent, m. It stands 4 cm above its end effector."""
HAND = (0.0, 0.5, 0.24)
"""Where the hand starts, m."""
TURN = (1.0, 0.0, 1.0, 0.0)
"""Orientation of the hand: fingers down, opening along y."""
OPEN = 0.1
"""Distance between open fingers, m."""
GRAB = 2.0
"""Friction of the drawer's rail, N: without it an opened drawer coasts, and closes when the hand leaves; with half of
it, when the hand strikes it.
"""
ROLL = 1e-3
"""Damping of the mug's motion, N m s/rad: without it a mug that has tipped over rolls to and fro for ever."""
SETTLE = 2.0
"""Time in which the hand comes to its start and the mug to rest, s."""
FINGERS = ("r_close", "l_close")
SLIDE, KNOB, MUG = "goal_slidey", "faucet_knob_Joint_1", "mug"
ARM = 0.12
"""Distance of the knob's grip point from its axis, m."""
SITES = ("endEffector", "mug_centre", "bar", "grip")
"""What is observed: the end effector, the mug's centre, the drawer's bar, the point of the faucet's knob."""


def assets() -> Path:
    """Find the scenes of the installed package without importing it.

    Raises:
        TaskError: metaworld is not installed, or ships no such files.
    """
    package = find_spec("metaworld")
    if package is None or package.origin is None:
        msg = "the table-top's scene comes with metaworld, which is not installed: pip install metaworld"
        raise TaskError(msg)
    folder = Path(package.origin).parent / "assets"
    if not (folder / "sawyer_xyz" / "sawyer_drawer.xml").is_file():
        msg = f"the table-top's scene {folder}/sawyer_xyz/sawyer_drawer.xml does not exist: reinstall metaworld"
        raise TaskError(msg)
    return folder


def _attach(spec: mujoco.MjSpec, name: str, body: str, stand: mujoco.MjsBody) -> None:
    """Put a body of the package's file `name` onto `stand`, with `name` before its names: files repeat each other's."""
    child = mujoco.MjSpec.from_file(str(assets() / "objects" / f"{name}.xml"))
    stand.add_frame().attach_body(child.body(body), f"{name}_", "")


def _add_objects(spec: mujoco.MjSpec) -> None:
    """Add mug and faucet to the drawer's scene, and what all three need to stand anywhere and to be observed."""
    mug = spec.worldbody.add_body(name=MUG, pos=[0.0, 0.58, 0.0])
    mug.add_joint(name=MUG, type=mujoco.mjtJoint.mjJNT_FREE).damping[0] = ROLL
    _attach(spec, "mug", "mug", mug)
    faucet = spec.worldbody.add_body(name="faucet", pos=[0.26, 0.77, 0.0], mocap=True)
    _attach(spec, "faucet", "faucet_link", faucet)
    drawer = spec.body("drawer")
    drawer.mocap, drawer.pos = True, [-0.3, 0.85, 0.0]
    spec.joint(SLIDE).frictionloss = GRAB
    mug.add_site(name="mug_centre", pos=[0.0, 0.0, 0.035])
    spec.body("drawer_link").add_site(name="bar", pos=[0.0, -0.15, 0.0])
    spec.body("faucet_faucet_link2").add_site(name="grip", pos=[0.0, -ARM, 0.0])


def _add_sensors(spec: mujoco.MjSpec) -> None:
    """Add what a control step reads: the hand (for the mocap), the sites, the end effector's velocity."""
    body, site, sensor = mujoco.mjtObj.mjOBJ_XBODY, mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtSensor
    wanted = [("hand", body, sensor.mjSENS_FRAMEPOS), (SITES[0], site, sensor.mjSENS_FRAMELINVEL)]
    wanted += [(name, site, sensor.mjSENS_FRAMEPOS) for name in SITES]
    for name, kind, what in wanted:
        spec.add_sensor(name=f"{name}:{what.name}", type=what, objtype=kind, objname=name)


def _flatten(table: mujoco.MjsBody) -> None:
    """Make the table's hull a plane, with which a step takes a sixth less; walls keep everything on it anyway."""
    hull = next(geom for geom in table.geoms if geom.conaffinity)
    hull.type, hull.pos = mujoco.mjtGeom.mjGEOM_PLANE, np.zeros(3)


def _float(body: mujoco.MjsBody) -> None:
    """Take the weight off the robot, or the hand, which follows a spring, would sink with every step."""
    body.gravcomp = 1.0
    for child in body.bodies:
        _float(child)


@lru_cache(maxsize=1)
def base_model() -> mujoco.MjModel:
    """Compile the scene with the files' own contacts and timing (shared: never change it)."""
    spec = mujoco.MjSpec.from_file(str(assets() / "sawyer_xyz" / "sawyer_drawer.xml"))
    _add_objects(spec)
    _add_sensors(spec)
    _float(spec.body("right_arm_base_link"))
    _flatten(spec.body("tablelink"))
    used = {geom.meshname for geom in spec.geoms}
    for mesh in [mesh for mesh in spec.meshes if mesh.name not in used]:
        spec.delete(mesh)
    model = spec.compile()
    # As metaworld does before its first step: the hand shall coincide with the mocap it is welded to.
    model.eq_data[model.eq_type == mujoco.mjtEq.mjEQ_WELD] = [0, 0, 0, 0, 0, 0, -1, 0, 0, 0, 5]
    return model


@lru_cache(maxsize=2)
def scene_model(timing: str) -> mujoco.MjModel:
    """Return the scene under a timing ("faithful", "fast"); shared. Its contact cones are elliptic in the files.

    Raises:
        TaskError: an unknown timing.
    """
    if timing not in TIMINGS:
        msg = f"timing {timing!r}: expected one of {', '.join(TIMINGS)}"
        raise TaskError(msg)
    model = mujoco.MjModel.__copy__(base_model())
    if timing == "fast":
        model.opt.timestep = 1 / (FREQUENCY * TIMINGS[timing])
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return model


class Places:
    """Where the model keeps what is observed and commanded: columns of integration states and of sensors."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Look the columns up."""
        kinds = mujoco.mjtState
        qpos, mocap = columns(model, int(kinds.mjSTATE_QPOS)), columns(model, int(kinds.mjSTATE_MOCAP_POS))
        self.mocap = mocap.reshape(-1, 3)
        self.mocap_turn = columns(model, int(kinds.mjSTATE_MOCAP_QUAT)).reshape(-1, 4)
        self.order = {name: int(model.body(name).mocapid[0]) for name in ("mocap", "drawer", "faucet")}
        self.fingers: IntArray = np.array([qpos[model.joint(name).qposadr[0]] for name in FINGERS])
        self.slide, self.knob = (int(qpos[model.joint(name).qposadr[0]]) for name in (SLIDE, KNOB))
        self.mug: IntArray = qpos[int(model.joint(MUG).qposadr[0]) + np.arange(7)]
        self.hand, self.speed = slice(0, 3), slice(3, 6)
        self.sites = {name: slice(6 + 3 * i, 9 + 3 * i) for i, name in enumerate(SITES)}


@dataclass(frozen=True)
class Start:
    """The settled scene that every episode starts from; only places on the table differ."""

    state: FloatArray
    """Integration state."""
    sensors: FloatArray


@lru_cache(maxsize=1)
def settled() -> Start:
    """Bring the hand to its start and let the mug come to rest, with the files' own contacts and timing."""
    model = base_model()
    data = mujoco.MjData(model)
    hand = int(model.body("mocap").mocapid[0])
    data.mocap_pos[hand], data.mocap_quat[hand] = HAND, TURN
    data.ctrl[:] = (-1.0, 1.0)
    mujoco.mj_step(model, data, nstep=round(SETTLE / model.opt.timestep))
    time, qpos, qvel, ctrl = data.time, data.qpos.copy(), np.zeros(model.nv), data.ctrl.copy()
    places, turns = data.mocap_pos.copy(), data.mocap_quat.copy()
    mujoco.mj_resetData(model, data)
    data.time, data.qpos[:], data.qvel[:], data.ctrl[:] = time, qpos, qvel, ctrl
    data.mocap_pos[:], data.mocap_quat[:] = places, turns
    data.joint(SLIDE).qpos[:] = data.joint(KNOB).qpos[:] = 0.0
    mujoco.mj_forward(model, data)
    data.qacc_warmstart[:] = 0
    return Start(integration_state(model, data), data.sensordata.copy())


def lay_out(places: Places, states: FloatArray, sensors: FloatArray, where: dict[str, FloatArray]) -> None:
    """Move objects of settled scenes, in place.

    Args:
        places: columns of the model.
        states: (R, ...) integration states.
        sensors: (R, ...) sensor values.
        where: (R, 2) new x and y of "mug", "drawer" and "faucet", m.
    """
    columns_of = {
        "mug": places.mug[:2],
        **{name: places.mocap[places.order[name], :2] for name in ("drawer", "faucet")},
    }
    for name, site in (("mug", "mug_centre"), ("drawer", "bar"), ("faucet", "grip")):
        shift = where[name] - states[:, columns_of[name]]
        states[:, columns_of[name]] = where[name]
        sensors[:, places.sites[site].start + np.arange(2)] += shift


def control(places: Places, states: FloatArray, sensors: FloatArray, actions: FloatArray) -> FloatArray:
    """Turn actions into what a control step holds.

    Args:
        places: columns of the model.
        states: (R, ...) integration states.
        sensors: (R, ...) sensor values.
        actions: (R, 4) in [-1, 1]: displacement of the hand in units of `REACH`; fingers, -1 opens, +1 closes.

    Returns:
        (R, 23): finger targets, mocap positions, mocap quaternions; drawer and faucet stay where they are.
    """
    positions = states[:, places.mocap]
    positions[:, places.order["mocap"]] = np.clip(sensors[:, places.hand] + REACH * actions[:, :3], LOWEST, HIGHEST)
    turns = states[:, places.mocap_turn]
    held = [actions[:, 3:], -actions[:, 3:], positions.reshape(len(states), -1), turns.reshape(len(states), -1)]
    return np.concatenate(held, axis=1)


def knob_arm(angle: float) -> FloatArray:
    """From the knob's axis to its grip point (3,) at an angle in rad, m; it points at the robot at 0."""
    return ARM * np.array([np.sin(angle), -np.cos(angle), 0.0])


def robot(places: Places, states: FloatArray, sensors: FloatArray) -> FloatArray:
    """Observe the end effector (R, 7): position, opening, velocity."""
    opening = OPEN + states[:, places.fingers] @ np.array([[-1.0], [1.0]])
    return np.concatenate([sensors[:, places.sites[SITES[0]]], opening, sensors[:, places.speed]], axis=1)
