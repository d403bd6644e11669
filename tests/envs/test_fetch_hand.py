"""The hand alone: the same scene, states and motions as with the arm behind it."""

import mujoco
import numpy as np
import pytest

from roboscribe.envs import fetch, fetch_hand
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.fetch_world import FetchTask
from roboscribe.envs.tasks.pick_place import PickPlace
from roboscribe.errors import TaskError

ROWS = np.arange(16)
MOVED = ("pick-place-1", "push-3", "pick-place-cond")


def fetch_task(name: str) -> FetchTask:
    """Build a task at the Fetch robot's table."""
    task = make_task(name)
    assert isinstance(task, FetchTask)
    return task


@pytest.mark.parametrize("name", MOVED)
def test_episodes_start_alike_and_move_alike(name: str) -> None:
    """From the same starts the same actions bring the hand to within 3 mm of where the arm brings it, for 20 steps."""
    task = fetch_task(name)
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (4, len(ROWS), 4)).repeat(5, axis=0)
    ended = []
    for each in (task, task.light):
        world = each.world(len(ROWS))
        started = world.reset(ROWS, ROWS)
        for action in actions:
            states = world.step(ROWS, action)
        ended.append((started, fetch.view(states).hand))
    (started, hand), (started_light, hand_light) = ended
    np.testing.assert_array_equal(started, started_light)
    assert np.abs(hand - hand_light).mean() < 3e-3


def test_the_shapes_that_touch_are_those_of_the_file() -> None:
    """Fingers, palm, table and objects collide and rub as in the whole scene."""
    scene = fetch.Scene.of_blocks(2, pushing=True)
    whole, light = fetch.fetch_model(scene, "stable", "fast"), fetch_hand.hand_model(scene, "stable", "fast")
    fingers = ("robot0:r_gripper_finger_link", "robot0:l_gripper_finger_link")
    for name in ("robot0:gripper_link", *fingers, "object0", "object1"):
        for field in ("type", "size", "friction", "solref", "solimp", "margin", "condim"):
            assert np.array_equal(getattr(whole.geom(name), field), getattr(light.geom(name), field)), (name, field)
    for name in fingers:
        joints = [model.joint(name.replace("_link", "_joint")) for model in (whole, light)]
        assert joints[0].armature == joints[1].armature
        assert joints[0].damping[0] == joints[1].damping[0]
    assert light.opt.timestep == whole.opt.timestep
    assert light.opt.cone == whole.opt.cone
    assert np.array_equal(light.actuator_gainprm, whole.actuator_gainprm)


def test_snapshots_with_the_arm_go_on_without_it() -> None:
    """A demonstration's states, loaded into the light world, are the same and take nearly the same next step."""
    task = fetch_task("pick-place-1")
    shown = task.demonstrate(1, 0)[0]
    assert shown.snapshots is not None
    assert shown.actions is not None
    steps = len(shown.actions)
    world = task.light.world(steps)
    rows = np.arange(steps)
    np.testing.assert_allclose(world.load(rows, shown.snapshots[:-1]), shown.states[:-1], atol=1e-9)
    after = fetch.view(world.step(rows, shown.actions))
    expected = fetch.view(shown.states[1:])
    assert np.abs(after.hand - expected.hand).max() < 5e-3
    assert np.abs(after.blocks - expected.blocks).max() < 1e-2


def test_its_own_snapshots_continue_bit_for_bit() -> None:
    """What the light world saves it loads, and steps to the same state."""
    world = PickPlace("x", 2).light.world(2)
    rows, actions = np.arange(2), np.full((2, 4), 0.3)
    world.reset(rows, rows)
    saved = world.save(rows)
    after = world.step(rows, actions)
    world.load(rows, saved)
    np.testing.assert_array_equal(world.step(rows, actions), after)


def test_snapshots_of_another_scene_are_refused() -> None:
    """Two blocks do not fit on a table with one."""
    rows = np.arange(1)
    other = PickPlace("x", 2).world(1)
    other.reset(rows, rows)
    with pytest.raises(TaskError, match="snapshots of shape"):
        PickPlace("x", 1).light.world(1).load(rows, other.save(rows))


def test_the_hand_is_led_by_the_mocap_alone() -> None:
    """No arm is left: three slides, two fingers, and the objects."""
    model = fetch_hand.hand_model(fetch.Scene.of_blocks(1), "stable", "fast")
    assert model.nv == len(fetch_hand.RAILS) + 2 + 6
    assert model.neq == 1
    assert model.eq_type[0] == mujoco.mjtEq.mjEQ_CONNECT
