"""The table-top: the scene, its state, the demonstrator in every style, and what holds for every environment."""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations

import mujoco
import numpy as np
import pytest

from roboscribe.envs import demonstrator, graphics
from roboscribe.envs import table_top_demonstrator as moves
from roboscribe.envs import table_top_scene as scene
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.demonstrator import DemonstrationAttempt, demonstrate
from roboscribe.envs.engine import INTEGRATION
from roboscribe.envs.styles import DEFAULT, MIXED, STYLES, choices
from roboscribe.envs.table_top_demonstrator import JOBS
from roboscribe.envs.table_top_world import PLACES
from roboscribe.envs.tasks.table_top import SOLVED, TableTop
from roboscribe.errors import TaskError
from roboscribe.world.layout import ROBOT, FloatArray, IntArray
from roboscribe.world.trajectory import Trajectory

NAMES = ("table-top", "table-top-open", "table-top-any-order", *(f"table-top-{job}" for job in JOBS))
ATTEMPTS, STEPS = 16, 12
HAND, MUG, MUG_GOAL, BAR, GRIP = slice(0, 3), slice(7, 10), slice(10, 13), slice(13, 16), slice(18, 21)
EXTENSION, ANGLE = 16, 21


def rows(*indices: int) -> IntArray:
    return np.array(indices, dtype=np.int64)


@lru_cache
def task(name: str = "table-top", timing: str = "fast") -> TableTop:
    made = make_task(name, timing=timing)
    assert isinstance(made, TableTop)
    return made


@lru_cache
def attempts(style: str = DEFAULT, name: str = "table-top", count: int = ATTEMPTS) -> tuple[DemonstrationAttempt, ...]:
    known = task(name)
    chosen = choices(style, known.script.styles)
    wave = tuple(demonstrator.start(5, index, chosen, look=known.script.look) for index in range(count))
    demonstrator.run(known, known.world(count), wave)
    return wave


def shown(style: str = DEFAULT, name: str = "table-top") -> list[Trajectory]:
    found = (demonstrator.success(task(name), episode) for episode in attempts(style, name))
    return [trajectory for trajectory in found if trajectory is not None]


def drive(name: str, seed: int, commands: FloatArray) -> FloatArray:
    world = task(name).world(1)
    world.reset(rows(0), rows(seed))
    return np.array([world.step(rows(0), command[None])[0] for command in commands])


@pytest.mark.parametrize(("name", "size"), [("table-top", 23), ("table-top-open", 21), ("table-top-mug", 23)])
def test_the_state_is_what_the_scene_says(name: str, size: int) -> None:
    """Every number against MuJoCo's own kinematics, while things move."""
    made = task(name)
    world = made.world(1)
    world.reset(rows(0), rows(3))
    model = scene.scene_model("fast")
    data = mujoco.MjData(model)
    for command in np.random.default_rng(0).uniform(-1, 1, size=(5, 4)):
        state = world.step(rows(0), command[None])[0]
    mujoco.mj_setState(model, data, world.engine.states[0], INTEGRATION)
    mujoco.mj_forward(model, data)
    columns = made.layout.columns
    assert state.shape == (size,)
    late = 3e-3  # sensors are those of the last substep's beginning
    for index, site in ((ROBOT, "endEffector"), (0, "mug_centre"), (1, "bar"), (2, "grip")):
        assert np.abs(state[columns[index, "position", False]] - data.site(site).xpos).max() < late
    gap = np.linalg.norm(data.body("leftclaw").xpos - data.body("rightclaw").xpos)
    assert state[3] == pytest.approx(gap, abs=1e-6)
    assert state[columns[1, "extension", False]] == -data.joint("goal_slidey").qpos
    assert state[columns[2, "angle", False]] == data.joint("faucet_knob_Joint_1").qpos


@pytest.mark.parametrize("name", NAMES)
def test_starts(name: str) -> None:
    made = task(name)
    world = made.world(40)
    states = world.reset(np.arange(40), np.arange(40))
    seen = made.seen(states)
    assert np.allclose(states[:, HAND], (0.0, 0.5, 0.2), atol=1e-4)
    assert np.allclose(states[:, 3], 0.1, atol=1e-3)
    gaps = {"mug": (0.0, 0.0), "drawer": (0.0, -0.16), "faucet": (0.0, -0.12)}
    for job, (x, y) in PLACES.items():
        place = seen.places[job][:, :2] - gaps[job]
        assert (place >= (x[0] - 1e-5, y[0] - 1e-5)).all()
        assert (place <= (x[1] + 1e-5, y[1] + 1e-5)).all()
        assert np.ptp(place, axis=0).min() > 0.5 * (y[1] - y[0]), "drawn from all of it"
        assert np.abs(seen.progress[job]).max() < 1e-6
    assert not made.solved(states).any()


