"""PlaceCubesDrawer: open a drawer by its handle, put every cube into it and, where asked for, shut it again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script, ScriptedTask
from roboscribe.envs.drawer import geometry, picture
from roboscribe.envs.drawer.script import SCRIPT
from roboscribe.envs.drawer.world import DrawerWorld
from roboscribe.envs.scene_painter import ScenePainter
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, Layout


@dataclass(frozen=True)
class PlaceCubes(ScriptedTask):
    """The task of putting N cubes into a drawer.

    Args:
        name: name in the catalogue.
        cubes: N.
        timing: "faithful" (25 torques of 2 ms) or "fast" (5 of 10 ms) in a control step.
        closed: whether the drawer has to be shut at the end.
        horizon: control steps of an episode.
    """

    name: str
    cubes: int = 3
    timing: str = "fast"
    closed: bool = False
    horizon: int = 390
    action_size: int = 4
    frequency: float = geometry.FREQUENCY

    def __post_init__(self) -> None:
        """Refuse what does not fit into the drawer.

        Raises:
            TaskError: no cube, or too many.
        """
        if not 1 <= self.cubes <= geometry.MOST_CUBES:
            msg = f"{self.name}: {self.cubes} cubes, expected 1 to {geometry.MOST_CUBES}"
            raise TaskError(msg)

    @cached_property
    def layout(self) -> Layout:
        """Meaning of a state's columns."""
        return geometry.layout(self.cubes)

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: every cube in the drawer, which is shut again where it has to be; states (..., F), returns (...)."""
        return geometry.solved(states, self.cubes, self.closed)

    def world(self, batch: int) -> DrawerWorld:
        """Build a world of `batch` rows."""
        return DrawerWorld(self.cubes, self.closed, self.timing, batch)

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return SCRIPT

    def painter(self, width: int, height: int) -> ScenePainter | None:
        """Draw the scene by MuJoCo, with the goals as translucent spheres; None without OpenGL."""
        return picture.painter(self.cubes, (width, height))


@register("place-cubes-drawer-N", "place-cubes-drawer-N-closed", examples=("place-cubes-drawer-3",))
def place_cubes(request: Request) -> PlaceCubes:
    """Make the task of N cubes."""
    cubes, closed = request.number, request.name.endswith("-closed")
    return PlaceCubes(request.name, cubes, request.timing, closed, geometry.horizon(cubes, closed))
