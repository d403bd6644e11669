"""Pushing: where blocks start and go, what the script does, and the order that a line of goals demands."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs import demonstrator, fetch, push_demonstrator
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.demonstrator import ScriptedTask
from roboscribe.envs.styles import choices
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray

EPISODES = 32


def scripted(name: str) -> ScriptedTask:
    task = make_task(name)
    assert isinstance(task, ScriptedTask)
    return task


def starts(name: str, count: int = 64) -> fetch.View:
    task = make_task(name)
    return fetch.view(task.world(count).reset(np.arange(count), np.arange(count)))


def apart(points: FloatArray) -> float:
    gaps = np.linalg.norm(points[:, :, None, :2] - points[:, None, :, :2], axis=-1)
    return float(gaps[:, ~np.eye(points.shape[1], dtype=bool)].min())


@pytest.mark.parametrize(("name", "gap"), [("push-3", 0.08), ("push-3-crowded", 0.05)])
def test_blocks_and_goals_keep_their_distances(name: str, gap: float) -> None:
    seen = starts(name)
    assert apart(seen.blocks) > 0.10
    assert apart(seen.goals) > 0.10
    between = np.linalg.norm(seen.blocks[:, :, None, :2] - seen.goals[:, None, :, :2], axis=-1)
    assert between.min() > gap
    assert np.linalg.norm(seen.blocks[..., :2] - seen.hand[:, None, :2], axis=-1).min() >= 0.10 - 1e-3
    assert np.allclose(seen.goals[..., 2], seen.blocks[..., 2], atol=1e-3)


def test_goals_of_the_confined_task_lie_on_a_line_away_from_the_robot() -> None:
    goals = np.sort(starts("push-confined-3").goals, axis=1)
    assert np.ptp(goals[..., 1], axis=1) == pytest.approx(0.0)
    assert np.diff(goals[..., 0], axis=1) == pytest.approx(0.05)


@pytest.mark.parametrize(("name", "least"), [("push-1", 0.95), ("push-3", 0.85), ("push-confined-3", 0.8)])
def test_the_script_solves_most_episodes(name: str, least: float) -> None:
    task = scripted(name)
    wave = [demonstrator.start(7, index, choices("default", task.script.styles)) for index in range(EPISODES)]
    demonstrator.run(task, task.world(EPISODES), wave)
    assert np.mean([episode.succeeded for episode in wave]) >= least


def test_fingers_stay_closed_whatever_is_commanded() -> None:
    task = make_task("push-1")
    world, rows = task.world(1), np.array([0])
    world.reset(rows, rows)
    for _ in range(5):
        state = world.step(rows, np.array([[0.0, 0.0, 0.2, 1.0]]))
    assert fetch.view(state).opening[0] < 0.005


def test_styles_that_need_fingers_are_refused() -> None:
    with pytest.raises(TaskError, match="unknown style 'clumsy': expected one of default, brisk"):
        demonstrator.demonstrate(make_task("push-1"), 1, 0, "clumsy")


def test_the_farthest_block_is_pushed_first_in_the_confined_task() -> None:
    seen = starts("push-confined-3")
    ranks = push_demonstrator.farthest_first(seen.blocks, seen.goals)
    first = push_demonstrator.due(seen.hand, seen.blocks, seen.goals, ranks)
    assert (first == seen.goals[..., 0].argmax(axis=1)).all()


def test_the_order_that_the_start_decides_is_kept_when_a_block_slips_off() -> None:
    shown = make_task("push-3").demonstrate(20, 0)
    states = np.stack([trajectory.states[0] for trajectory in shown])
    seen = fetch.view(states)
    longest = np.linalg.norm(seen.goals - seen.blocks, axis=2).argmax(axis=1)
    moved = [displaced_first(fetch.view(trajectory.states).blocks) for trajectory in shown]
    assert np.mean(longest == moved) >= 0.9


def displaced_first(blocks: FloatArray) -> int:
    """Return which of the blocks (T, N, 3) is the first that is pushed 2 cm off its place."""
    return int((np.linalg.norm(blocks - blocks[0], axis=2) > 0.02).argmax(axis=0).argmin())
