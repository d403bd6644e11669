"""Off-screen pictures of MuJoCo scenes through EGL or OSMesa, whichever library is installed."""

from __future__ import annotations

import logging
import os
from ctypes.util import find_library
from importlib import import_module
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
MISSING = "no OpenGL for pictures of the robot (Debian packages: libegl1 or libosmesa6); drawing a schematic instead"
SHADOWS = 1024
"""Texels along each side of a shadow map; MuJoCo's own 4096 take long where no graphics card draws."""
log = logging.getLogger(__name__)


def backends() -> list[str]:
    """List the usable ways to draw, best first; MUJOCO_GL picks one, or none ("off", "disabled")."""
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    if chosen in ("off", "disable", "disabled", "false", "0"):
        return []
    wanted = [chosen] if chosen in LIBRARIES else list(LIBRARIES)
    return [name for name in wanted if find_library(LIBRARIES[name])]


class Context(Protocol):
    """An off-screen OpenGL context, as MuJoCo's backends make them."""

    def make_current(self) -> None:
        """Let this thread draw into it."""

    def free(self) -> None:
        """Give it back."""


def open_context(width: int, height: int) -> Context | None:
    """Make an off-screen OpenGL context current; None, said in one line, where that does not work.

    The context is built here and not by `mujoco.Renderer`, which fixes its backend when mujoco is imported.
    """
    reason = ""
    for backend in backends()[:1]:
        try:
            context: Context = import_module(f"mujoco.{backend}").GLContext(width, height)
            context.make_current()
        except (ImportError, RuntimeError, AttributeError) as error:
            reason = f" [{backend}: {error}]"
        else:
            return context
    log.warning("%s%s", MISSING, reason)
    return None


class Camera:
    """Takes pictures of one model; keep it on the thread that made it.

    Args:
        model: what is drawn; its off-screen buffer is enlarged as needed.
        context: from `open_context`.
        size: width and height, pixels.
    """

    def __init__(self, model: mujoco.MjModel, context: Context, size: tuple[int, int]) -> None:
        """Prepare the buffers."""
        self._context = context
        self._rect = mujoco.MjrRect(0, 0, *size)
        model.vis.quality.shadowsize = SHADOWS
        model.vis.global_.offwidth, model.vis.global_.offheight = size
        self._model = model
        self.view = mujoco.MjvCamera()
        self._option = mujoco.MjvOption()
        self.scene = mujoco.MjvScene(model, maxgeom=1000)
        self._render = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._render)

    def aim(self, data: mujoco.MjData) -> None:
        """Build the scene of `data`; spheres may be added before `shoot`."""
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, data, self._option, None, self.view, everything, self.scene)

    def add_sphere(self, place: NDArray[np.float64], radius: float, color: tuple[float, ...]) -> None:
        """Add a sphere at `place` (3,), of `radius` m, colour red, green, blue, opacity in [0, 1]."""
        self._add(mujoco.mjtGeom.mjGEOM_SPHERE, place, radius, color)

    def add_frame(self, place: NDArray[np.float64], half: float, color: tuple[float, ...]) -> None:
        """Add the edges of a cube around `place` (3,), their length twice `half` m, colour as above."""
        self._add(mujoco.mjtGeom.mjGEOM_LINEBOX, place, half, color)

    def _add(self, kind: mujoco.mjtGeom, place: NDArray[np.float64], size: float, color: tuple[float, ...]) -> None:
        """Add a shape of the picture alone, which throws no shadow."""
        geom = self.scene.geoms[self.scene.ngeom]
        mujoco.mjv_initGeom(geom, kind, np.full(3, size), place, np.eye(3).ravel(), np.array(color, dtype=np.float32))
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        self.scene.ngeom += 1

    def shoot(self) -> NDArray[np.uint8]:
        """Draw the scene: (height, width, 3)."""
        picture = np.empty((self._rect.height, self._rect.width, 3), dtype=np.uint8)
        self._context.make_current()
        mujoco.mjr_render(self._rect, self.scene, self._render)
        mujoco.mjr_readPixels(picture, None, self._rect, self._render)
        return picture[::-1]

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self._render.free()
        self._context.free()
