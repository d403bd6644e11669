"""The physics steps of one control step of robosuite's OSC_POSE, without what robosuite does around each of them.

robosuite works out torques 25 times in a control step, and spends three quarters of its time on finding out, again and
again, which robot, arm, gripper and controller that is about. Here its controller takes up the action and decides the
first torques; what follows is the same arithmetic, in the same order, so that the states are the same bit for bit.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from roboscribe.world.layout import FloatArray


def steppable(env: Any, arm: str) -> bool:  # noqa: ANN401 - robosuite has no types
    """Tell whether `Substeps` does the same as an environment's own steps.

    It does for an arm on a fixed base under OSC_POSE with fixed gains and no interpolation, and a gripper whose
    fingers go where they are told once in a control step.
    """
    from robosuite.controllers.parts.arm.osc import OperationalSpaceController
    from robosuite.controllers.parts.gripper.simple_grip import SimpleGripController
    from robosuite.robots import FixedBaseRobot

    robot = env.robots[0]
    parts = dict(robot.part_controllers)
    osc = parts.pop(arm)
    plain = type(robot) is FixedBaseRobot and type(osc) is OperationalSpaceController and env.lite_physics
    return bool(
        plain
        and osc.impedance_mode == "fixed"
        and osc.uncoupling
        and osc.num_ref_sites == 1
        and osc.interpolator_pos is None
        and osc.interpolator_ori is None
        and all(type(other) is SimpleGripController and other.interpolator is None for other in parts.values())
    )


class Substeps:
    """Steps an environment.

    Args:
        env: see `steppable`.
        arm: name of the only arm.
    """

    def __init__(self, env: Any, arm: str) -> None:  # noqa: ANN401
        """Look up what stays the same from step to step, though not from reset to reset."""
        self._env, self._arm = env, arm
        self._count = int(env.control_timestep / env.model_timestep)
        size = env.sim.model.nv
        self._linear, self._angular = np.zeros((3, size)), np.zeros((3, size))
        self._mass = np.zeros((size, size))
        controller = env.robots[0].part_controllers[arm]
        self._joints, self._site = controller.qvel_index, env.sim.model.site_name2id(controller.ref_name)
        moved = len(self._joints)
        self._jacobian = np.zeros((6, moved))
        self._places, self._turns = np.zeros((3, moved)), np.zeros((3, moved))
        self._motors = env.robots[0]._ref_actuators_indexes_dict[arm]

    def step(self, action: FloatArray) -> None:
        """Apply one of robosuite's actions (A,) for a control step."""
        env = self._env
        env.sim.step1()
        env._pre_action(action, True)
        env.sim.step2()
        model, data = env.sim.model._model, env.sim.data._data
        controller = env.robots[0].part_controllers[self._arm]
        limits = model.actuator_ctrlrange[self._motors]
        goal = _goal(controller)
        for _ in range(self._count - 1):
            mujoco.mj_step1(model, data)
            data.ctrl[self._motors] = np.clip(self._torques(controller, goal), limits[:, 0], limits[:, 1])
            mujoco.mj_step2(model, data)

    def _torques(self, controller: Any, goal: tuple[FloatArray, FloatArray]) -> FloatArray:  # noqa: ANN401
        """Decide the arm's torques (J,) in the simulator's present state, as robosuite's controller does."""
        from robosuite.utils.control_utils import nullspace_torques, opspace_matrices, orientation_error

        model, data = self._env.sim.model._model, self._env.sim.data._data
        joints, kp, kd = self._joints, controller.kp, controller.kd
        mujoco.mj_jacSite(model, data, self._linear, self._angular, self._site)
        mujoco.mj_fullM(model, self._mass, data.qM)
        mass = self._mass[joints, :][:, joints]
        self._places[:], self._turns[:] = self._linear[:, joints], self._angular[:, joints]
        self._jacobian[:3], self._jacobian[3:] = self._places, self._turns
        place, axes = data.site_xpos[self._site], data.site_xmat[self._site].reshape(3, 3).copy()
        force = (goal[0] - place) * kp[:3] - np.dot(self._linear, data.qvel) * kd[:3]
        torque = orientation_error(goal[1], axes) * kp[3:6] - np.dot(self._angular, data.qvel) * kd[3:6]
        _, linear, angular, nullspace = opspace_matrices(mass, self._jacobian, self._places, self._turns)
        wrench = np.concatenate([np.dot(linear, force), np.dot(angular, torque)])
        moving = np.dot(self._jacobian.T, wrench) + data.qfrc_bias[joints]
        positions, speeds = data.qpos[controller.qpos_index], data.qvel[joints]
        resting = nullspace_torques(mass, nullspace, controller.initial_joint, positions, speeds)
        return np.asarray(moving + resting)


def _goal(controller: Any) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
    """Return the place (3,) and the axes (3, 3) that the controller steers to, in the world."""
    if controller.input_ref_frame != "base":
        return np.asarray(controller.goal_pos), np.asarray(controller.goal_ori)
    base, turn = controller.origin_pos, controller.origin_ori
    return base + np.dot(turn, controller.goal_pos), np.dot(turn, controller.goal_ori)
