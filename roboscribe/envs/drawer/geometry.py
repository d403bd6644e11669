"""Where everything is in PlaceCubesDrawer, what is drawn anew for every episode, and when it is solved.

Nothing here needs a simulator. Lengths in m, angles in rad; the robot stands at x = -0.56 and looks along +x, the
drawer opens towards it, along -x.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import Generator

from roboscribe.world.layout import Attribute, BoolArray, FloatArray, Layout, ObjectType

FREQUENCY = 20.0
"""Control steps per second."""
REACH = 0.1
"""Displacement of the hand that an action of 1 asks for in one control step (it arrives later)."""
START_JOINTS = (-0.283, -1.095, -0.010, 1.914, 0.007, 0.751, -0.123)
"""The hand is above the table's middle and points straight down, its fingers open along x."""
CABINET_FILE = Path(__file__).with_name("cabinet.xml")
TABLE_OFFSET = (0.1, 0.0, 0.8)
"""Middle of the table's top."""
CABINET = (0.22, 0.0, 0.8)
"""Where the cabinet's own origin is, give or take."""
CABINET_JITTER = (0.03, 0.05)
"""How far it may stand from there, along x and y."""
AJAR = 0.06
"""The drawer starts at most this far open: where its handle is has to be seen."""
CABINET_TOP = 0.95
"""Height of its top, on which the cubes start."""
TRAVEL = 0.18
"""Extension of the drawer that is fully open."""
HANDLE = (-0.215, 0.0, 0.085)
"""Middle of the handle's bar of the closed drawer, from the cabinet's origin."""
TRAY_X = (-0.13, 0.105)
"""Inside of the closed drawer, from the cabinet's origin."""
TRAY_Y = 0.148
TRAY_Z = (0.016, 0.055)
"""Heights above the table at which a cube's centre is in the drawer: one that is still held high is not."""
HALF_CUBE = 0.02
MOST_CUBES = 5
LANES, JITTER = {3: 0.1, 5: 0.065}, {3: 0.02, 5: 0.008}
"""Cubes start in lanes along x, this far apart, give or take, by how many lanes there are, m from the cabinet's."""
START_X = (-0.08, 0.05)
SLOTS = {3: 0.09, 5: 0.055}
"""Distance between neighbouring goals."""
SLOT_X, SLOT_Z = -0.215, 0.036
"""Middle of the goals, from the cabinet's origin."""
SLOT_JITTER = {3: (0.02, 0.012), 5: (0.02, 0.002)}
"""How far a goal may be from the middle of its slot, along x and y."""
SHUT = 0.02
"""A drawer is shut again when its extension is less."""
PADS = 0.0371
"""Distance between the finger pads where both finger joints are at 0."""
STEPS_FOR_DRAWER, STEPS_PER_CUBE = 60, 110
"""Control steps that an episode has for opening or shutting the drawer, and for every cube."""
COLORS = ((0.85, 0.25, 0.2), (0.2, 0.45, 0.85), (0.25, 0.65, 0.3), (0.9, 0.7, 0.15), (0.55, 0.3, 0.7))
"""Of the cubes and their goals."""

XYZ = ("x", "y", "z")
ROBOT = ObjectType(
    "EE",
    (
        Attribute("position", XYZ, "m", -1.5, 2.5),
        Attribute("opening", ("opening",), "m", -0.02, 0.1),
        Attribute("velocity", ("vx", "vy", "vz"), "m/s", -20.0, 20.0),
    ),
)
EXTENSION = Attribute("extension", ("extension",), "m", -0.05, 0.25)
DRAWER = ObjectType("drawer", (Attribute("position", XYZ, "m", -1.0, 2.0), EXTENSION), (EXTENSION,))
CUBE = ObjectType("cube", (Attribute("position", XYZ, "m", -3.0, 3.0),), (Attribute("position", XYZ, "m", -1.0, 2.0),))
BEFORE_CUBES = 12
"""Columns of a state before the first cube's: 7 of the hand, then the drawer's place, extension and goal."""


def horizon(cubes: int, closed: bool) -> int:
    """Return the control steps of an episode."""
    return STEPS_FOR_DRAWER * (1 + closed) + STEPS_PER_CUBE * cubes


