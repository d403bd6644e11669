"""Environments of robosuite as tasks."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest

from roboscribe.envs.catalogue import make_task
from roboscribe.envs.drawer import geometry, moves
from roboscribe.envs.drawer.world import DrawerWorld
from roboscribe.envs.suite.bench import bench
from roboscribe.envs.suite.moves import BLOCK, HAND, OPENING, YAW, lift
from roboscribe.envs.suite.request import SuiteRequest, parse
from roboscribe.envs.suite.workers import Moved, serve
from roboscribe.envs.suite.world import SuiteWorld
from roboscribe.envs.tasks.robosuite import SuiteTask
from roboscribe.errors import TaskError
from roboscribe.search.features import enumerate_features
from roboscribe.world.layout import ROBOT
from roboscribe.world.task import Task

NAMES = ("Lift", "Stack", "PickPlaceCan", "Door", "NutAssemblySquare", "PlaceCubesDrawer")
ROW, PAIR = np.array([0]), np.array([0, 1])


@pytest.fixture(params=NAMES)
def task(request: pytest.FixtureRequest) -> Task:
    return make_task(f"robosuite:{request.param}")


def test_a_seed_decides_the_start_and_a_snapshot_the_rest(task: Task) -> None:
    world, actions = task.world(2), np.random.default_rng(0).uniform(-1, 1, size=(4, 2, task.action_size))
    states = world.reset(PAIR, np.array([3, 4]))
    assert states.shape == (2, task.layout.size)
    assert (states[0] != states[1]).any()
    assert (task.world(1).reset(ROW, np.array([3]))[0] == states[0]).all()
    assert not task.solved(states).any()
    seen = [world.step(PAIR, action) for action in actions[:2]]
    saved = world.save(PAIR)
    rest = [world.step(PAIR, action) for action in actions[2:]]
    other = task.world(2)
    assert (other.load(PAIR[::-1], saved) == seen[-1]).all()
    again = [other.step(PAIR[::-1], action) for action in actions[2:]]
    assert (np.array(again) == np.array(rest)).all()
    assert not world.diverged(PAIR).any()
    assert world.control_steps == 8


@pytest.mark.parametrize("name", ["Stack", "Door", "PlaceCubesDrawer", "Lift,robot=Sawyer,controller=OSC_POSE"])
def test_short_steps_are_those_of_robosuite(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bench(parse(name))
    start, _ = one.reset(3)
    actions = np.random.default_rng(0).uniform(-1, 1, size=(4, one.action_size))
    assert one._substeps is not None
    ends = []
    for short in (one._substeps, None):
        monkeypatch.setattr(one, "_substeps", short)
        snapshot = start
        for action in actions:
            snapshot, state, good = one.step(snapshot, action)
            assert good
        ends.append(np.concatenate([snapshot, state]))
    assert (ends[0] == ends[1]).all()


def test_controllers_that_work_otherwise_keep_robosuites_own_steps() -> None:
    assert bench(parse("Lift,controller=JOINT_POSITION"))._substeps is None


def test_no_predicate_speaks_of_success() -> None:
    layout = make_task("robosuite:Stack").layout
    assert (ROBOT, "solved", False) in layout.columns
    assert not [f for f in enumerate_features(layout, layout.names) if "solved" in str(f.term)]


def test_goals_are_the_environments_own() -> None:
    lift, stack = make_task("robosuite:Lift"), make_task("robosuite:Stack")
    assert not any(kind.goal for kind in lift.layout.entities)
    state = stack.world(1).reset(ROW, ROW)[0]
    goal, other = (state[stack.layout.columns[key]] for key in ((0, "position", True), (1, "position", False)))
    assert np.allclose(goal - other, (0, 0, 0.045))
    for name, place in (("PickPlaceCan", (0.198, 0.403, 0.8)), ("NutAssemblySquare", (0.23, 0.10, 0.85))):
        there = make_task(f"robosuite:{name}")
        row = there.world(1).reset(ROW, ROW)[0]
        assert np.allclose(row[there.layout.columns[0, "position", True]], place, atol=0.01)


@pytest.mark.parametrize(("name", "seed"), [("Lift", 1), ("Stack", 2)])
def test_scripts_solve_lift_and_stack(name: str, seed: int) -> None:
    task = make_task(f"robosuite:{name}")
    found = task.demonstrate(2, seed)
    assert all(task.solved(trajectory.states)[-1] for trajectory in found)


@pytest.mark.parametrize(("yaw", "gap", "lifts"), [(0.0, 0.043, True), (0.0, 0.057, False), (np.pi / 4, 0.057, True)])
def test_fingers_that_hold_a_block_across_its_edges_hold_it(yaw: float, gap: float, lifts: bool) -> None:
    state = np.zeros((1, 14))
    state[:, HAND] = state[:, BLOCK] = (0.0, 0.0, 0.83)
    state[:, OPENING], state[:, YAW] = gap, yaw
    assert bool(lift(state)[0, 2] > 0.5) is lifts


def test_the_drawer_begins_as_the_batched_one_and_moves_alike() -> None:
    task = make_task("robosuite:PlaceCubesDrawer")
    ours, theirs = DrawerWorld(3, False, "fast", 1), task.world(1)
    one, other = ours.reset(ROW, np.array([5])), theirs.reset(ROW, np.array([5]))
    assert task.layout == make_task("place-cubes-drawer-3").layout
    assert np.abs(one - other).max() < 2e-3
    for _ in range(12):
        action = moves.command(one)
        one, other = ours.step(ROW, action), theirs.step(ROW, action)
    assert np.linalg.norm(one[0, :3] - other[0, :3]) < 0.01


def test_the_drawer_has_to_be_shut_where_that_is_asked_for() -> None:
    ours, theirs = make_task("place-cubes-drawer-1-closed"), make_task("robosuite:PlaceCubesDrawer,cubes=1,closed=yes")
    one, other = (task.world(1).reset(ROW, np.array([5])) for task in (ours, theirs))
    assert np.abs(one - other).max() < 2e-3
    assert ours.horizon == theirs.horizon
    state = one.copy()
    state[:, 12:15] = state[:, 7:10] - np.array(geometry.HANDLE) + (0.0, 0.0, 0.036)
    for extension, shut in ((0.01, True), (0.1, False)):
        state[:, 10] = extension
        assert bool(theirs.solved(state)[0]) is bool(ours.solved(state)[0]) is shut


def test_processes_give_the_same_as_one() -> None:
    task = make_task("robosuite:Lift")
    assert isinstance(task, SuiteTask)
    alone, shared = SuiteWorld(task.request, 3, 1), SuiteWorld(task.request, 3, 2)
    rows, actions = np.arange(3), np.random.default_rng(1).uniform(-1, 1, size=(3, 4))
    assert (alone.reset(rows, rows) == shared.reset(rows, rows)).all()
    assert (alone.step(rows, actions) == shared.step(rows, actions)).all()


ASKER_IS_GONE = threading.Event()


def late(request: SuiteRequest) -> Moved:
    """Answer when nobody waits for it any more."""
    assert ASKER_IS_GONE.wait(10)
    return np.zeros((0, 1)), np.zeros((0, 1)), np.zeros(0, np.bool_)


def test_a_process_ends_without_a_word_when_whoever_asked_is_gone() -> None:
    """Formerly each printed a traceback after "interrupted; the same command goes on from here"."""
    mine, theirs = Pipe()
    with ThreadPoolExecutor(1) as pool:
        served = pool.submit(serve, theirs, parse("Lift"))
        mine.send((late, ()))
        mine.close()
        ASKER_IS_GONE.set()
        assert served.result(10) is None


def test_other_robots_and_controllers() -> None:
    task = make_task("robosuite:Lift,robot=Sawyer,controller=OSC_POSE")
    assert task.action_size == 7
    assert (ROBOT, "rotation", False) in task.layout.columns
    with pytest.raises(TaskError, match="brings no demonstrator"):
        task.demonstrate(1, 0)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Lifts", "no environment 'Lifts': did you mean Lift"),
        ("TwoArmLift", "has two arms"),
        ("Wipe", "outside the simulator's state"),
        ("PickPlaceSingle", "changes from episode to episode"),
        ("Lift,robot=Baxter", "no robot with one arm 'Baxter'"),
        ("Lift,controller=JOINT_VELOCITY", "controller 'JOINT_VELOCITY', expected one of HELD"),
        ("Lift,speed=2", "option 'speed=2', expected robot=NAME or controller=NAME"),
        ("Lift,closed=yes", "option 'closed=yes', expected robot=NAME"),
        ("PlaceCubesDrawer,closed=maybe", "closed=maybe, expected yes or no"),
    ],
)
def test_what_cannot_be_a_task_is_said(name: str, said: str) -> None:
    with pytest.raises(TaskError, match=said):
        make_task(f"robosuite:{name}")


INTERRUPTED = """
import os, signal, time
import numpy as np
from roboscribe.envs.suite.request import SuiteRequest
from roboscribe.envs.suite.workers import Workers

def told(request, numbers):
    return numbers, numbers, numbers > 0

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background ignore it
    pool = Workers(SuiteRequest("Lift"), 2)
    assert len(pool.do(told, np.arange(4.0))[0]) == 4
    try:
        os.killpg(0, signal.SIGINT)
        while True:  # another thread may be told first
            time.sleep(0.05)
    except KeyboardInterrupt:
        print("still", pool.do(told, np.arange(4.0))[0].sum())
"""


def test_ctrl_c_does_not_make_processes_talk(tmp_path: Path) -> None:
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    ended = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=120, start_new_session=True, check=False
    )
    assert (ended.stdout, ended.stderr, ended.returncode) == ("still 6.0\n", "", 0)
