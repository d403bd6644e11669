"""The Fetch scene: agreement with gymnasium-robotics, models and timings, and the demonstrator."""

from __future__ import annotations

import subprocess
import sys

import mujoco
import numpy as np
import pytest

from roboscribe.envs import catalogue, demonstrator, fetch, single_block_demonstrator
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.fetch_world import FetchWorld
from roboscribe.envs.serial_world import SerialWorld
from roboscribe.envs.tasks.pick_place import PickPlace
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray

ROW = np.array([0])
EXACT = 1e-6
"""Agreement of positions and angles while the robot does what the demonstrator does, m and rad."""
HAND_SPEED = 0.06
"""Agreement of the hand's velocity, m/s: ours is that of 2 ms earlier."""


def twins(seed: int) -> tuple[FetchWorld, SerialWorld]:
    """Put our faithful world and the gym environment into the same state."""
    ours = PickPlace("twin", 1, contact="paper", timing="faithful").world(1)
    state = ours.reset(ROW, np.array([seed]))[0]
    theirs = make_task("gym:FetchPickAndPlace-v4").world(1)
    assert isinstance(theirs, SerialWorld)
    hand = ours.engine.sensors[0, :7]
    theirs.load(ROW, np.concatenate([ours.engine.states[0], hand, state])[None])
    return ours, theirs


def compare(seed: int, steps: int, noise: float) -> FloatArray:
    """Drive both with the same noisy demonstrator; return absolute differences of the states, (steps, F)."""
    ours, theirs = twins(seed)
    rng = np.random.default_rng(seed)
    seen, gaps = ours.observe(ROW), []
    for _ in range(steps):
        action = np.clip(single_block_demonstrator.command(seen) + noise * rng.normal(size=(1, 4)), -1, 1)
        seen = ours.step(ROW, action)
        gaps.append(np.abs(seen - theirs.step(ROW, action))[0])
    return np.array(gaps)


@pytest.mark.parametrize("seed", range(4))
def test_we_stay_together_with_gymnasium_robotics(seed: int) -> None:
    """50 control steps: approach, grasp, carry, hold."""
    gaps = compare(seed, steps=50, noise=0.15)
    speed = slice(4, 7)
    assert gaps[:, speed].max() < HAND_SPEED
    assert np.delete(gaps, speed, axis=1).max() < EXACT


def test_the_start_is_gymnasium_robotics_own() -> None:
    theirs = make_task("gym:FetchPickAndPlace-v4").world(1).reset(ROW, np.array([3]))[0]
    ours = PickPlace("x", 1).world(1).reset(ROW, np.array([3]))[0]
    robot, height = slice(0, 4), 9
    assert np.abs(theirs[robot] - ours[robot]).max() < EXACT
    assert abs(theirs[height] - ours[height]) < EXACT


def test_actions_move_hand_and_fingers() -> None:
    world = PickPlace("x", 1).world(3)
    rows = np.arange(3)
    start = world.reset(rows, rows)
    for _ in range(4):
        state = world.step(rows, np.array([[1.0, 0, 0, 1.0], [0, -0.5, 0.5, 1.0], [0, 0, 0, -1.0]]))
    moved = state[:, :3] - start[:, :3]
    assert 0.08 < moved[0, 0] < 0.2
    assert np.abs(moved[0, 1:]).max() < 0.01
    assert moved[1, 1] < -0.03
    assert moved[1, 2] > 0.03
    assert state[0, 3] == pytest.approx(0.10, abs=0.005)
    assert state[2, 3] == pytest.approx(0.0, abs=0.005)


def test_a_block_off_the_table_falls_and_is_no_divergence() -> None:
    world = PickPlace("x", 1).world(1)
    world.reset(ROW, ROW)
    world.engine.states[0, world._places.block_xy[0]] = (1.3, 1.3)
    for _ in range(30):
        state = world.step(ROW, np.zeros((1, 4)))
    assert not world.diverged(ROW).any()
    assert state[0, 9] < 0.1


def test_contact_models_and_timings() -> None:
    paper = fetch.fetch_model(fetch.Scene(), "paper", "faithful")
    stable = fetch.fetch_model(fetch.Scene(), "stable", "fast")
    assert (paper.opt.cone, paper.opt.impratio) == (mujoco.mjtCone.mjCONE_PYRAMIDAL, 1)
    assert (stable.opt.cone, stable.opt.impratio) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 10)
    assert (paper.opt.timestep, fetch.TIMINGS["faithful"]) == (0.002, 20)
    assert (stable.opt.timestep, fetch.TIMINGS["fast"]) == (0.004, 10)
    assert stable.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert paper.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER


@pytest.mark.parametrize("contact", fetch.CONTACTS)
@pytest.mark.parametrize("timing", fetch.TIMINGS)
def test_a_start_is_the_same_under_every_model(contact: str, timing: str) -> None:
    reference = PickPlace("x", 2).world(1).reset(ROW, np.array([5]))
    assert (PickPlace("x", 2, contact, timing).world(1).reset(ROW, np.array([5])) == reference).all()


def test_blocks_are_alike() -> None:
    model = fetch.base_model(fetch.Scene.of_blocks(3))
    dofs = [int(model.joint(f"object{i}:joint").dofadr[0]) for i in range(3)]
    for values in (model.dof_damping, model.dof_dampingpoly, model.dof_armature, model.dof_frictionloss):
        assert all((values[dofs[0] : dofs[0] + 6] == values[dof : dof + 6]).all() for dof in dofs)
    geoms = [int(model.geom(f"object{i}").id) for i in range(3)]
    for values in (model.geom_size, model.geom_friction, model.geom_solref, model.geom_solimp, model.geom_condim):
        assert (values[geoms] == values[geoms[0]]).all()
    masses = [float(model.body(f"object{i}").mass[0]) for i in range(3)]
    assert masses == masses[:1] * 3


def test_a_spinning_block_in_the_air_stays_within_physics() -> None:
    world = PickPlace("x", 2).world(1)
    world.reset(ROW, ROW)
    world.engine.states[0, world._places.block_pose[1, 2]] = 0.8
    world.engine.states[0, world._places.block_speed[1] + 3] = (30.0, 0.0, 20.0)
    for _ in range(5):
        state = world.step(ROW, np.zeros((1, 4)))
    assert not world.diverged(ROW).any()
    assert state[0, 21] > 0.5, "it still falls"


@pytest.mark.parametrize(
    ("quaternion", "angles"),
    [
        ((1, 0, 0, 0), (0, 0, 0)),
        ((np.sqrt(0.5), np.sqrt(0.5), 0, 0), (np.pi / 2, 0, 0)),
        ((np.cos(0.2), 0, np.sin(0.2), 0), (0, 0.4, 0)),
        ((np.cos(-0.3), 0, 0, np.sin(-0.3)), (0, 0, -0.6)),
    ],
)
def test_angles(quaternion: tuple[float, ...], angles: tuple[float, ...]) -> None:
    assert np.allclose(fetch.euler(np.array(quaternion)), angles)


@pytest.mark.parametrize("timing", fetch.TIMINGS)
def test_the_demonstrator_succeeds(timing: str) -> None:
    task = PickPlace("x", 1, timing=timing)
    wave = [demonstrator.start(3, index) for index in range(64)]
    demonstrator.run(task, task.world(64), wave)
    assert np.mean([episode.succeeded for episode in wave]) >= 0.95


def test_the_demonstrator_has_no_memory() -> None:
    states = PickPlace("x", 1).demonstrate(1, seed=0)[0].states
    order = np.random.default_rng(0).permutation(len(states))
    assert (single_block_demonstrator.command(states)[order] == single_block_demonstrator.command(states[order])).all()


def test_a_demonstrator_that_fails_says_so() -> None:
    with pytest.raises(TaskError, match="solved 0 of"):
        PickPlace("x", 1, horizon=3).demonstrate(200, seed=0)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("pick-place-0", {}),
        ("towers-5", {}),
        ("tower-x", {}),
        ("pick-place-1", {"contact": "soft"}),
        ("pick-place-1", {"timing": "slow"}),
    ],
)
def test_unknown_tasks_and_options_are_named(name: str, options: dict[str, str]) -> None:
    with pytest.raises(TaskError, match="expected one of"):
        catalogue.make_task(name, **options)


def test_listing_tasks_loads_no_other_packages_environments() -> None:
    heavy = "{'gymnasium', 'gymnasium_robotics', 'metaworld', 'robosuite', 'torch'}"
    code = f"import sys, roboscribe.envs.catalogue as c; c.task_names(); sys.exit(bool({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