def layout(cubes: int) -> Layout:
    """Describe a state: 7 numbers of the hand, 4 + 1 of the drawer and its goal, 3 + 3 of each cube and its goal."""
    return Layout(ROBOT, (DRAWER, *(CUBE,) * cubes))


@dataclass(frozen=True)
class Episode:
    """What differs from one episode to the next.

    Args:
        cabinet: (3,) where its origin is.
        ajar: extension of the drawer.
        places: (N, 2) of the cubes on the cabinet.
        goals: (N, 3) of the cubes in the open drawer.
    """

    cabinet: FloatArray
    ajar: float
    places: FloatArray
    goals: FloatArray


def draw(rng: Generator, cubes: int) -> Episode:
    """Draw an episode: where the cabinet stands, how far its drawer is open, what is where on it and in it.

    Every cube has a lane of its own, and its goal a slot of its own, both at random.
    """
    rows = 3 if cubes <= 3 else MOST_CUBES
    middle = (rows - 1) / 2
    cabinet = np.array(CABINET) + np.append(rng.uniform(-1.0, 1.0, size=2) * CABINET_JITTER, 0.0)
    ajar = float(rng.uniform(0.0, AJAR))
    lanes, slots = (rng.permutation(rows)[:cubes] - middle for _ in range(2))
    sideways = lanes * LANES[rows] + rng.uniform(-JITTER[rows], JITTER[rows], size=cubes)
    places = np.stack([rng.uniform(*START_X, size=cubes), sideways], axis=1)
    goals = np.stack([np.full(cubes, SLOT_X), slots * SLOTS[rows], np.full(cubes, SLOT_Z)], axis=1)
    goals[:, :2] += rng.uniform(-1.0, 1.0, size=(cubes, 2)) * SLOT_JITTER[rows]
    return Episode(cabinet, ajar, cabinet[:2] + places, cabinet + goals)


def inside(cubes: FloatArray, bar: FloatArray) -> BoolArray:
    """Tell which cubes are in the drawer.

    Args:
        cubes: (..., N, 3) positions.
        bar: (..., 3) middle of the drawer's handle.

    Returns:
        (..., N).
    """
    x, y, z = np.moveaxis(cubes - bar[..., None, :] + np.array(HANDLE), -1, 0)
    within = (x > TRAY_X[0]) & (x < TRAY_X[1]) & (np.abs(y) < TRAY_Y)
    return np.asarray(within & (z > TRAY_Z[0]) & (z < TRAY_Z[1]), dtype=np.bool_)


def solved(states: FloatArray, cubes: int, closed: bool) -> BoolArray:
    """Tell whether every cube is in the drawer, and the drawer shut again where it has to be.

    Args:
        states: (..., F).
        cubes: N.
        closed: whether the drawer has to be shut at the end.

    Returns:
        (...).
    """
    extension = states[..., 10]
    places = states[..., BEFORE_CUBES:].reshape(*states.shape[:-1], cubes, 6)[..., :3]
    done: BoolArray = inside(places, states[..., 7:10]).all(axis=-1)
    shut: BoolArray = extension < SHUT
    return done & shut if closed else done


def cube_goals(slots: FloatArray, extension: FloatArray, closed: bool) -> FloatArray:
    """Return where cubes are wanted, (..., N, 3).

    Args:
        slots: (..., N, 3) places in the open drawer.
        extension: (...) of the drawer.
        closed: whether the drawer has to be shut at the end; then places go with it, for cubes do.
    """
    shut = np.where(closed, TRAVEL - extension, 0.0)
    return np.asarray(slots + shut[..., None, None] * (1.0, 0.0, 0.0))


def drawer_columns(cabinet: FloatArray, extension: FloatArray, goal: float) -> FloatArray:
    """Return what a state says of the drawer (R, 5): place of its bar, extension, goal.

    Args:
        cabinet: (R, 3) where its origin is.
        extension: (R,) of the drawer.
        goal: its goal.
    """
    bar = cabinet + np.array(HANDLE) - extension[:, None] * (1.0, 0.0, 0.0)
    return np.concatenate([bar, extension[:, None], np.full((len(extension), 1), goal)], axis=1)
