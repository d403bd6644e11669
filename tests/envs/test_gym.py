"""Environments of gymnasium-robotics as tasks: what they observe, what solves them, which are refused and why."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs import demonstrator, goal_env
from roboscribe.envs.catalogue import make_task, task_names
from roboscribe.envs.reach_demonstrator import STYLES
from roboscribe.envs.tasks.gym import LISTED, GymTask, ScriptedGymTask
from roboscribe.errors import TaskError

ROW = np.array([0])
KINDS = ("FetchPickAndPlace", "FetchPush", "FetchReach", "FetchSlide")


@pytest.fixture(params=[*LISTED, "gym:FetchReachDense-v4"])
def task(request: pytest.FixtureRequest) -> GymTask:
    found = make_task(request.param)
    assert isinstance(found, GymTask)
    return found


def test_every_kind_is_listed() -> None:
    listed = [name.removeprefix("gym:") for name in task_names() if name.startswith("gym:")]
    assert sorted(goal_env.kind(name) for name in listed) == sorted(KINDS)
    assert {goal_env.kind(name) for name in goal_env.usable()} == set(KINDS)
    assert set(listed) <= set(goal_env.usable())


def test_states_say_what_the_environment_observes(task: GymTask) -> None:
    simulator = goal_env.GymSimulator(task.environment, task.horizon)
    state = simulator.reset(3)
    for action in np.random.default_rng(0).uniform(-1, 1, size=(5, 4)):
        before, state = state, simulator.step(action)
    assert state.shape == (task.layout.size,)
    inner = simulator.inner
    assert np.allclose(state[:3], inner.data.site("robot0:grip").xpos)
    assert np.allclose(state[-3:], inner.goal)
    if goal_env.has_object(task.environment):
        assert np.allclose(state[7:10], inner.data.site("object0").xpos)
    assert np.abs(state[4:7]).max() > 0.05
    assert np.sign(state[4:7] @ (state[:3] - before[:3])) == 1


def test_success_is_the_environment_s_own(task: GymTask) -> None:
    simulator = goal_env.GymSimulator(task.environment, task.horizon)
    base = simulator.reset(1)
    place = slice(7, 10) if goal_env.has_object(task.environment) else slice(0, 3)
    for gap in (0.049, 0.051):
        state = base.copy()
        state[place] = state[-3:] + np.array([0.0, gap, 0.0])
        theirs = bool(simulator.inner._is_success(state[place], state[-3:]))
        assert bool(task.solved(state)) is theirs is (gap < 0.05)


def test_a_seed_decides_the_start_and_a_snapshot_the_rest(task: GymTask) -> None:
    world, other = task.world(2), task.world(1)
    rows = np.arange(2)
    states = world.reset(rows, np.array([4, 4]))
    assert (states[0] == states[1]).all()
    actions = np.random.default_rng(1).uniform(-1, 1, size=(4, 1, 4))
    world.step(ROW, actions[0])
    saved = world.save(ROW)
    seen = [world.step(ROW, action) for action in actions[1:]]
    other.load(ROW, saved)
    assert all((other.step(ROW, action) == after).all() for action, after in zip(actions[1:], seen, strict=True))


@pytest.mark.parametrize("style", STYLES)
def test_the_hand_reaches_the_target_in_every_style(style: str) -> None:
    task = make_task("gym:FetchReach-v4")
    shown = demonstrator.demonstrate(task, 4, 0, style)
    assert all(task.solved(trajectory.states[-1:]).all() for trajectory in shown)


def test_styles_without_an_object_are_refused() -> None:
    with pytest.raises(TaskError, match="expected one of default, brisk, slow, pauses, stop, linger"):
        demonstrator.demonstrate(make_task("gym:FetchReach-v4"), 1, 0, "clumsy")


def test_dense_rewards_have_the_same_demonstrator() -> None:
    assert isinstance(make_task("gym:FetchPushDense-v4"), ScriptedGymTask)


def test_a_puck_is_slid_by_nobody_here() -> None:
    with pytest.raises(TaskError, match="gym:FetchSlide-v4 brings no demonstrator: give demonstrations in a file"):
        make_task("gym:FetchSlide-v4").demonstrate(1, 0)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("FetchReach-v9", "no environment 'FetchReach-v9': did you mean FetchReach-v"),
        ("nonsense", "no environment 'nonsense': expected one of FetchPickAndPlace-v"),
        ("FetchPush-v1", "gym:FetchPush-v1 cannot be a task: it needs mujoco_py"),
        ("HandReach-v3", "gym:HandReach-v3 cannot be a task: its hand is five fingers"),
        ("HandManipulateBlock-v1", "gym:HandManipulateBlock-v1 cannot be a task: "),
        ("AntMaze_UMaze-v5", "gym:AntMaze_UMaze-v5 cannot be a task: its robot is four legs"),
        ("PointMaze_UMaze-v3", "gym:PointMaze_UMaze-v3 cannot be a task: its walls are not observed"),
        ("FrankaKitchen-v1", "gym:FrankaKitchen-v1 cannot be a task: its goals are names of chores"),
        ("AdroitHandDoor-v1", "gym:AdroitHandDoor-v1 cannot be a task: it is not goal-conditioned"),
    ],
)
def test_what_cannot_be_mapped_is_refused_with_the_reason(name: str, said: str) -> None:
    with pytest.raises(TaskError, match=said) as found:
        make_task(f"gym:{name}")
    assert "expected one of FetchPickAndPlace" in str(found.value)
    assert "\n" not in str(found.value)
