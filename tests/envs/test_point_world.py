"""The kinematic plane: what moves, what does not, and who can solve it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.rewrite import controllers
from roboscribe.envs.catalogue import make_task, task_names
from roboscribe.envs.point_kinematics import GRASP, REACH, STEP, TRAVEL, advance
from roboscribe.envs.point_world import AT, POINT_TASKS, Lookahead, PointTask, lookahead_skills
from roboscribe.errors import TaskError
from roboscribe.world.layout import ROBOT, FloatArray
from tests.handmade import state

BLOCKS = PointTask("toy", ("block", "block"))
PUSH = replace(BLOCKS, fingers=False)
DRAWER = PointTask("toy", ("drawer",))
FAR = np.array([0.9, 0.9])


def moved(task: PointTask, start: FloatArray, *action: float) -> FloatArray:
    """Apply one action to one state."""
    return advance(task.layout, task.fingers, start, np.array(action))


def place(task: PointTask, row: FloatArray, entity: int) -> FloatArray:
    """Position of an object, or of the gripper."""
    return row[..., task.layout.columns[entity, "position", False]]


def scene(task: PointTask, hand: tuple[float, float], thing: tuple[float, float]) -> FloatArray:
    """Gripper and first object where told, everything else far away."""
    places = np.stack([np.array(thing), FAR])
    return state(task.layout, np.array(hand), places, np.stack([FAR, FAR]))


def test_the_gripper_moves_at_most_a_step_an_axis() -> None:
    start = scene(BLOCKS, (0.5, 0.5), (0.1, 0.1))
    assert place(BLOCKS, moved(BLOCKS, start, 7.0, -0.5, -1.0), ROBOT) == pytest.approx([0.5 + STEP, 0.5 - STEP / 2])


def test_open_fingers_pass_an_object_by_and_closed_ones_drag_it() -> None:
    start = scene(BLOCKS, (0.5, 0.5), (0.52, 0.5))
    assert place(BLOCKS, moved(BLOCKS, start, 0.0, 1.0, -1.0), 0) == pytest.approx([0.52, 0.5])
    held = moved(BLOCKS, start, 0.0, 1.0, 1.0)
    assert place(BLOCKS, held, 0) == pytest.approx([0.5 + GRASP, 0.5 + STEP])
    assert place(BLOCKS, held, 1) == pytest.approx(FAR)


def test_closed_fingers_out_of_reach_hold_nothing() -> None:
    start = scene(BLOCKS, (0.5, 0.5), (0.5 + 1.01 * REACH, 0.5))
    assert place(BLOCKS, moved(BLOCKS, start, 0.0, 1.0, 1.0), 0) == pytest.approx([0.5 + 1.01 * REACH, 0.5])


def test_closed_fingers_take_the_nearest() -> None:
    start = scene(BLOCKS, (0.5, 0.5), (0.52, 0.5))
    start[BLOCKS.layout.columns[1, "position", False]] = (0.5, 0.51)
    after = moved(BLOCKS, start, -1.0, 0.0, 1.0)
    assert place(BLOCKS, after, 0) == pytest.approx([0.52, 0.5])
    assert place(BLOCKS, after, 1) == pytest.approx([0.5 - STEP, 0.51])


def test_a_drawer_slides_along_x_as_far_as_it_goes() -> None:
    start = np.zeros(DRAWER.layout.size)
    columns = DRAWER.layout.columns
    start[columns[ROBOT, "position", False]] = start[columns[0, "position", False]] = (0.1, 1.1)
    row = start
    for step in range(1, 7):
        row = moved(DRAWER, row, 1.0, 0.3, 1.0) if step == 1 else moved(DRAWER, row, 1.0, 0.0, 1.0)
        opened = min(TRAVEL, STEP * step)
        assert row[columns[0, "opening", False]] == pytest.approx(opened)
        assert place(DRAWER, row, 0) == pytest.approx([0.1 + opened, 1.1])


def test_pushing_keeps_objects_at_arms_length_and_does_not_jump_over_them() -> None:
    row = scene(PUSH, (0.5, 0.5), (0.54, 0.5))
    for _ in range(5):
        row = moved(PUSH, row, 1.0, 0.0)
        assert np.linalg.norm(place(PUSH, row, 0) - place(PUSH, row, ROBOT)) == pytest.approx(REACH)
    assert place(PUSH, row, 0)[0] > place(PUSH, row, ROBOT)[0]
    assert place(PUSH, row, 1) == pytest.approx(FAR)


def test_an_object_touched_aside_slips_off_to_that_side() -> None:
    row = scene(PUSH, (0.5, 0.5), (0.54, 0.51))
    for _ in range(5):
        row = moved(PUSH, row, 1.0, 0.0)
    assert place(PUSH, row, 0)[1] > 0.5 + 0.9 * REACH
    assert place(PUSH, row, 0)[0] < place(PUSH, row, ROBOT)[0]


def test_many_actions_from_one_state_are_the_same_as_one_by_one() -> None:
    rng = np.random.default_rng(0)
    for task in POINT_TASKS.values():
        start = task.initial(3)
        actions = rng.uniform(-1.0, 1.0, (6, task.action_size))
        together = advance(task.layout, task.fingers, start, actions)
        for one, row in zip(actions, together, strict=True):
            assert np.array_equal(advance(task.layout, task.fingers, start, one), row)


@pytest.mark.parametrize("name", sorted(POINT_TASKS))
def test_every_task_is_in_the_catalogue_and_its_demonstrations_solve_it(name: str) -> None:
    task = make_task(name)
    assert name in task_names()
    assert task is POINT_TASKS[name]
    shown = task.demonstrate(3, 0)
    assert len(shown) == 3
    for trajectory in shown:
        assert task.solved(trajectory.states[-1])
        assert not task.solved(trajectory.states[0])
        assert trajectory.actions is not None
        replayed = trajectory.states[0]
        for action, after in zip(trajectory.actions, trajectory.states[1:], strict=True):
            replayed = advance(POINT_TASKS[name].layout, POINT_TASKS[name].fingers, replayed, action)
            assert np.array_equal(replayed, after)


def test_demonstrations_depend_on_their_seed_alone() -> None:
    task = POINT_TASKS["point-peg-cube"]
    one, same, other = task.demonstrate(3, 0), task.demonstrate(3, 0), task.demonstrate(3, 1)
    assert all(np.array_equal(a.states, b.states) for a, b in zip(one, same, strict=True))
    assert not np.array_equal(one[0].states, other[0].states)
    fewer = task.demonstrate(2, 0)
    assert all(np.array_equal(a.states, b.states) for a, b in zip(one, fewer, strict=False))


def test_a_demonstrator_that_cannot_solve_the_task_says_so() -> None:
    hurried = replace(POINT_TASKS["point-tower-3"], horizon=5)
    with pytest.raises(RuntimeError, match="solved only 0 of"):
        hurried.demonstrate(2, 0)


def test_unknown_names_in_the_plane_are_refused() -> None:
    with pytest.raises(TaskError, match="unknown task 'point-tower-99': did you mean point-tower-5"):
        make_task("point-tower-99")


def test_solved_means_every_entity_within_reach_of_its_goal() -> None:
    goals = np.array([[1.3, 0.05], [1.3, 0.2]])
    hand = np.zeros(2)
    near = state(BLOCKS.layout, hand, np.add(goals, [0.9 * AT, 0.0]), goals)
    far = state(BLOCKS.layout, hand, np.add(goals, [[0.9 * AT, 0.0], [1.1 * AT, 0.0]]), goals)
    assert BLOCKS.solved(np.stack([near, far])).tolist() == [True, False]


def test_a_pusher_never_starts_behind_the_object() -> None:
    task = POINT_TASKS["point-push-1"]
    for seed in range(50):
        row = task.initial(seed)
        thing, goal = place(task, row, 0), row[task.layout.columns[0, "position", True]]
        assert (place(task, row, ROBOT) - thing) @ (goal - thing) >= 0.0


PROGRAM = """def P(μ : EE):
  b := get(λb:block. true)
  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.015
  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.03"""


def test_lookahead_controllers_carry_a_program_out() -> None:
    task = POINT_TASKS["point-pick-place-1"]
    program = parse_program(PROGRAM)
    skills = lookahead_skills(task, program, lambda _: {})
    ran = execute(program, skills, task, np.arange(8), limits={})
    assert ran.success.all()


def test_without_subgoals_lookahead_is_short_sighted() -> None:
    task = POINT_TASKS["point-pick-place-1"]
    program = parse_program(PROGRAM.replace("  π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.015\n", ""))
    skills = lookahead_skills(task, program, lambda _: {})
    ran = execute(program, skills, task, np.arange(8), limits={})
    assert not ran.success.any()


def test_lookahead_forgets_nothing_and_remembers_nothing() -> None:
    task = POINT_TASKS["point-pick-place-1"]
    (hold, _) = controllers(parse_program(PROGRAM))
    states = np.stack([task.initial(seed) for seed in range(4)])
    entities = np.zeros((4, 1), dtype=np.int64)
    once, again = (Lookahead(task, hold, {}).act(states, entities) for _ in range(2))
    assert np.array_equal(once, again)
    assert (np.abs(once) <= 1.0).all()