def test_a_start_rests() -> None:
    """Nothing moves while the hand stands still: the robot is weightless, the mug lies."""
    world = task().world(4)
    start = world.reset(np.arange(4), np.arange(4))
    for _ in range(25):
        state = world.step(np.arange(4), np.tile([0.0, 0.0, 0.0, -1.0], (4, 1)))
    assert np.abs(state - start).max() < 2e-3


def test_actions_move_hand_and_fingers() -> None:
    world = task().world(3)
    start = world.reset(np.arange(3), np.arange(3))
    for _ in range(5):
        state = world.step(np.arange(3), np.array([[1.0, 0, 0, -1.0], [0, -0.5, 0.5, -1.0], [0, 0, 0, 1.0]]))
    moved = (state - start)[:, HAND]
    assert 0.1 < moved[0, 0] < 0.15
    assert np.abs(moved[0, 1:]).max() < 0.01
    assert moved[1, 1] < -0.04
    assert moved[1, 2] > 0.04
    assert state[0, 3] == pytest.approx(0.10, abs=2e-3)
    assert state[2, 3] == pytest.approx(0.03, abs=6e-3)


def test_the_hand_stays_over_the_table() -> None:
    seen = drive("table-top", 0, np.tile([0.0, -1.0, -1.0, -1.0], (30, 1)))
    assert seen[:, 1].min() > scene.LOWEST[1] - 0.01
    assert seen[:, 2].min() > 0.0


@pytest.mark.parametrize("job", JOBS)
def test_solved_is_all_that_is_asked(job: str) -> None:
    """Each threshold alone, and all three at once."""
    column = {"mug": MUG.start + 1, "drawer": EXTENSION, "faucet": ANGLE}
    state = task().world(1).reset(rows(0), rows(0))[0]
    for name in JOBS:
        state[column[name]] += SOLVED[name] + 1e-3
    assert task().solved(state)
    assert task(f"table-top-{job}").solved(state)
    state[column[job]] -= 2e-3
    assert not task().solved(state)
    assert not task(f"table-top-{job}").solved(state)
    assert all(task(f"table-top-{other}").solved(state) for other in JOBS if other != job)


def test_goals_are_where_things_are_moved_to() -> None:
    last = np.array([trajectory.states[-1] for trajectory in shown()])
    made = task()
    goals = np.array([[marker.place for marker in made.markers(state)] for state in last])
    assert (last[:, MUG_GOAL] - goals[:, 0] == 0).all()
    bar, knob = last[:, BAR] - goals[:, 1], last[:, GRIP] - goals[:, 2]
    assert np.abs(np.abs(bar[:, 1]) - np.abs(0.10 - last[:, EXTENSION])).max() < 1e-9
    assert np.abs(np.linalg.norm(knob, axis=1) - 0.24 * np.sin(np.abs(last[:, ANGLE] - 0.6) / 2)).max() < 2e-3


def test_a_row_moves_alone_as_in_a_batch() -> None:
    commands = np.random.default_rng(0).uniform(-1, 1, size=(STEPS, 3, 4))
    world = task().world(3)
    world.reset(rows(0, 1, 2), rows(1, 2, 3))
    batch = np.array([world.step(rows(0, 1, 2), command) for command in commands])
    assert (batch[:, 1] == drive("table-top", 2, commands[:, 1])).all()
    world.reset(rows(2, 0), rows(2, 7))
    assert (np.array([world.step(rows(2), command[1:2])[0] for command in commands]) == batch[:, 1]).all()
    assert world.control_steps == 4 * STEPS


@pytest.mark.parametrize("name", ["table-top", "table-top-open"])
def test_a_saved_row_goes_on_bit_for_bit_elsewhere(name: str) -> None:
    """From the middle of a demonstration, while the drawer is pulled."""
    trajectory = shown(DEFAULT, name)[0]
    assert trajectory.actions is not None
    assert trajectory.snapshots is not None
    middle = int(task(name).seen(trajectory.states).progress["drawer"].searchsorted(0.03))
    world = task(name).world(2)
    assert (world.load(rows(1), trajectory.snapshots[middle][None])[0] == trajectory.states[middle]).all()
    again = [world.step(rows(1), action[None])[0] for action in trajectory.actions[middle:]]
    assert (np.array(again) == trajectory.states[middle + 1 :]).all()
    assert (world.save(rows(1))[0] == trajectory.snapshots[-1]).all()


def test_a_row_that_leaves_physics_says_so() -> None:
    world = task().world(2)
    world.reset(rows(0, 1), rows(0, 1))
    world.engine.states[0, world._places.mug[2]] = np.inf
    seen = world.step(rows(0, 1), np.zeros((2, 4)))
    assert world.diverged(rows(0, 1)).tolist() == [True, False]
    assert np.isfinite(seen[1]).all()


