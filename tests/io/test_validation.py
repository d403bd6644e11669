"""What a demonstration may hold, and which demonstrations are worth learning from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.errors import DemonstrationError, Fail
from roboscribe.io import Screened, check_trajectory, consistent, screen
from roboscribe.world import Layout, Trajectory
from tests.io.examples import B1, BOX, G1, G2, LAYOUT, ROBOT, TASK, carried

OPENING = LAYOUT.columns[-2, "opening", False]
TILT = LAYOUT.columns[1, "tilt", False]
ORIENTATION = LAYOUT.columns[0, "orientation", False]


def with_value(column: slice | int, value: float, frame: slice | int = 4) -> Trajectory:
    """Put one value into a good demonstration."""
    trajectory = carried(0)
    trajectory.states[frame, column] = value
    return trajectory


def check(trajectory: Trajectory) -> None:
    check_trajectory(trajectory, episode=7, source="demos", action_size=4)


def test_good_demonstrations_pass() -> None:
    check(carried(0))
    check(carried(0, actions=False))
    check(carried(0, length=1))


def test_values_on_the_edge_of_their_range_pass() -> None:
    check(with_value(OPENING, 0.08))
    trajectory = carried(0)
    assert trajectory.actions is not None
    trajectory.actions[:] = [1.0, -1.0, 1.0, -1.0]
    check(trajectory)


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (B1.start + 1, np.nan, r"column b1.position.y: found nan, expected a finite number"),
        (OPENING, -np.inf, r"column mu.opening: found -inf, expected a finite number"),
        (G2, np.nan, r"column g\(b2\).position.x: found nan, expected a finite number"),
        (B1.start, 412.0, r"column b1.position.x: found 412, expected -2 to 2 m \(is it in millimetres\?\)"),
        (OPENING, 40.0, r"column mu.opening: found 40, expected 0 to 0.08 m \(is it in millimetres\?\)"),
        (B1.start, 1e5, r"column b1.position.x: found 100000, expected -2 to 2 m$"),
        (TILT, 90.0, r"column b2.tilt: found 90, expected -4 to 4 rad \(is it in degrees\?\)"),
        (ORIENTATION, 1.0, r"column b1.orientation: found norm 2, expected 1"),
        (ORIENTATION, 0.0, r"column b1.orientation: found norm 0, expected 1"),
    ],
)
def test_numbers_that_cannot_be_right_are_refused(column: slice | int, value: float, message: str) -> None:
    with pytest.raises(DemonstrationError, match=r"^demos: episode 7, frame 4, " + message):
        check(with_value(column, value))


@pytest.mark.parametrize("value", [1.001, -2.0, np.nan, np.inf])
def test_actions_outside_their_range_are_refused(value: float) -> None:
    trajectory = carried(0)
    assert trajectory.actions is not None
    trajectory.actions[5, 2] = value
    with pytest.raises(
        DemonstrationError, match=rf"frame 5, column action\[2\]: found {value:g}, expected a number from"
    ):
        check(trajectory)


def test_arrays_that_do_not_fit_together_are_refused() -> None:
    good = carried(0)
    assert good.actions is not None
    assert good.snapshots is not None
    bad = {
        "states": (replace(good, states=good.states[:, 1:]), r"float64\(12, 25\), expected float64\(12, 26\)"),
        "actions": (replace(good, actions=good.actions[:-1]), r"float64\(10, 4\), expected float64\(11, 4\)"),
        "snapshots": (replace(good, snapshots=good.snapshots[1:]), r"float64\(11, 7\), expected float64\(12, S\)"),
    }
    for name, (trajectory, message) in bad.items():
        with pytest.raises(DemonstrationError, match=f"demos: episode 7: {name}: found {message}"):
            check(trajectory)
    with pytest.raises(DemonstrationError, match=r"actions: found float64\(11, 3\), expected float64\(11, 4\)"):
        check(replace(good, actions=good.actions[:, 1:]))


def test_a_goal_that_is_not_given_passes() -> None:
    check(with_value(G2, np.nan, slice(None)))


def test_screen_keeps_good_demonstrations() -> None:
    good = [carried(seed) for seed in range(3)]
    assert screen(TASK, good) == Screened(tuple(good), ())


def test_screen_leaves_out_what_shows_nothing_and_says_so() -> None:
    good = [carried(0), carried(1)]
    empty = replace(good[0], states=good[0].states[:0], actions=None, snapshots=None)
    flawed = [good[0], carried(2, reach=0.5), empty, carried(3, length=1), carried(0), good[1]]
    found = screen(TASK, flawed)
    assert isinstance(found, Screened)
    assert [t is g for t, g in zip(found.kept, good, strict=True)] == [True, True]
    assert found.report == (
        "episode 1: never reaches the goal; left out",
        "episode 2: empty; left out",
        "episode 3: one frame only; left out",
        "episode 4: duplicate of episode 0; left out",
    )


def test_screen_can_keep_flawed_demonstrations() -> None:
    found = screen(TASK, [carried(0), carried(2, reach=0.5), carried(0), carried(3, length=1)], leave_out=False)
    assert isinstance(found, Screened)
    assert len(found.kept) == 3
    assert found.report == (
        "episode 1: never reaches the goal; kept",
        "episode 2: duplicate of episode 0; kept",
        "episode 3: one frame only; left out",
    )


def test_passing_through_the_goal_counts_as_reaching_it() -> None:
    through = carried(5, reach=2.0, length=201)
    assert not TASK.solved(through.states[-1])
    assert isinstance(screen(TASK, [through], least=1), Screened)


@pytest.mark.parametrize(("count", "least"), [(0, 2), (1, 2), (4, 5)])
def test_too_few_are_an_error(count: int, least: int) -> None:
    with pytest.raises(
        DemonstrationError, match=f"^{count} usable demonstrations of carry-2 found, expected at least {least}"
    ):
        screen(TASK, [carried(seed) for seed in range(count)], least=least)


def test_too_few_says_what_was_left_out() -> None:
    with pytest.raises(
        DemonstrationError, match=r"^1 usable .*; episode 1: duplicate of episode 0; left out; .*; and 2 more"
    ):
        screen(TASK, [carried(0)] * 8)


def test_demonstrations_that_never_reach_the_goal_fail() -> None:
    found = screen(TASK, [carried(seed, reach=0.5) for seed in range(3)])
    assert found == Fail("none of the 3 demonstrations of carry-2 ever reaches the goal")


def test_goals_for_different_objects_fail() -> None:
    trajectories = [carried(0), with_value(G1, np.nan, slice(None))]
    expected = Fail("goals disagree: g(b1).position is given in only one of episodes 0 and 1")
    assert consistent(trajectories) == expected
    assert screen(TASK, trajectories) == expected


def test_goals_for_the_same_objects_agree() -> None:
    assert consistent([with_value(G1, np.nan, slice(None))] * 2) is None
    assert consistent([]) is None


def test_objects_that_are_missing_fail() -> None:
    absent = carried(1)
    for attribute in ("position", "orientation", "tilt"):
        absent.states[:, LAYOUT.columns[1, attribute, False]] = np.nan
    found = consistent([carried(0), absent])
    assert found == Fail("object counts disagree: episode 1 has no b2, the task has")


def test_other_layouts_fail() -> None:
    one_box = Layout(ROBOT, (BOX,))
    other = Trajectory(one_box, np.zeros((3, one_box.size)))
    found = consistent([carried(0), other])
    assert found == Fail("object counts disagree: episode 1 has b1, episode 0 has b1, b2")
