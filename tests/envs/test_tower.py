"""Tasks of several blocks: where they start, when they are solved, and how they are demonstrated."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from roboscribe.envs import block_layouts, demonstrator, multi_block_demonstrator
from roboscribe.envs.catalogue import make_task
from roboscribe.errors import TaskError
from roboscribe.evidence import Evidence
from roboscribe.world.layout import FloatArray
from roboscribe.world.task import Task

NAMES = ("pick-place-4", "tower-5", "tower-10", "multitower-5", "multitower-8", "pyramid-4", "pyramid-9")
TABLE = 0.4249
"""Height of a resting block's centre, m."""
ROW = np.array([0])


def starts(task: Task, episodes: int = 10) -> FloatArray:
    """Draw initial states (E, F)."""
    world = task.world(1)
    return np.array([world.reset(ROW, np.array([seed]))[0] for seed in range(episodes)])


def blocks(states: FloatArray) -> FloatArray:
    """Positions (..., N, 3)."""
    return states[..., 7:].reshape(*states.shape[:-1], -1, 12)[..., :3]


def goals(states: FloatArray) -> FloatArray:
    """Goal positions (..., N, 3)."""
    return states[..., 7:].reshape(*states.shape[:-1], -1, 12)[..., 9:]


def gaps(one: FloatArray, other: FloatArray) -> FloatArray:
    """Horizontal distances (E, N, M)."""
    return np.asarray(np.linalg.norm(one[:, :, None, :2] - other[:, None, :, :2], axis=3))


def built(task: Task) -> FloatArray:
    """Make a state (F,) with every block at its goal and the hand high above."""
    state: FloatArray = starts(task, 1)[0]
    objects = state[7:].reshape(-1, 12)
    objects[:, :3] = objects[:, 9:]
    state[:3] = objects[:, 9:].mean(axis=0) + np.array([0.0, 0.0, 0.6])
    return state


@pytest.mark.parametrize("name", NAMES)
def test_starts_keep_their_distances(name: str) -> None:
    states = starts(make_task(name))
    apart = gaps(blocks(states), blocks(states)) + np.eye(blocks(states).shape[1])
    assert apart.min() > 0.0599
    assert gaps(blocks(states), goals(states)).min() > 0.0709


@pytest.mark.parametrize("name", NAMES)
def test_goals_lie_over_the_table(name: str) -> None:
    found = goals(starts(make_task(name)))
    assert (np.abs(found[..., :2] - (1.3, 0.75)) < (0.25, 0.35)).all()
    assert (found[..., 2] > TABLE - 1e-3).all()


def test_goals_of_pick_and_place() -> None:
    found = goals(starts(make_task("pick-place-4"), 60))
    assert (gaps(found, found) + np.eye(4)).min() > 0.071
    assert np.allclose(found[:, :-1, 2], TABLE, atol=1e-3)
    height = found[:, -1, 2] - found[:, 0, 2]
    air = height > 0
    assert 0.25 < air.mean() < 0.75
    assert ((height[air] >= 0.1) & (height[air] <= 0.45)).all()


@pytest.mark.parametrize(
    ("name", "sizes"),
    [("tower-7", [7]), ("multitower-4", [2, 2]), ("multitower-5", [2, 3]), ("multitower-8", [2, 3, 3])],
)
def test_towers_have_their_sizes(name: str, sizes: list[int]) -> None:
    for found in goals(starts(make_task(name), 5)):
        bases, which = np.unique(found[:, :2].round(6), axis=0, return_inverse=True)
        assert sorted(np.bincount(which.ravel()).tolist()) == sizes
        assert (gaps(bases[None], bases[None]) + np.eye(len(bases))).min() > 0.10
        for tower in range(len(bases)):
            levels = np.sort(found[which.ravel() == tower, 2])
            assert np.allclose(levels, TABLE + 0.05 * np.arange(len(levels)), atol=1e-3)


@pytest.mark.parametrize(("name", "sizes"), [("pyramid-4", [3, 1]), ("pyramid-6", [3, 2, 1]), ("pyramid-9", [4, 3, 2])])
def test_pyramids_have_their_rows(name: str, sizes: list[int]) -> None:
    for found in goals(starts(make_task(name), 5)):
        row = np.round((found[:, 2] - TABLE) / 0.05).astype(int)
        assert np.bincount(row).tolist() == sizes
        assert np.ptp(found[:, 1]) < 1e-9
        rows = [np.sort(found[row == level, 0]) for level in range(len(sizes))]
        assert all(np.allclose(np.diff(xs), 0.06) for xs in rows)
        assert all(np.isclose(above[0] - below[0], 0.03) for below, above in pairwise(rows)), "over the gaps"


def test_which_block_goes_where_is_random() -> None:
    lowest = goals(starts(make_task("tower-3"), 60))[..., 2].argmin(axis=1)
    assert (np.bincount(lowest, minlength=3) > 10).all()


@pytest.mark.parametrize("name", ["tower-3", "multitower-4", "pyramid-4"])
def test_a_tower_is_solved_when_built_and_left(name: str) -> None:
    task = make_task(name)
    state = built(task)
    assert task.solved(state)
    top = goals(state)[goals(state)[:, 2].argmax()]
    for distance, expected in ((0.0999, False), (0.1001, True)):
        state[:3] = top + np.array([0.0, 0.0, distance])
        assert bool(task.solved(state)) is expected


