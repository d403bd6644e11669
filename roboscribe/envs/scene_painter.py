"""Pictures of MuJoCo scenes from one viewpoint, with markers for what the scene does not contain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from roboscribe.envs import graphics
from roboscribe.envs.engine import INTEGRATION
from roboscribe.world.layout import FloatArray


@dataclass(frozen=True)
class Viewpoint:
    """Where a camera is.

    Args:
        lookat: (3,) the point it looks at, m.
        distance: from there, m.
        azimuth: degrees around the vertical.
        elevation: degrees above the horizontal, negative where the camera looks down.
    """

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float


@dataclass(frozen=True)
class Marker:
    """A translucent sphere.

    Args:
        place: (3,) m.
        radius: m.
        color: red, green, blue, opacity in [0, 1].
    """

    place: FloatArray
    radius: float
    color: tuple[float, ...]


Markers: TypeAlias = Callable[[FloatArray], Sequence[Marker]]
"""Tells what to mark in a state (F,), goals for instance."""


class ScenePainter:
    """Draws a scene with MuJoCo.

    Args:
        model: what is drawn; its off-screen buffer is enlarged as needed.
        viewpoint: from where.
        markers: what is marked.
        context: from `graphics.open_context`.
        size: width and height, pixels.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        viewpoint: Viewpoint,
        markers: Markers,
        context: graphics.Context,
        size: tuple[int, int],
    ) -> None:
        """Prepare the scene and the camera."""
        self._model, self._markers = model, markers
        self._data = mujoco.MjData(model)
        self._size = mujoco.mj_stateSize(model, INTEGRATION)
        self._camera = graphics.Camera(model, context, size)
        view = self._camera.view
        view.lookat[:] = viewpoint.lookat
        view.distance, view.azimuth, view.elevation = viewpoint.distance, viewpoint.azimuth, viewpoint.elevation

    @classmethod
    def opened(
        cls, model: mujoco.MjModel, viewpoint: Viewpoint, markers: Markers, size: tuple[int, int]
    ) -> ScenePainter | None:
        """Build a painter with an OpenGL context of its own; None, said in one line, where there is no OpenGL."""
        context = graphics.open_context(*size)
        return None if context is None else cls(model, viewpoint, markers, context, size)

    def __call__(self, state: FloatArray, snapshot: FloatArray) -> NDArray[np.uint8]:
        """Draw the snapshot (its first numbers are an integration state) with what is marked in the state (F,)."""
        mujoco.mj_setState(self._model, self._data, np.ascontiguousarray(snapshot[: self._size]), INTEGRATION)
        mujoco.mj_forward(self._model, self._data)
        self._camera.aim(self._data)
        for marker in self._markers(state):
            self._camera.add_sphere(marker.place, marker.radius, marker.color)
        return self._camera.shoot()

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self._camera.close()
