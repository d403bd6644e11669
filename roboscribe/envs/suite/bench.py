"""One environment of robosuite that can be put into any saved state; what it does next follows from that alone."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from roboscribe.envs.arm.osc import turn_error
from roboscribe.envs.engine import INTEGRATION, integration_state
from roboscribe.envs.suite.request import DRAWER, SuiteRequest, build
from roboscribe.envs.suite.substeps import Substeps, steppable
from roboscribe.envs.suite.view import hand_rotation, hand_site, view
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray

MOST_TURN = 0.5
"""Greatest rotation that OSC_POSE is asked for in one control step, rad."""


class Bench:
    """An environment, put into one saved state after another.

    Args:
        request: which.

    Raises:
        TaskError: it cannot be built or described.
    """

    def __init__(self, request: SuiteRequest) -> None:
        """Build it."""
        self.env = build(request)
        self.env.reset()
        self.request = request
        self.arm: str = self.env.robots[0].arms[0]
        self._rest = self._nominal() if request.held else None
        seen = view(self.env, self._rest)
        self.layout, self._read = seen.layout, seen.read
        gripper = self._gripper
        self.fingers = int(gripper.dof) if self.env.robots[0].has_gripper[self.arm] else 0
        self._finger_targets = len(gripper.actuators)
        model = self.env.sim.model._model
        self._loose = np.flatnonzero((model.body_parentid == 0) & (np.arange(model.nbody) > 0))
        self._split = np.cumsum([part.size for part in self._parts()])[:-1]
        self.snapshot_size = int(self.save().size)
        self._substeps = Substeps(self.env, self.arm) if steppable(self.env, self.arm) else None

    @property
    def action_size(self) -> int:
        """Count of numbers in an action."""
        return 3 + self.fingers if self.request.held else int(self.env.action_dim)

    @property
    def frequency(self) -> float:
        """Control steps per second."""
        return float(self.env.control_freq)

    @property
    def _gripper(self) -> Any:  # noqa: ANN401 - robosuite has no types
        return self.env.robots[0].gripper[self.arm]

    @property
    def _controller(self) -> Any:  # noqa: ANN401
        """The arm's controller; a new one after every reset."""
        return self.env.robots[0].part_controllers[self.arm]

    def _nominal(self) -> FloatArray:
        """Return the hand's axes (3, 3) in the robot's start pose, without its noise."""
        model, robot = self.env.sim.model._model, self.env.robots[0]
        data = mujoco.MjData(model)
        data.qpos[:] = self.env.sim.data.qpos
        data.qpos[robot._ref_joint_pos_indexes] = robot.init_qpos
        mujoco.mj_kinematics(model, data)
        return np.array(data.site_xmat[hand_site(self.env)]).reshape(3, 3)

    def observe(self) -> FloatArray:
        """Return the present state (F,), which follows from the simulator's state alone."""
        self.env.sim.forward()
        self.env._update_observables(force=True)
        return self._read(self.env)

    def reset(self, seed: int) -> tuple[FloatArray, FloatArray]:
        """Start the episode of a seed: snapshot (S,), state (F,)."""
        seed_everything(self.env, seed)
        self.env.reset()
        return self._settle()

    def _settle(self) -> tuple[FloatArray, FloatArray]:
        """Return snapshot and state, the simulator's state being what it was before it was observed."""
        model, data = self.env.sim.model._model, self.env.sim.data._data
        before = integration_state(model, data)
        state = self.observe()
        mujoco.mj_setState(model, data, before, INTEGRATION)
        return self.save(), state

    def step(self, snapshot: FloatArray, action: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
        """Go one control step on from a snapshot.

        Args:
            snapshot: (S,).
            action: (A,) in [-1, 1].

        Returns:
            Snapshot, state, and whether that is still physics (MuJoCo resets the clock of a bad state).
        """
        self._put(snapshot)
        clock = float(self.env.sim.data.time)
        command = self._command(action)
        if self._substeps is None:
            self.env.step(command)
        else:
            self._substeps.step(command)
        good = abs(self.env.sim.data.time - clock - 1 / self.frequency) < 1e-6
        after, state = self._settle()
        return after, state, bool(good and np.isfinite(after).all() and np.isfinite(state).all())

    def _command(self, action: FloatArray) -> FloatArray:
        """Turn an action into robosuite's: its fingers close where ours open, and a direction has to be servoed."""
        if self._rest is None:
            return action
        mujoco.mj_kinematics(self.env.sim.model._model, self.env.sim.data._data)
        base = np.array(self.env.robots[0].base_ori).reshape(3, 3)
        error = base.T @ turn_error(self._rest, hand_rotation(self.env))
        return np.concatenate([action[:3], np.clip(error / MOST_TURN, -1.0, 1.0), -action[3:]])

    def _parts(self) -> list[FloatArray]:
        """List everything that decides what comes next."""
        model, data = self.env.sim.model._model, self.env.sim.data._data
        fingers = np.broadcast_to(np.asarray(self._gripper.current_action, dtype=np.float64), (self._finger_targets,))
        places = [model.body_pos[self._loose].ravel(), model.body_quat[self._loose].ravel()]
        goals = [self.env.episode.goals.ravel()] if self.request.environment == DRAWER else []
        return [integration_state(model, data), fingers, np.array(self._controller.initial_joint), *places, *goals]

    def save(self) -> FloatArray:
        """Return a snapshot (S,)."""
        return np.concatenate(self._parts())

    def load(self, snapshot: FloatArray) -> FloatArray:
        """Put the environment into a snapshot (S,). Returns the state (F,)."""
        physics = self._put(snapshot)
        state = self.observe()
        mujoco.mj_setState(self.env.sim.model._model, self.env.sim.data._data, physics, INTEGRATION)
        return state

    def _put(self, snapshot: FloatArray) -> FloatArray:
        """Put the environment into a snapshot (S,), nothing worked out yet. Returns the simulator's part of it."""
        model, data = self.env.sim.model._model, self.env.sim.data._data
        physics, fingers, rest, places, turns, *goals = np.split(snapshot, self._split)
        model.body_pos[self._loose], model.body_quat[self._loose] = places.reshape(-1, 3), turns.reshape(-1, 4)
        self._gripper.current_action = fingers.copy()
        self._controller.initial_joint = rest.copy()
        if goals:
            self.env.episode = replace(self.env.episode, goals=goals[0].reshape(-1, 3))
        mujoco.mj_setState(model, data, physics, INTEGRATION)
        self._controller.new_update = True
        return physics


def seed_everything(env: Any, seed: int) -> None:  # noqa: ANN401
    """Let a seed decide the next reset: robosuite's own `seed` is only heeded when an environment is built."""
    rng = np.random.default_rng(seed)
    env.rng = rng
    todo = [getattr(env, "placement_initializer", None), getattr(env.model, "mujoco_arena", None)]
    while todo:
        sampler = todo.pop()
        if sampler is not None and hasattr(sampler, "rng"):
            sampler.rng = rng
        todo += list(getattr(sampler, "samplers", {}).values())


@lru_cache(maxsize=4)
def bench(request: SuiteRequest) -> Bench:
    """Return this process's environment for a request."""
    return Bench(request)


def check_size(found: int, expected: int, name: str) -> None:
    """Refuse snapshots of another environment.

    Raises:
        TaskError: the sizes differ.
    """
    if found != expected:
        msg = f"snapshots of {found} numbers: expected {expected} for robosuite:{name}"
        raise TaskError(msg)
