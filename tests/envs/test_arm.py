"""The chain of hinges and its control agree with MuJoCo and with the formulas of robosuite."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from roboscribe.envs.arm import osc
from roboscribe.envs.arm.chain import Chain, Pose
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray

ARM = """<mujoco><option gravity="0 0 0"/><worldbody><body pos="0.1 0 0.2"><body name="one">
  <joint name="a" axis="0 0 1" armature="0.1"/><geom type="capsule" fromto="0 0 0 0.1 0 0.2" size="0.05"/>
  <body name="two" pos="0.1 0 0.2" quat="0.7 0.7 0.1 0"><joint name="b" axis="0 0 1"/>
  <geom type="box" size="0.1 0.05 0.02" pos="0.1 0 0.05"/><body name="three" pos="0.2 0.05 0.1" quat="0.6 0 0.8 0">
  <joint name="c" axis="0 1 0"/><geom type="box" size="0.02 0.03 0.1" pos="0 0.02 0.1"/>
  <body pos="0 0 0.2"><geom type="sphere" size="0.04"/><site name="hand" pos="0.01 0.02 0.05" quat="0.9 0.1 0 0.3"/>
  </body></body></body></body></body></worldbody></mujoco>"""
JOINTS = ("a", "b", "c")


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(ARM)


@pytest.fixture(scope="module")
def angles() -> FloatArray:
    return np.random.default_rng(0).uniform(-2, 2, size=(5, 3))


def truth(model: mujoco.MjModel, one: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    data = mujoco.MjData(model)
    data.qpos[:] = one
    mujoco.mj_forward(model, data)
    jacobian, inertia = np.zeros((6, 3)), np.zeros((3, 3))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], 0)
    mujoco.mj_fullM(model, inertia, data.qM)
    return data.site_xpos[0].copy(), data.site_xmat[0].reshape(3, 3).copy(), jacobian, inertia


def test_kinematics_and_inertia_are_mujocos(model: mujoco.MjModel, angles: FloatArray) -> None:
    chain = Chain(model, JOINTS, "hand")
    pose = chain.pose(angles)
    inertia = chain.inertia(pose)
    for row, one in enumerate(angles):
        hand, rotation, jacobian, expected = truth(model, one)
        assert np.allclose(pose.hand[row], hand, atol=1e-12)
        assert np.allclose(pose.rotation[row], rotation, atol=1e-12)
        assert np.allclose(pose.jacobian[row], jacobian, atol=1e-12)
        assert np.allclose(inertia[row], expected, atol=1e-12)


def test_a_row_is_the_same_alone(model: mujoco.MjModel, angles: FloatArray) -> None:
    chain = Chain(model, JOINTS, "hand")
    assert (chain.inertia(chain.pose(angles))[2] == chain.inertia(chain.pose(angles[2:3]))[0]).all()


def test_a_joint_that_is_no_hinge_is_refused() -> None:
    text = ARM.replace('name="b" axis="0 0 1"', 'name="b" type="slide" axis="0 0 1"')
    with pytest.raises(TaskError, match="expected hinges"):
        Chain(mujoco.MjModel.from_xml_string(text), JOINTS, "hand")


def test_rotations_and_their_errors_are_inverse() -> None:
    small = np.array([[0.02, -0.01, 0.03], [0.0, 0.0, 0.0]])
    turned = osc.rotate(small)
    assert np.allclose(turned @ turned.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(osc.turn_error(turned, np.broadcast_to(np.eye(3), (2, 3, 3))), small, atol=1e-5)


def test_a_quarter_turn() -> None:
    assert np.allclose(osc.rotate(np.array([0.0, 0.0, np.pi / 2])) @ (1, 0, 0), (0, 1, 0))


def test_a_pose_says_what_moves_the_hand(model: mujoco.MjModel, angles: FloatArray) -> None:
    chain, step = Chain(model, JOINTS, "hand"), 1e-6
    pose: Pose = chain.pose(angles)
    moved = chain.pose(angles + step * np.array([0.0, 1.0, 0.0])).hand - pose.hand
    assert np.allclose(moved / step, pose.jacobian[:, :3, 1], atol=1e-5)
