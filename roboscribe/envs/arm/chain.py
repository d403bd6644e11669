"""A chain of hinges, for any number of copies at once: where its hand is, how it moves, and what it weighs.

Bodies that no joint of the chain moves against each other (a gripper and its fingers at rest) count as one link.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray


@dataclass(frozen=True)
class Pose:
    """A chain of J hinges in B configurations; vectors in the world's axes, places from the world's origin, m.

    Args:
        hand: (B, 3) place of the hand.
        rotation: (B, 3, 3) its axes as columns.
        jacobian: (B, 6, J) the hand's linear velocity, then its angular velocity, per joint velocity.
        turns: (B, J, 3, 3) axes of every link.
        joints: (B, J, 3) places of the joints.
    """

    hand: FloatArray
    rotation: FloatArray
    jacobian: FloatArray
    turns: FloatArray
    joints: FloatArray


def cross_matrix(vectors: FloatArray) -> FloatArray:
    """Return matrices (..., 3, 3) that take the cross product with vectors (..., 3) from the left."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.asarray(np.stack(rows, axis=-1).reshape(*x.shape, 3, 3))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a × b over the last axis; NumPy's own takes several times as long on short vectors."""
    first = a[..., [1, 2, 0]] * b[..., [2, 0, 1]]
    return np.asarray(first - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])


def _onwards(parts: FloatArray, axis: int) -> FloatArray:
    """Add up, for every link, what it carries: itself and all that follow along the axis."""
    return np.flip(np.cumsum(np.flip(parts, axis), axis), axis)


class Chain:
    """Kinematics and inertia of the hinges between a fixed base and a site.

    Args:
        model: holds the chain; its `qpos0` says how what is not in the chain (fingers) stands.
        joints: names of the hinges, from the base on, each moving the next.
        site: the hand.

    Raises:
        TaskError: a joint is no hinge, or turns about a point other than its body's origin.
    """

    def __init__(self, model: mujoco.MjModel, joints: tuple[str, ...], site: str) -> None:
        """Read what stays the same in every configuration."""
        ids = [model.joint(name).id for name in joints]
        hinges = (model.jnt_type[ids] == mujoco.mjtJoint.mjJNT_HINGE).all() and not model.jnt_pos[ids].any()
        if not hinges:
            msg = f"joints {', '.join(joints)}: expected hinges about the origins of their bodies"
            raise TaskError(msg)
        data = mujoco.MjData(model)
        data.qpos[model.jnt_qposadr[ids]] = 0.0
        mujoco.mj_forward(model, data)
        bodies = model.jnt_bodyid[ids]
        turns, places = data.xmat[bodies].reshape(-1, 3, 3), data.xpos[bodies]
        self.origin: FloatArray = places[0].copy()
        before = np.concatenate([np.eye(3)[None], turns[:-1]])
        relative = before.transpose(0, 2, 1) @ turns
        spin = cross_matrix(model.jnt_axis[ids])
        self._parts = (relative, relative @ spin, relative @ spin @ spin)
        steps = places - np.concatenate([places[:1], places[:-1]])
        self._steps = (before.transpose(0, 2, 1) @ steps[..., None])[..., 0]
        self._axes: FloatArray = model.jnt_axis[ids].copy()
        self._armature: FloatArray = model.dof_armature[model.jnt_dofadr[ids]].copy()
        tip = model.site(site).id
        self._hand = turns[-1].T @ (data.site_xpos[tip] - places[-1])
        self._hand_turn = turns[-1].T @ data.site_xmat[tip].reshape(3, 3)
        self._weigh(model, data, bodies, turns, places)

    def _weigh(
        self, model: mujoco.MjModel, data: mujoco.MjData, bodies: FloatArray, turns: FloatArray, places: FloatArray
    ) -> None:
        """Add up mass, first moment and inertia of what every joint moves and the next does not."""
        count, rank = len(bodies), {int(body): j for j, body in enumerate(bodies)}
        self._mass: FloatArray = np.zeros(count)
        self._moment, self._inertia = np.zeros((count, 3)), np.zeros((count, 3, 3))
        for body in range(1, model.nbody):
            above = body
            while above and above not in rank:
                above = int(model.body_parentid[above])
            if above:
                j, mass = rank[above], float(model.body_mass[body])
                place = turns[j].T @ (data.xipos[body] - places[j])
                axes = turns[j].T @ data.ximat[body].reshape(3, 3)
                offset = cross_matrix(place)
                self._mass[j] += mass
                self._moment[j] += mass * place
                self._inertia[j] += axes @ np.diag(model.body_inertia[body]) @ axes.T - mass * offset @ offset

    def pose(self, angles: FloatArray) -> Pose:
        """Find where everything is at joint angles (B, J)."""
        sine, versine = np.sin(angles)[..., None, None], (1 - np.cos(angles))[..., None, None]
        local = self._parts[0] + sine * self._parts[1] + versine * self._parts[2]
        turns, joints = np.empty_like(local), np.empty((*angles.shape, 3))
        turns[:, 0], joints[:, 0] = local[:, 0], self.origin
        for j in range(1, angles.shape[1]):
            joints[:, j] = joints[:, j - 1] + turns[:, j - 1] @ self._steps[j]
            turns[:, j] = turns[:, j - 1] @ local[:, j]
        hand = joints[:, -1] + turns[:, -1] @ self._hand
        axes = (turns @ self._axes[..., None])[..., 0]
        jacobian = np.concatenate([cross(axes, hand[:, None] - joints), axes], axis=2).transpose(0, 2, 1)
        return Pose(hand, turns[:, -1] @ self._hand_turn, jacobian, turns, joints)

    def inertia(self, pose: Pose) -> FloatArray:
        """Return the joint-space inertia (B, J, J): composite rigid bodies, all about the first joint's place."""
        joints, axes = pose.joints - self.origin, pose.jacobian[:, 3:].transpose(0, 2, 1)
        moment: FloatArray = (pose.turns @ self._moment[..., None])[..., 0]
        # About the origin o: I_o = I_j + m(|p|² 1 − p pᵀ) + terms of the first moment, all as −[·]×[·]×.
        place, first = cross_matrix(joints), cross_matrix(moment)
        mass = self._mass[:, None, None]
        about = pose.turns @ self._inertia @ pose.turns.transpose(0, 1, 3, 2)
        about -= place @ (first + mass * place) + first @ place
        moment = _onwards(np.asarray(moment + joints * self._mass[:, None], dtype=np.float64), 1)
        total = _onwards(self._mass, 0)
        about = _onwards(np.asarray(about, dtype=np.float64), 1)
        speed = cross(joints, axes)
        linear = total[:, None] * speed + cross(axes, moment)
        angular = (about @ axes[..., None])[..., 0] + cross(moment, speed)
        motion = np.concatenate([axes, speed], axis=2)
        full = motion @ np.concatenate([angular, linear], axis=2).transpose(0, 2, 1)
        upper = np.triu(full)
        return np.asarray(upper + np.triu(full, 1).transpose(0, 2, 1) + np.diag(self._armature))
