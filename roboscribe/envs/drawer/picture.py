"""Pictures of PlaceCubesDrawer."""

from __future__ import annotations

import mujoco

from roboscribe.envs.drawer import geometry
from roboscribe.envs.drawer.model import picture_model
from roboscribe.envs.scene_painter import Marker, ScenePainter, Viewpoint
from roboscribe.world.layout import FloatArray

VIEWPOINT = Viewpoint((0.02, 0.0, 0.9), 1.15, -60.0, -38.0)
GOAL_RADIUS, GOAL_OPACITY = 0.022, 0.4
HIDDEN = 4
"""A group of geoms that is not drawn."""


def dressed(cubes: int) -> mujoco.MjModel:
    """Return the scene to draw, with what is only there for contacts hidden, and robosuite's markers, too."""
    model = mujoco.MjModel.__copy__(picture_model(cubes))
    model.geom_group[model.geom_group == 0] = HIDDEN
    model.site_rgba[:, 3] = 0
    return model


def goal_markers(state: FloatArray) -> list[Marker]:
    """Mark the cubes' slots, in their colours."""
    slots = state[geometry.BEFORE_CUBES :].reshape(-1, 6)[:, 3:]
    colors = (geometry.COLORS[index % len(geometry.COLORS)] for index in range(len(slots)))
    return [Marker(place, GOAL_RADIUS, (*color, GOAL_OPACITY)) for place, color in zip(slots, colors, strict=True)]


def painter(cubes: int, size: tuple[int, int]) -> ScenePainter | None:
    """Draw the scene by MuJoCo; None, said in one line, where there is no OpenGL."""
    return ScenePainter.opened(dressed(cubes), VIEWPOINT, goal_markers, size)
