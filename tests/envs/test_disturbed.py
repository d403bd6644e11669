"""Disturbed worlds: what is seen and what is, what blocks and hands suffer, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs import fetch
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.disturbed import LONGEST_WAIT, OPEN_STEPS, Disturbed, disturbed, free_place
from roboscribe.envs.fetch_world import TOLERANCE, FetchWorld
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, IntArray
from roboscribe.world.task import Judge, Task

ONE = np.zeros(1, dtype=np.int64)
SEEDS = np.array([3, 4, 5], dtype=np.int64)


def run(task: Task, actions: FloatArray, seeds: IntArray = SEEDS) -> FloatArray:
    """Run the same actions (T, A) from every seed; returns what is seen (T + 1, R, F)."""
    world, rows = task.world(len(seeds)), np.arange(len(seeds))
    seen = [world.reset(rows, seeds)]
    seen += [world.step(rows, np.tile(action, (len(seeds), 1))) for action in actions]
    return np.stack(seen)


def moves(steps: int, task: Task) -> FloatArray:
    """Draw actions (T, A)."""
    return np.random.default_rng(0).uniform(-1, 1, (steps, task.action_size))


@pytest.mark.parametrize("text", ["noise", "noise=", "noise=x", "noise=-1", "noise=nan", "=1", "wind=1", "mass=0"])
def test_what_is_no_disturbance_is_refused(text: str) -> None:
    with pytest.raises(TaskError, match="expected one of noise=S"):
        disturbed(make_task("tower-2"), [text])


@pytest.mark.parametrize(("task", "text"), [("point-pick-place-1", "push=1"), ("pick-place-1", "knock=1")])
def test_what_a_task_cannot_have_is_refused(task: str, text: str) -> None:
    with pytest.raises(TaskError, match="cannot be disturbed by"):
        disturbed(make_task(task), [text])
    with pytest.raises(TaskError, match="each kind once"):
        disturbed(make_task(task), ["noise=1", "noise=2"])


def test_without_disturbances_it_is_the_task() -> None:
    task = make_task("tower-2")
    assert disturbed(task, []) is task
    calm = [f"{kind}=0" for kind in ("noise", "delay", "push", "slip", "knock")]
    same = disturbed(task, [*calm, "friction=1", "mass=1", "size=1"])
    actions = moves(6, task)
    assert np.array_equal(run(task, actions), run(same, actions))


@pytest.mark.parametrize("name", ["tower-2", "point-pick-place-1"])
def test_noise_is_on_positions_and_changes_nothing_real(name: str) -> None:
    task = make_task(name)
    noisy = disturbed(task, ["noise=0.01"])
    assert isinstance(noisy, Disturbed)
    actions = moves(40, task)
    error = run(noisy, actions) - run(task, actions)
    others = np.setdiff1d(np.arange(task.layout.size), noisy.seen_positions)
    assert not error[..., others].any()
    assert 0.009 < error[..., noisy.seen_positions].std() < 0.011


def test_success_is_judged_on_what_is() -> None:
    task = make_task("point-pick-place-1")
    (shown,) = task.demonstrate(1, seed=0)
    assert shown.snapshots is not None
    world = disturbed(task, ["noise=10"]).world(1)
    assert isinstance(world, Judge)
    seen = world.load(ONE, shown.snapshots[-1:])
    assert not task.solved(seen).any()
    assert world.solved(ONE).all()


def test_hands_are_late() -> None:
    task = make_task("point-pick-place-1")
    actions = moves(8, task)
    late = run(disturbed(task, ["delay=2"]), actions)
    shifted = run(task, np.concatenate([np.zeros((2, task.action_size)), actions[:-2]]))
    assert np.array_equal(late, shifted)


def test_a_row_is_disturbed_alike_in_any_batch() -> None:
    task = disturbed(make_task("tower-2"), ["noise=0.01", "push=0.3", "slip=5", "delay=1"])
    actions = moves(8, task)
    together = run(task, actions)
    for rank, seed in enumerate(SEEDS):
        assert np.array_equal(run(task, actions, np.array([seed]))[:, 0], together[:, rank])


def test_pushes_move_blocks() -> None:
    task = make_task("tower-2")
    still = np.zeros((50, task.action_size))
    calm, pushed = (fetch.view(run(each, still)).blocks for each in (task, disturbed(task, ["push=0.5"])))
    assert np.abs(calm - calm[0]).max() < 1e-3
    assert np.abs(pushed - pushed[0]).max() > 1e-2


def test_grasps_slip() -> None:
    """The fingers, told to close on a block between them, open for some steps."""
    task = disturbed(make_task("pick-place-1"), ["slip=1000"])
    assert isinstance(task, Disturbed)
    world, told = task.world(1), []
    world.reset(ONE, SEEDS[:1])
    for held in (False, True, *[False] * OPEN_STEPS):
        action = np.array([0.0, 0.0, 0.0, -1.0])
        world._slip(0, action, held=held)
        told.append(float(action[3]))
    assert told == [-1.0, *[1.0] * OPEN_STEPS, -1.0]


def test_a_placed_block_is_put_back_once() -> None:
    """Half of two blocks are at their goals; the one that is comes to lie elsewhere on the table."""
    task = disturbed(make_task("tower-2"), ["knock=1"])
    assert isinstance(task, Disturbed)
    assert task.horizon == 150, "as much time as a third block would have"
    world = task.world(1)
    world.reset(ONE, SEEDS[:1])
    assert isinstance(world.inner, FetchWorld)
    goals = fetch.view(world.observe(ONE)).goals[0]
    world.inner.put_back(0, 0, goals[0, :2])
    away = []
    for _ in range(2 * LONGEST_WAIT):
        seen = fetch.view(world.step(ONE, np.array([[0.0, 0.0, 1.0, 0.0]])))
        away.append(float(np.linalg.norm(seen.blocks[0, 0] - goals[0])))
    assert away[0] < TOLERANCE
    assert away[-1] > TOLERANCE
    assert world._knocks[0] == 0


def test_other_physics() -> None:
    task = make_task("tower-2")
    model = task.world(1).engine.model  # type: ignore[attr-defined]
    world = disturbed(task, ["friction=0.5", "mass=2", "size=0.8"]).world(1)
    other = world.inner.engine.model  # type: ignore[attr-defined]
    assert np.allclose(other.geom_friction, 0.5 * model.geom_friction)
    assert np.isclose(other.body("object0").mass, 2 * model.body("object0").mass)
    assert np.allclose(other.geom("object0").size, 0.8 * model.geom("object0").size)


def test_a_block_that_is_put_back_has_room() -> None:
    task = make_task("tower-5")
    world = task.world(3)
    assert isinstance(world, FetchWorld)
    states = world.reset(np.arange(3), SEEDS)
    for state in states:
        seen = fetch.view(state)
        place = free_place(np.random.default_rng(0), seen, world.middle)
        assert np.linalg.norm(np.concatenate([seen.blocks, seen.goals])[:, :2] - place, axis=1).min() > 0.06
