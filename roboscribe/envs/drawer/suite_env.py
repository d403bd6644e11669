"""PlaceCubesDrawer as a robosuite environment; importing this file registers it as `PlaceCubesDrawer`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np
from robosuite.controllers import load_composite_controller_config
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.arenas import TableArena
from robosuite.models.objects import BoxObject, MujocoXMLObject
from robosuite.models.robots import RobotModel
from robosuite.models.tasks import ManipulationTask
from robosuite.robots import FixedBaseRobot
from robosuite.utils.observables import Observable, sensor

from roboscribe.envs.drawer import geometry
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray

BASE, SHOULDER = "robot0_right_arm_base_link", "robot0_right_l0"
"""Hulls of the robot that touch in every pose: left so, the first joint sticks and the hand stops 1 to 2 cm short."""


def controllers() -> dict[str, Any]:
    """Return robosuite's own control of the Sawyer's pose, with `geometry.REACH` as its greatest displacement."""
    config: dict[str, Any] = load_composite_controller_config(controller="BASIC", robot="Sawyer")
    arm = config["body_parts"]["right"]
    arm["output_max"] = [geometry.REACH] * 3 + [0.5] * 3
    arm["output_min"] = [-geometry.REACH] * 3 + [-0.5] * 3
    return config


def scene(robot: RobotModel, cubes: int) -> ManipulationTask:
    """Put table, cabinet and cubes before a robot with its gripper."""
    robot.set_base_xpos(robot.base_xpos_offset["table"](0.8))
    arena = TableArena(table_full_size=(0.8, 0.8, 0.05), table_offset=np.array(geometry.TABLE_OFFSET))
    arena.set_origin([0, 0, 0])
    cabinet = MujocoXMLObject(str(geometry.CABINET_FILE), name="cabinet", joints=None)
    cabinet.set_pos(geometry.CABINET)
    half = [geometry.HALF_CUBE] * 3
    boxes = [
        BoxObject(f"cube{i}", size=half, rgba=(*geometry.COLORS[i % len(geometry.COLORS)], 1.0)) for i in range(cubes)
    ]
    task = ManipulationTask(arena, [robot], [cabinet, *boxes])
    for one, other in ((BASE, SHOULDER), ("cabinet_main", "cabinet_drawer")):
        task.contact.append(ElementTree.Element("exclude", body1=one, body2=other))
    return task


def scene_xml(cubes: int) -> str:
    """Return the scene as MuJoCo reads it, without building an environment (which takes seconds)."""
    sawyer = FixedBaseRobot("Sawyer", idn=0)
    sawyer.load_model()
    xml: str = scene(sawyer.robot_model, cubes).get_xml()
    return xml


# robosuite's classes are not typed.
class PlaceCubesDrawer(ManipulationEnv):  # type: ignore[misc]
    """A Sawyer at a table with a cabinet; every cube on it has to be put into its drawer.

    Args:
        robots: "Sawyer"; the start pose is this robot's.
        cubes: how many, 1 to 5.
        closed: whether the drawer has to be shut at the end.
        controller_configs: None for `controllers()`.
        options: as `ManipulationEnv` takes them.

    Raises:
        TaskError: another robot, or a number of cubes that does not fit.
    """

    def __init__(
        self,
        robots: str = "Sawyer",
        cubes: int = 3,
        closed: bool = False,
        controller_configs: dict[str, Any] | None = None,
        **options: Any,  # noqa: ANN401 - handed on to a library without types
    ) -> None:
        """Build the scene."""
        if robots not in ("Sawyer", ["Sawyer"]) or not 1 <= cubes <= geometry.MOST_CUBES:
            msg = f"{robots} with {cubes} cubes: expected Sawyer with 1 to {geometry.MOST_CUBES}"
            raise TaskError(msg)
        self.cubes_count, self.closed = cubes, closed
        self.episode = geometry.draw(np.random.default_rng(0), cubes)
        options = {"control_freq": geometry.FREQUENCY, "initialization_noise": None, **options}
        super().__init__(robots=robots, controller_configs=controller_configs or controllers(), **options)

    def reward(self, action: FloatArray | None = None) -> float:
        """1 where the task is solved, else 0."""
        del action
        return float(self._check_success())

    def _load_model(self) -> None:
        """Put table, cabinet and cubes before the robot."""
        super()._load_model()
        robot = self.robots[0]
        robot.init_qpos = np.array(geometry.START_JOINTS)
        self.model = scene(robot.robot_model, self.cubes_count)
        self.cubes = self.model.mujoco_objects[1:]

    def _reset_internal(self) -> None:
        """Put cabinet, drawer and cubes where the environment's own random numbers say."""
        # Drawn before the robot draws its noise: the same numbers give the same start as in the batched world.
        episode = geometry.draw(self.rng, self.cubes_count)
        super()._reset_internal()
        self.place(episode)

    def place(self, episode: geometry.Episode) -> None:
        """Put everything where an episode begins, and remember the cubes' goals."""
        self.episode = episode
        height = geometry.CABINET_TOP + geometry.HALF_CUBE
        for cube, place in zip(self.cubes, episode.places, strict=True):
            self.sim.data.set_joint_qpos(cube.joints[0], np.array([*place, height, 1.0, 0.0, 0.0, 0.0]))
        self.sim.model.body_pos[self.sim.model.body_name2id("cabinet_main")] = episode.cabinet
        self.sim.data.set_joint_qpos("cabinet_slide", episode.ajar)

    @property
    def extension(self) -> float:
        """How far the drawer is open, m."""
        return float(self.sim.data.get_joint_qpos("cabinet_slide"))

    @property
    def bar(self) -> FloatArray:
        """Middle (3,) of the drawer's handle."""
        return np.array(self.sim.data.get_site_xpos("cabinet_handle"))

    @property
    def cube_positions(self) -> FloatArray:
        """Centres (N, 3) of the cubes."""
        return np.array([self.sim.data.get_body_xpos(cube.root_body) for cube in self.cubes])

    @property
    def cube_goals(self) -> FloatArray:
        """Where the cubes are wanted (N, 3), with the drawer as it is."""
        return geometry.cube_goals(self.episode.goals, np.array(self.extension), self.closed)

    def _check_success(self) -> bool:
        """Tell whether every cube is in the drawer, and the drawer shut where it has to be."""
        done = bool(geometry.inside(self.cube_positions, self.bar).all())
        return done and (self.extension < geometry.SHUT or not self.closed)

    def _setup_observables(self) -> dict[str, Observable]:
        """Add handle, extension, cubes and goals to the robot's observables."""
        observables: dict[str, Observable] = super()._setup_observables()
        for name, observe in self._readings().items():
            observables[name] = Observable(name, sensor(modality="object")(observe), sampling_rate=self.control_freq)
        return observables

    def _readings(self) -> dict[str, Callable[[object], FloatArray]]:
        """List what is observed of the scene; each reading takes robosuite's cache, which it does not need."""

        def cube(index: int) -> Callable[[object], FloatArray]:
            return lambda _: np.asarray(self.cube_positions[index])

        def slot(index: int) -> Callable[[object], FloatArray]:
            return lambda _: self.cube_goals[index]

        found: dict[str, Callable[[object], FloatArray]] = {
            "drawer_pos": lambda _: self.bar,
            "drawer_extension": lambda _: np.array([self.extension]),
        }
        indices = range(self.cubes_count)
        return found | {f"cube{i}_pos": cube(i) for i in indices} | {f"cube{i}_goal": slot(i) for i in indices}
