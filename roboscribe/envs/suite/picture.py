"""Pictures of robosuite's environments."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from roboscribe.envs import graphics
from roboscribe.envs.suite.bench import Bench
from roboscribe.envs.suite.request import SuiteRequest
from roboscribe.world.layout import FloatArray

CAMERA = "frontview"
"""robosuite's camera that shows robot and table."""
HIDDEN = 4
"""A group of geoms that is not drawn."""


class SuitePainter:
    """Draws an environment with one of its own cameras.

    Args:
        request: which environment.
        context: from `graphics.open_context`.
        size: width and height, pixels.
    """

    def __init__(self, request: SuiteRequest, context: graphics.Context, size: tuple[int, int]) -> None:
        """Build an environment of its own, whose shapes for contacts are hidden."""
        self._bench = Bench(request)
        sim = self._bench.env.sim
        self._data = sim.data._data
        model = sim.model._model
        model.geom_group[model.geom_group == 0] = HIDDEN
        self._camera = graphics.Camera(model, context, size)
        self._camera.view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.view.fixedcamid = model.camera(CAMERA).id

    @classmethod
    def opened(cls, request: SuiteRequest, size: tuple[int, int]) -> SuitePainter | None:
        """Build a painter with an OpenGL context of its own; None, said in one line, where there is no OpenGL."""
        context = graphics.open_context(*size)
        return None if context is None else cls(request, context, size)

    def __call__(self, state: FloatArray, snapshot: FloatArray) -> NDArray[np.uint8]:
        """Draw a snapshot (S,)."""
        del state
        self._bench.load(snapshot)
        self._camera.aim(self._data)
        return self._camera.shoot()

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self._camera.close()
