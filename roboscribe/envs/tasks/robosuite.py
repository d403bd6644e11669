"""Any single-arm environment of the installed robosuite, in its own stepping: `robosuite:NAME`.

Options follow the name: `robosuite:Lift,robot=Sawyer,controller=OSC_POSE`. The controller HELD, which is the default,
is robosuite's OSC_POSE with the hand's direction held: an action is a displacement and the fingers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script, ScriptedTask
from roboscribe.envs.drawer import geometry
from roboscribe.envs.drawer.script import SCRIPT
from roboscribe.envs.suite.bench import bench
from roboscribe.envs.suite.moves import SCRIPTS
from roboscribe.envs.suite.picture import SuitePainter
from roboscribe.envs.suite.request import DRAWER, SuiteRequest, parse
from roboscribe.envs.suite.world import SuiteWorld
from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, Layout
from roboscribe.world.task import Task

HORIZONS = {"Lift": 120, "Stack": 220}
"""Control steps of an episode; other environments' have `LONG`, PlaceCubesDrawer what its cubes take."""
LONG = 500
SCRIPTED_ROBOT = "Panda"
"""The scripts of Lift and Stack know its fingers."""


@dataclass(frozen=True)
class SuiteTask(Task):
    """An environment of robosuite.

    Args:
        name: name in the catalogue.
        request: what it asks for.
        horizon: control steps of an episode.
        action_size: count of numbers in an action.
        frequency: control steps per second.
    """

    name: str
    request: SuiteRequest
    horizon: int
    action_size: int
    frequency: float
    most_rows: ClassVar[int] = 32

    @property
    def layout(self) -> Layout:
        """Meaning of a state's columns, as the environment's observables say."""
        return bench(self.request).layout

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: the environment's own check of success, which states (..., F) hold as a flag; returns (...)."""
        flag: BoolArray = states[..., self.layout.columns[ROBOT, "solved", False].start] > 0.5
        return flag

    def world(self, batch: int) -> SuiteWorld:
        """Build a world of `batch` rows."""
        return SuiteWorld(self.request, batch)

    def painter(self, width: int, height: int) -> SuitePainter | None:
        """Draw the environment by MuJoCo; None without OpenGL."""
        return SuitePainter.opened(self.request, (width, height))


@dataclass(frozen=True)
class ScriptedSuiteTask(SuiteTask, ScriptedTask):
    """An environment of robosuite for which there is a script."""

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return SCRIPTS[self.request.environment]


@dataclass(frozen=True)
class SuiteDrawer(ScriptedSuiteTask):
    """PlaceCubesDrawer in robosuite's own stepping; states are those of the batched task, and so are programs."""

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        return SCRIPT

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: every cube in the drawer, shut where it has to be; states (..., F), returns (...)."""
        return geometry.solved(states, self.request.cubes, self.request.closed)


@register("robosuite:NAME", examples=("robosuite:Lift",))
def robosuite_task(request: Request) -> Task:
    """Make the task of an environment.

    Raises:
        TaskError: robosuite has no such environment, or it cannot be a task.
    """
    wanted = parse(request.blanks[0])
    horizon, one = HORIZONS.get(wanted.environment, LONG), bench(wanted)
    made: type[SuiteTask] = SuiteTask
    if wanted.environment == DRAWER:
        made, horizon = SuiteDrawer, geometry.horizon(wanted.cubes, wanted.closed)
    elif wanted.environment in SCRIPTS and wanted.held and wanted.robot == SCRIPTED_ROBOT:
        made = ScriptedSuiteTask
    return made(request.name, wanted, horizon, one.action_size, one.frequency)
