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

FRAMES = tuple((0.031 + 0.0004 * k, (1.0, 0.6, 0.0, 1.0)) for k in range(4))
"""Half lengths of edges, m, and colours of frames around what is pointed at; lines are thin, so there are four."""
SKY = (214, 222, 232)
"""Colour behind the scene."""
SUN = (-0.35, -0.25, -0.9)
"""Direction of the light."""
SHADOWED = 1.2
"""Edge of the region around what is looked at within which shadows are drawn, m."""
SHADOWS, SAMPLES = 2048, 4
"""Pixels of a shadow's edge, and samples per pixel that smooth edges."""


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
        self._model, self._markers = _dressed(model, viewpoint), markers
        self._pointed: Sequence[FloatArray] = ()
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
        for place in self._pointed:
            for half, color in FRAMES:
                self._camera.add_frame(place, half, color)
        return self._camera.shoot()

    def point_at(self, places: Sequence[FloatArray]) -> None:
        """Put a frame around places (3,) from the next picture on."""
        self._pointed = tuple(place for place in places if len(place) == 3)

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self._camera.close()


def _dressed(model: mujoco.MjModel, viewpoint: Viewpoint) -> mujoco.MjModel:
    """Give a scene a pale sky, a light from the side with soft shadows, and smooth edges."""
    quality = model.vis.quality
    quality.shadowsize, quality.offsamples = SHADOWS, SAMPLES
    model.vis.map.shadowclip = SHADOWED / model.stat.extent
    model.light_castshadow[:] = 1
    model.light_dir[:] = np.array(SUN) / np.linalg.norm(SUN)
    model.light_pos[:] = np.array(viewpoint.lookat) - 2.0 * model.light_dir
    for texture in np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX):
        start, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
        pixels = int(model.tex_height[texture]) * int(model.tex_width[texture])
        model.tex_data[start : start + pixels * channels] = np.tile(np.array(SKY[:channels], dtype=np.uint8), pixels)
    return model
