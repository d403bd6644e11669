"""What holds for every environment in the catalogue."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from roboscribe.envs.catalogue import make_task, task_names
from roboscribe.envs.styles import DEFAULT, STYLES
from roboscribe.errors import TaskError
from roboscribe.world.layout import ROBOT, FloatArray, IntArray
from roboscribe.world.task import Task, World
from roboscribe.world.trajectory import Trajectory

STEPS = 12
EPISODES = 2
GYM = "gym:FetchPickAndPlace-v4"
STAY = STYLES[DEFAULT].after
NAMES = (
    "pick-place-1",
    "pick-place-2",
    "tower-2",
    "multitower-4",
    "pyramid-3",
    "push-1",
    "push-2",
    "pick-place-cond",
    "gym:FetchPush-v4",
    GYM,
)
"""One of every family, small."""


def rows(*indices: int) -> IntArray:
    return np.array(indices, dtype=np.int64)


@pytest.fixture(params=NAMES)
def task(request: pytest.FixtureRequest) -> Task:
    return make_task(request.param)


@lru_cache(maxsize=8)
def demonstrations(name: str) -> list[Trajectory]:
    return make_task(name).demonstrate(EPISODES, seed=7)


def actions(count: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(-1, 1, size=(STEPS, count, 4))


def drive(world: World, which: IntArray, commands: FloatArray) -> FloatArray:
    return np.array([world.step(which, command) for command in commands])


def test_every_listed_task_can_be_made() -> None:
    assert [make_task(name).name for name in task_names()] == list(task_names())


def test_shapes(task: Task) -> None:
    world = task.world(3)
    assert world.batch == 3
    states = world.reset(rows(0, 1, 2), rows(5, 6, 7))
    assert states.shape == (3, task.layout.size)
    assert states.dtype == np.float64
    assert world.step(rows(2, 0), np.zeros((2, task.action_size))).shape == (2, task.layout.size)
    assert task.solved(states).shape == (3,)
    assert task.solved(states[:, None]).shape == (3, 1)
    assert task.solved(states[:0]).shape == (0,)
    assert world.diverged(rows(0, 1, 2)).tolist() == [False] * 3


def test_a_start_depends_on_its_seed_alone(task: Task) -> None:
    first, second = task.world(3), task.world(2)
    states = first.reset(rows(0, 1, 2), rows(11, 12, 11))
    assert (states[0] == states[2]).all()
    assert (states[0] != states[1]).any()
    first.step(rows(1), np.ones((1, 4)))
    assert (first.reset(rows(1), rows(11)) == states[0]).all()
    assert (second.reset(rows(1), rows(12)) == states[1]).all()


def blocks_and_goals(task: Task, states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (..., N, 3) of the blocks and of their goals."""
    entities = range(len(task.layout.entities))
    found = [[states[..., task.layout.columns[i, "position", goal]] for i in entities] for goal in (False, True)]
    return np.stack(found[0], axis=-2), np.stack(found[1], axis=-2)


def test_blocks_start_where_the_task_says(task: Task) -> None:
    world = task.world(1)
    states = np.array([world.reset(rows(0), rows(seed))[0] for seed in range(20)])
    hand, (blocks, goals) = states[:, None, :3], blocks_and_goals(task, states)
    assert (np.abs(blocks - hand)[..., :2] <= 0.15).all()
    assert (np.linalg.norm((blocks - hand)[..., :2], axis=2) >= 0.0999).all()
    assert np.ptp(blocks[..., 2], axis=0).max() < 1e-4
    assert (goals[..., 2] - blocks[..., 2] > -1e-3).all()
    assert np.allclose(hand, hand[0], atol=1e-6)
    assert not task.solved(states).all()


@pytest.mark.parametrize("name", ["pick-place-1", GYM])
def test_half_of_the_goals_of_one_block_are_in_the_air(name: str) -> None:
    task = make_task(name)
    world = task.world(1)
    states = np.array([world.reset(rows(0), rows(seed))[0] for seed in range(60)])
    block, goal = (places[:, 0] for places in blocks_and_goals(task, states))
    assert (np.abs(goal - states[:, :3])[:, :2] <= 0.1501).all()
    height = goal[:, 2] - block[:, 2]
    assert (height < 0.451).all()
    assert 0.25 < np.mean(height > 1e-3) < 0.75


def test_attributes_stay_within_their_bounds(task: Task) -> None:
    states = np.concatenate([trajectory.states for trajectory in demonstrations(task.name)])
    for index in (ROBOT, 0):
        kind = task.layout.type_of(index)
        for goal in (False, True):
            for attribute in kind.described(goal):
                values = states[:, task.layout.columns[index, attribute.name, goal]]
                assert ((values >= attribute.low) & (values <= attribute.high)).all(), attribute.name


