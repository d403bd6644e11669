"""Operational-space control of the hand's pose, as robosuite's OSC_POSE does it, for many arms at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.envs.arm.chain import Chain, Pose, cross, cross_matrix
from roboscribe.world.layout import FloatArray


@dataclass(frozen=True)
class Gains:
    """Stiffness of the control; damping is critical.

    Args:
        hand: of the hand's place and direction, 1/s².
        rest: of the joints towards their rest pose where the hand does not need them, 1/s².
    """

    hand: float = 150.0
    rest: float = 10.0


def turn_error(wanted: FloatArray, present: FloatArray) -> FloatArray:
    """Return the rotation (..., 3) that turns `present` (..., 3, 3) into `wanted`: axis times sine, about its angle."""
    return np.asarray(0.5 * cross(present.swapaxes(-1, -2), wanted.swapaxes(-1, -2)).sum(axis=-2))


def rotate(vectors: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) of axis times angle (..., 3)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    spin = cross_matrix(vectors)
    # sin(a)/a and (1 − cos a)/a², which are 1 and 1/2 at 0.
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * spin + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * spin @ spin)


def torques(
    chain: Chain, angles: FloatArray, speeds: FloatArray, goal: tuple[FloatArray, FloatArray], rest: FloatArray
) -> FloatArray:
    """Decide joint torques (B, J), gravity not included.

    Args:
        chain: the arm.
        angles: (B, J) joint angles.
        speeds: (B, J) joint velocities.
        goal: place (B, 3) and axes (B, 3, 3) that the hand shall have.
        rest: (J,) angles preferred where the hand leaves a choice.
    """
    gains, pose = Gains(), chain.pose(angles)
    inertia = chain.inertia(pose)
    moves = pose.jacobian.transpose(0, 2, 1)
    # Inverse of the inertia that the hand feels, (B, 6, 6).
    mobility = pose.jacobian @ np.linalg.solve(inertia, moves)
    wanted = _acceleration(gains, pose, speeds, goal)
    force = np.linalg.solve(mobility[:, :3, :3], wanted[:, :3])
    torque = np.linalg.solve(mobility[:, 3:, 3:], wanted[:, 3:])
    relax = gains.rest * (rest - angles) - 2 * np.sqrt(gains.rest) * speeds
    # Of the torques that relax the joints, what would move the hand is taken away.
    disturbs = np.linalg.solve(mobility, pose.jacobian @ relax[..., None])
    wrench = np.concatenate([force, torque], axis=1) - disturbs
    return np.asarray((moves @ wrench + inertia @ relax[..., None])[..., 0])


def _acceleration(gains: Gains, pose: Pose, speeds: FloatArray, goal: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the hand's wanted acceleration (B, 6, 1), linear and angular."""
    error = np.concatenate([goal[0] - pose.hand, turn_error(goal[1], pose.rotation)], axis=1)
    velocity = pose.jacobian @ speeds[..., None]
    return np.asarray(gains.hand * error[..., None] - 2 * np.sqrt(gains.hand) * velocity)