@pytest.mark.parametrize("index", range(3))
def test_one_block_off_is_not_solved(index: int) -> None:
    task = make_task("tower-3")
    state = built(task)
    state[7 + 12 * index] += 0.051
    assert not task.solved(state)


def test_pick_and_place_may_keep_the_hand() -> None:
    task = make_task("pick-place-4")
    state = built(task)
    state[:3] = goals(state)[-1]
    assert task.solved(state)


@pytest.mark.parametrize("name", ["tower-1", "tower-11", "multitower-3", "pyramid-2"])
def test_what_cannot_be_built_is_refused(name: str) -> None:
    with pytest.raises(TaskError, match="blocks, expected"):
        make_task(name)


def test_too_many_blocks_find_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(block_layouts, "RESTARTS", 5)
    with pytest.raises(TaskError, match="no room"):
        make_task("pick-place-30").world(1).reset(ROW, ROW)


def test_fingers_find_room_unless_the_task_is_crowded() -> None:
    def tight(name: str) -> bool:
        places = blocks(starts(make_task(name), 60))
        apart = np.abs(places[:, :, None, :2] - places[:, None, :, :2]) + np.eye(5)[..., None]
        return bool((apart < (0.042, 0.095)).all(axis=3).any())

    assert not tight("tower-5")
    assert tight("tower-5-crowded")


def test_several_blocks_rest() -> None:
    task = make_task("tower-5")
    world, rows = task.world(4), np.arange(4)
    start = world.reset(rows, rows)
    for _ in range(10):
        state = world.step(rows, np.zeros((4, 4)))
    assert np.abs(blocks(state) - blocks(start)).max() < 0.002, "nothing overlaps, nothing is pushed away"


@pytest.mark.parametrize("name", ["pick-place-4", "tower-4"])
def test_the_demonstrator_succeeds(name: str) -> None:
    task = make_task(name)
    assert isinstance(task, demonstrator.ScriptedTask)
    wave = [demonstrator.start(3, index) for index in range(20)]
    demonstrator.run(task, task.world(20), wave)
    assert np.mean([episode.succeeded for episode in wave]) >= 0.95


def test_the_demonstrator_has_no_memory() -> None:
    states = make_task("tower-2").demonstrate(1, seed=0)[0].states
    order = np.random.default_rng(0).permutation(len(states))
    command = multi_block_demonstrator.BUILD.command
    assert (command(states)[order] == command(states[order])).all()


def test_blocks_are_served_from_below() -> None:
    state = starts(make_task("tower-4"), 1)
    nothing = np.zeros((1, 4), dtype=np.bool_)
    assert multi_block_demonstrator.due(nothing, goals(state), keep_last=False)[0] == goals(state)[0, :, 2].argmin()
    lower = np.array([[True, False, True, True]])
    assert multi_block_demonstrator.due(lower, goals(state), keep_last=False)[0] == 1


def test_the_last_block_is_kept_and_the_others_come_in_order() -> None:
    state = starts(make_task("pick-place-4"), 1)
    for done, expected in (([0, 0, 0, 0], 0), ([1, 0, 0, 1], 1), ([1, 1, 1, 0], 3), ([1, 1, 1, 1], 3)):
        flags = np.array([done], dtype=np.bool_)
        assert multi_block_demonstrator.due(flags, goals(state), keep_last=True)[0] == expected


@pytest.mark.parametrize("name", ["tower-3", "pick-place-4"])
def test_shuffled_blocks_leave_the_demonstrations_as_they_are(name: str) -> None:
    task = make_task(name)
    shown = task.demonstrate(4, seed=0)
    rng = np.random.default_rng(0)
    shuffled = [t.renamed(tuple(int(i) for i in rng.permutation(len(task.layout.entities)))) for t in shown]
    plain, mixed = (Evidence.of(demonstrations, task.solved) for demonstrations in (shown, shuffled))
    assert not np.array_equal(plain.states, np.concatenate([t.states for t in shuffled]))
    assert np.array_equal(plain.states, mixed.states)


def test_fingers_open_before_the_hand_leaves_a_block() -> None:
    task = make_task("tower-2")
    state = built(task)
    top = goals(state)[:, 2].argmax()
    state[:3] = goals(state)[top]
    state[3] = 0.048
    closed = multi_block_demonstrator.BUILD.command(state[None])[0]
    assert np.abs(closed[:3]).max() == 0
    assert closed[3] > 0
    state[3] = 0.1
    opened = multi_block_demonstrator.BUILD.command(state[None])[0]
    assert opened[2] == 1, "straight up"
    assert np.abs(opened[:2]).max() == 0


def test_a_slipped_block_is_picked_again() -> None:
    task = make_task("tower-2")
    state = built(task)
    low = goals(state)[:, 2].argmin()
    state[7 + 12 * low] += 0.12
    done = multi_block_demonstrator.placed(state[None, :3], state[None, 3], blocks(state[None]), goals(state[None]))
    assert done[0].tolist() == [index != low for index in range(2)]
    assert multi_block_demonstrator.due(done, goals(state[None]), keep_last=False)[0] == low