@pytest.mark.parametrize(("distance", "expected"), [(0.0499, True), (0.0501, False)])
def test_solved_is_the_threshold(task: Task, distance: float, expected: bool) -> None:
    state = task.world(1).reset(rows(0), rows(0))[0]
    state[2] = 1.5
    for i in range(len(task.layout.entities)):
        goal = state[task.layout.columns[i, "position", True]]
        state[task.layout.columns[i, "position", False]] = goal + np.array([0.0, distance if i == 0 else 0.0, 0.0])
    assert bool(task.solved(state)) is expected


def test_a_row_moves_alone_as_in_a_batch(task: Task) -> None:
    commands = actions(3)
    together, alone = task.world(3), task.world(1)
    together.reset(rows(0, 1, 2), rows(1, 2, 3))
    alone.reset(rows(0), rows(2))
    batch = drive(together, rows(0, 1, 2), commands)
    assert (batch[:, 1] == drive(alone, rows(0), commands[:, 1:2])[:, 0]).all()


def test_other_rows_stand_still(task: Task) -> None:
    world = task.world(3)
    states = world.reset(rows(0, 1, 2), rows(1, 2, 3))
    world.step(rows(2), np.ones((1, 4)))
    assert (world.observe(rows(0, 1)) == states[:2]).all()
    assert (world.observe(rows(2)) != states[2]).any()
    assert world.control_steps == 1


def test_the_order_of_rows_does_not_matter(task: Task) -> None:
    commands = actions(2)
    one, other = task.world(2), task.world(2)
    one.reset(rows(0, 1), rows(4, 5))
    other.reset(rows(1, 0), rows(5, 4))
    straight = drive(one, rows(0, 1), commands)
    swapped = drive(other, rows(1, 0), commands[:, ::-1])
    assert (straight == swapped[:, ::-1]).all()


def test_a_saved_row_goes_on_bit_for_bit_elsewhere(task: Task) -> None:
    commands = actions(2)
    world = task.world(2)
    world.reset(rows(0, 1), rows(8, 9))
    drive(world, rows(0, 1), commands[:6])
    snapshots, seen = world.save(rows(0, 1)), world.observe(rows(0, 1))
    rest = drive(world, rows(0, 1), commands[6:])
    elsewhere = task.world(3)
    assert (elsewhere.load(rows(2, 0), snapshots) == seen).all()
    assert (elsewhere.save(rows(2, 0)) == snapshots).all()
    assert (drive(elsewhere, rows(2, 0), commands[6:]) == rest).all()


def test_snapshots_carry_goals(task: Task) -> None:
    world = task.world(2)
    states = world.reset(rows(0, 1), rows(8, 9))
    assert (world.load(rows(1), world.save(rows(0))) == states[0]).all()


def test_actions_are_clipped(task: Task) -> None:
    world = task.world(2)
    world.reset(rows(0, 1), rows(3, 3))
    after = world.step(rows(0, 1), np.array([[5.0, -9.0, 0.5, 2.0], [1.0, -1.0, 0.5, 1.0]]))
    assert (after[0] == after[1]).all()


def test_actions_that_are_not_numbers_are_refused(task: Task) -> None:
    world = task.world(1)
    world.reset(rows(0), rows(3))
    with pytest.raises(ValueError, match="not finite"):
        world.step(rows(0), np.array([[0.0, np.nan, 0.0, 0.0]]))


def test_rows_must_be_reset_before_they_step(task: Task) -> None:
    with pytest.raises(ValueError, match="never reset"):
        task.world(2).step(rows(1), np.zeros((1, 4)))


def test_snapshots_of_another_scene_are_refused(task: Task) -> None:
    with pytest.raises(TaskError, match="expected"):
        task.world(1).load(rows(0), np.zeros((1, 10)))


def test_demonstrations_solve_the_task(task: Task) -> None:
    found = demonstrations(task.name)
    assert len(found) == EPISODES
    for trajectory in found:
        assert trajectory.actions is not None
        assert trajectory.snapshots is not None
        assert len(trajectory.states) == len(trajectory.actions) + 1 == len(trajectory.snapshots)
        assert len(trajectory.actions) <= task.horizon
        assert (np.abs(trajectory.actions) <= 1).all()
        assert task.solved(trajectory.states)[-STAY:].all()
        assert not task.solved(trajectory.states)[:-STAY][-1:].any()


def test_demonstrations_can_be_replayed(task: Task) -> None:
    trajectory = demonstrations(task.name)[1]
    assert trajectory.actions is not None
    assert trajectory.snapshots is not None
    world = task.world(1)
    assert (world.load(rows(0), trajectory.snapshots[:1])[0] == trajectory.states[0]).all()
    assert (drive(world, rows(0), trajectory.actions[:, None])[:, 0] == trajectory.states[1:]).all()
    assert (world.save(rows(0))[0] == trajectory.snapshots[-1]).all()


def test_demonstrations_depend_on_the_seed_alone(task: Task) -> None:
    found = demonstrations(task.name)
    again, other = task.demonstrate(1, seed=7), task.demonstrate(1, seed=8)
    assert (again[0].states == found[0].states).all()
    assert other[0].states.shape != found[0].states.shape or (other[0].states != found[0].states).any()