def test_what_is_not_possible_is_refused() -> None:
    world = task().world(1)
    with pytest.raises(ValueError, match="never reset"):
        world.step(rows(0), np.zeros((1, 4)))
    world.reset(rows(0), rows(0))
    with pytest.raises(ValueError, match="not finite"):
        world.step(rows(0), np.array([[0.0, np.nan, 0.0, 0.0]]))
    with pytest.raises(TaskError, match="expected"):
        world.load(rows(0), np.zeros((1, 10)))
    with pytest.raises(TaskError, match="unknown style 'clumsy': expected one of default, brisk"):
        demonstrate(task(), 2, 0, "clumsy")
    with pytest.raises(TaskError, match="expected one of"):
        make_task("table-top-lamp")


def test_attributes_stay_within_their_bounds() -> None:
    states = np.concatenate([trajectory.states for trajectory in shown()])
    columns = task().layout.columns
    for (index, name, goal), place in columns.items():
        attribute = next(a for a in task().layout.type_of(index).described(goal) if a.name == name)
        assert ((states[:, place] >= attribute.low) & (states[:, place] <= attribute.high)).all(), name


@pytest.mark.parametrize("style", [DEFAULT, "brisk", "topdown", "detours", "stop", MIXED])
def test_the_demonstrator_succeeds(style: str) -> None:
    """Of 64 episodes it solves all but one or two in every style; here fewer are tried."""
    assert np.mean([episode.succeeded for episode in attempts(style)]) >= 0.9


@pytest.mark.parametrize("name", NAMES[1:])
def test_every_variant_is_demonstrated(name: str) -> None:
    found = shown(DEFAULT, name)
    assert len(found) >= 0.9 * ATTEMPTS
    for trajectory in found:
        solved = task(name).solved(trajectory.states)
        assert solved[-STYLES[DEFAULT].after :].all()
        assert not solved[0]


def test_the_demonstrator_has_no_memory() -> None:
    states = shown(DEFAULT, "table-top-any-order")[0].states
    command = task("table-top-any-order").command
    order = np.random.default_rng(0).permutation(len(states))
    assert (command(states)[order] == command(states[order])).all()


def firsts(name: str) -> list[tuple[str, ...]]:
    """In which order things are solved, episode by episode."""
    found = []
    for trajectory in shown(DEFAULT, name):
        progress = task(name).seen(trajectory.states).progress
        found.append(tuple(sorted(JOBS, key=lambda job: int((progress[job] > SOLVED[job]).argmax()))))
    return found


def test_orders() -> None:
    """Mug, drawer, faucet; or any, as announced by the start."""
    assert set(firsts("table-top")) == {JOBS}
    drawn = task("table-top-any-order")
    assert len(set(firsts("table-top-any-order"))) >= 4
    starts = np.array([trajectory.states[0] for trajectory in shown(DEFAULT, "table-top-any-order")])
    assert firsts("table-top-any-order") == [tuple(JOBS[rank] for rank in ranks) for ranks in drawn.order(starts)]
    states = drawn.world(64).reset(np.arange(64), np.arange(64))
    assert {tuple(ranks) for ranks in drawn.order(states)} == set(permutations(range(3)))


def test_the_hand_crosses_above_everything() -> None:
    """On the way from the mug to the drawer, and from there to the faucet."""
    for trajectory in shown():
        hand = trajectory.states[:, HAND]
        ranks = moves.next_job(task().seen(trajectory.states), np.tile([0, 1, 2], (len(hand), 1)))
        for rank, between in ((1, (-0.2, -0.1)), (2, (-0.1, 0.15))):
            crosses = (ranks == rank) & (hand[:, 0] > between[0]) & (hand[:, 0] < between[1])
            assert crosses.sum() >= 2
            assert hand[crosses, 2].min() > 0.15


@pytest.mark.skipif(not graphics.backends(), reason="no OpenGL library on this machine")
def test_pictures_show_goals_and_the_drawer() -> None:
    trajectory = shown()[0]
    assert trajectory.snapshots is not None
    painter = task().painter(320, 240)
    assert painter is not None
    first, last = (painter(trajectory.states[i], trajectory.snapshots[i]).astype(int) for i in (0, -1))
    moved = trajectory.states[0].copy()
    moved[MUG_GOAL] = (0.0, 0.45, 0.03)
    other = painter(moved, trajectory.snapshots[0]).astype(int)
    painter.close()
    assert first.shape == (240, 320, 3)
    green = (first[..., 1] > first[..., 0] + 15) & (first[..., 1] > first[..., 2] + 15)
    assert green.sum() > 500, "the drawer"
    assert (np.abs(first - last).max(axis=2) > 20).sum() > 2000, "the robot has moved"
    assert 20 < (np.abs(first - other).max(axis=2) > 20).sum() < 1500, "only a goal"
