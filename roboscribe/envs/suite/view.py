"""What of an environment a state holds: hand, objects and goals from its observables, success as a flag."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from roboscribe.envs.arm.osc import turn_error
from roboscribe.envs.drawer import geometry
from roboscribe.envs.fetch import euler
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, FloatArray, Layout, ObjectType

XYZ = ("x", "y", "z")
POSITION = Attribute("position", XYZ, "m", -20.0, 20.0)
OPENING = Attribute("opening", ("opening",), "m", -0.5, 0.5)
VELOCITY = Attribute("velocity", ("vx", "vy", "vz"), "m/s", -50.0, 50.0)
ROTATION = Attribute("rotation", ("rx", "ry", "rz"), "rad", -np.pi, np.pi)
ANGLE = Attribute("angle", ("angle",), "rad", -10.0, 10.0)
SOLVED = Attribute("solved", ("solved",), "flag", 0.0, 1.0)
READABLE = re.compile(r"(?!robot\d)(?P<name>.+?)_(?P<what>pos|xpos|quat|qpos)")
RELATIVE = "_to_"
"""Observables of one thing as seen from another repeat what the others say."""
ATTRIBUTES = {"pos": POSITION, "xpos": POSITION, "quat": ROTATION, "qpos": ANGLE}
ON_TOP = 0.045
"""Height of the smaller cube's centre above the larger's on which it stands, in Stack, m."""

Goal = Callable[[Any], FloatArray]


def _bin(index: int) -> Goal:
    return lambda env: np.asarray(env.target_bin_placements[index])


def _peg(name: str) -> Goal:
    return lambda env: np.asarray(env.sim.data.body_xpos[getattr(env, name)])


def _on_other(env: Any) -> FloatArray:  # noqa: ANN401 - robosuite has no types
    place: FloatArray = np.array(env.sim.data.body_xpos[env.cubeB_body_id])
    return np.asarray(place + np.array([0.0, 0.0, ON_TOP]))


BINS = {"Milk": _bin(0), "Bread": _bin(1), "Cereal": _bin(2), "Can": _bin(3)}
PEGS = {"SquareNut": _peg("peg1_body_id"), "RoundNut": _peg("peg2_body_id")}
GOALS: dict[str, dict[str, Goal]] = {"Stack": {"cubeA": _on_other}}
GOALS |= {name: BINS for name in ("PickPlace", *(f"PickPlace{kind}" for kind in BINS))}
GOALS |= {name: PEGS for name in ("NutAssembly", "NutAssemblySquare", "NutAssemblyRound")}
"""Where objects belong, in the environments that have such places."""


@dataclass(frozen=True)
class View:
    """How to read an environment.

    Args:
        layout: meaning of what is read.
        read: the state (F,) of an environment whose simulator is up to date.
    """

    layout: Layout
    read: Callable[[Any], FloatArray]


def hand_site(env: Any) -> int:  # noqa: ANN401 - robosuite has no types
    """Return the site of the only arm's hand."""
    return int(env.robots[0].eef_site_id[env.robots[0].arms[0]])


def hand_rotation(env: Any) -> FloatArray:  # noqa: ANN401
    """Return the hand's axes (3, 3) as columns."""
    return np.array(env.sim.data.site_xmat[hand_site(env)]).reshape(3, 3)


def hand_velocity(env: Any) -> FloatArray:  # noqa: ANN401
    """Return the hand's velocity (3,), m/s."""
    return np.array(env.sim.data.get_site_xvelp(env.sim.model.site_id2name(hand_site(env))))


def opening(env: Any) -> FloatArray:  # noqa: ANN401
    """Return (1,) how far the fingers are apart, as their joints say; (0,) where there are none."""
    joints = env.robots[0]._ref_gripper_joint_pos_indexes[env.robots[0].arms[0]] or []
    values = np.array(env.sim.data.qpos[joints])
    return np.ptp(values, keepdims=True) if len(values) else np.zeros(0)


def objects(env: Any) -> dict[str, dict[str, str]]:  # noqa: ANN401
    """Find what an environment observes of its objects: names of observables by object and by what they tell.

    Raises:
        TaskError: nothing that can be read.
    """
    found: dict[str, dict[str, str]] = {}
    for name, observable in env._observables.items():
        match = READABLE.fullmatch(name)
        readable = observable.modality == "object" and observable.is_active() and RELATIVE not in name
        if match and readable:
            found.setdefault(match["name"], {})[match["what"]] = name
    if not found:
        msg = (
            f"robosuite:{type(env).__name__} observes no object's position, rotation or joint: {list(env._observables)}"
        )
        raise TaskError(msg)
    return found


def view(env: Any, rest: FloatArray | None) -> View:  # noqa: ANN401
    """Decide how to read an environment.

    Args:
        env: after a reset.
        rest: (3, 3) axes that the hand holds; None where it turns freely, and its rotation is part of the state.
    """
    from roboscribe.envs.drawer.suite_env import PlaceCubesDrawer

    return _drawer_view(env) if isinstance(env, PlaceCubesDrawer) else _general_view(env, rest)


def _general_view(env: Any, rest: FloatArray | None) -> View:  # noqa: ANN401
    seen, goals = objects(env), GOALS.get(type(env).__name__, {})
    start = hand_rotation(env)
    turning = (ROTATION,) if rest is None else ()
    fingers = (OPENING,) if len(opening(env)) else ()
    robot = ObjectType("EE", (POSITION, *turning, *fingers, VELOCITY, SOLVED))
    kinds = [
        ObjectType(name, tuple(ATTRIBUTES[what] for what in parts), (POSITION,) if name in goals else ())
        for name, parts in seen.items()
    ]

    def read(env: Any) -> FloatArray:  # noqa: ANN401
        turned = [turn_error(hand_rotation(env), start)] if rest is None else []
        place = np.array(env.sim.data.site_xpos[hand_site(env)])
        parts = [place, *turned, opening(env), hand_velocity(env), np.array([float(env._check_success())])]
        for name, observed in seen.items():
            parts += [_reading(env, what, sensor) for what, sensor in observed.items()]
            parts += [goals[name](env)] if name in goals else []
        return np.concatenate(parts)

    return View(Layout(robot, tuple(kinds)), read)


def _reading(env: Any, what: str, name: str) -> FloatArray:  # noqa: ANN401
    """Return an observable's numbers, rotations as angles."""
    value = np.atleast_1d(np.asarray(env._observables[name].obs, dtype=np.float64))
    return euler(value[[3, 0, 1, 2]]) if what == "quat" else value


def _drawer_view(env: Any) -> View:  # noqa: ANN401
    """Read PlaceCubesDrawer as the batched task of the same name does, for its programs to run."""

    def read(env: Any) -> FloatArray:  # noqa: ANN401
        place = np.array(env.sim.data.site_xpos[hand_site(env)])
        left, right = (env.sim.data.get_joint_qpos(f"gripper0_right_{side}_finger_joint") for side in "lr")
        gap = np.array([geometry.PADS + left - right])
        drawer = np.array([*env.bar, env.extension, 0.0 if env.closed else geometry.TRAVEL])
        cubes = np.concatenate([env.cube_positions, env.cube_goals], axis=1)
        return np.concatenate([place, gap, hand_velocity(env), drawer, cubes.ravel()])

    return View(geometry.layout(len(env.cubes)), read)
