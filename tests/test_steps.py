"""What programs showed: outcomes, and when they are good enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.dsl.rollouts import Rollouts
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import TaskError
from roboscribe.steps import Failure, Limits, Outcome
from roboscribe.world.layout import NULL, FloatArray
from roboscribe.world.trajectory import Trajectory

LAYOUT = PointTask("toy", ("block",) * 3).layout
NO_STATES = np.empty((0, LAYOUT.size))


def outcome(successes: int, episodes: int = 20) -> Outcome:
    """Build an outcome."""
    return Outcome(successes, episodes)


def rollouts(
    served: list[list[int]], bound: list[tuple[int, ...]], success: list[bool], diverged: list[bool] | None = None
) -> Rollouts:
    """Build episodes, given whom each served at each step; every number of every state is another one."""
    count = sum(len(steps) + 1 for steps in served)
    states = np.arange(count * LAYOUT.size, dtype=np.float64).reshape(count, LAYOUT.size)
    parts = np.split(states, np.cumsum([len(steps) + 1 for steps in served])[:-1])
    return Rollouts(
        LAYOUT,
        tuple(Trajectory(LAYOUT, part) for part in parts),
        success=np.array(success),
        diverged=np.array(diverged or [False] * len(served)),
        bound=tuple(bound),
        control_steps=0,
        lines=tuple(np.zeros(len(steps), dtype=np.int64) for steps in served),
        served=tuple(np.array(steps, dtype=np.int64) for steps in served),
    )


def failures(ran: Rollouts, episode: int, frames: slice, order: tuple[int, ...]) -> FloatArray:
    """Frames of an episode under other names."""
    return LAYOUT.permute(ran.trajectories[episode].states[frames], order)


def test_the_interval_is_wilsons() -> None:
    """For 20 of 20 and z = 1.95996: 20 / (20 + 3.841459) to 1; for 0 of 20 its mirror image; half is symmetric."""
    assert outcome(20).interval == pytest.approx((20 / 23.841459, 1.0))
    assert outcome(0).interval == pytest.approx((0.0, 3.841459 / 23.841459))
    low, high = outcome(10).interval
    assert low + high == pytest.approx(1.0)
    assert outcome(100, 200).interval[0] > low, "more episodes say more"


def test_better_is_more_than_one_episode() -> None:
    assert outcome(20).beats(outcome(10))
    assert outcome(12).beats(outcome(10))
    assert not outcome(11).beats(outcome(10))
    assert not outcome(10).beats(outcome(20))
    assert not outcome(15).beats(outcome(15))
    assert outcome(12, 20).beats(outcome(50, 100)), "shares are compared, whatever the count of episodes"
    assert not outcome(11, 20).beats(outcome(50, 100))


@pytest.mark.parametrize(
    ("successes", "episodes", "met", "undecided"),
    [
        (20, 20, True, True),
        (19, 20, True, True),  # one episode decides nothing
        (18, 20, False, True),  # the interval ends at 0.972
        (17, 20, False, False),  # at 0.948
        (193, 200, True, True),
        (190, 200, False, True),  # at 0.973
        (180, 200, False, False),  # at 0.934: the same share as 18 of 20, of which more is known
        (0, 20, False, False),
    ],
)
def test_limits_are_met_undecided_or_missed(successes: int, episodes: int, met: bool, undecided: bool) -> None:
    limits, found = Limits(success=0.97), outcome(successes, episodes)
    assert (limits.met(found), limits.undecided(found)) == (met, undecided)


def test_a_lower_rate_is_met_sooner() -> None:
    assert not Limits(success=0.9).met(outcome(10))
    assert Limits(success=0.5).met(outcome(10))
    assert Limits(success=0.0).met(outcome(0))
    assert not Limits().met(outcome(0, 1)), "what never succeeded is not what is wanted"


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ({"programs": 0}, "programs: found 0, expected at least 1"),
        ({"success": 1.5}, "success: found 1.5, expected 0 to 1"),
        ({"refinements": -1}, "refinements: found -1, expected at least 0"),
    ],
)
def test_limits_out_of_range_are_refused(setting: dict[str, float], told: str) -> None:
    with pytest.raises(TaskError, match=told):
        Limits(**setting)  # type: ignore[arg-type]  # one setting at a time


def test_failures_are_named_by_binding_and_broken_episodes_left_out() -> None:
    outside = [[NULL], [NULL], [NULL]]
    ran = rollouts(outside, [(0,), (2, 0), (1,)], [True, False, False], [False, False, True])
    found = Outcome.of(ran)
    assert (found.successes, found.episodes) == (1, 3)
    assert np.array_equal(found.failures(), failures(ran, 1, slice(None), (2, 0, 1)))


def test_a_loop_fails_at_the_entity_that_it_served_last_which_is_named_first() -> None:
    """Block 1 was placed in steps 1 and 2; block 2 was to be placed in steps 3 to 5, and never was."""
    ran = rollouts([[1, 1, 2, 2, 2]], [(1, 2)], [False])
    assert np.array_equal(Outcome.of(ran).failures(), failures(ran, 0, slice(3, 6), (2, 1, 0)))


def test_an_entity_that_is_served_again_fails_in_both_visits() -> None:
    ran = rollouts([[2, 1, 2]], [(2, 1)], [False])
    both = np.concatenate([failures(ran, 0, slice(1, 2), (2, 1, 0)), failures(ran, 0, slice(3, 4), (2, 1, 0))])
    assert np.array_equal(Outcome.of(ran).failures(), both)


def test_what_fails_after_a_loop_shows_the_whole_episode() -> None:
    ran = rollouts([[1, 1, NULL, NULL]], [(1,)], [False])
    assert np.array_equal(Outcome.of(ran).failures(), failures(ran, 0, slice(None), (1, 0, 2)))


def test_where_nothing_fails_there_are_no_failures() -> None:
    assert Outcome.of(rollouts([[NULL]], [()], [True])).lost == ()


def test_most_failing_episodes_may_be_stuck_at_the_same_subgoal() -> None:
    lost = [Failure(np.full((2, 3), rank), name) for rank, name in enumerate(("at", "hold", "at", ""))]
    assert Outcome(1, 4, tuple(lost[:3])).stuck_at == "at"
    assert Outcome(0, 4, tuple(lost)).stuck_at == "", "half of them are not most"
    assert Outcome(4, 4).stuck_at == ""
    found = Outcome(0, 4, tuple(lost))
    assert np.array_equal(found.failures("at")[:, 0], [0, 0, 2, 2])
    assert len(found.failures()) == 8


def test_episodes_tell_what_they_were_stuck_at() -> None:
    ran = replace(rollouts([[NULL], [NULL]], [(), ()], [False, False], [False, True]), unreached=("at", "at"))
    assert [(len(each.states), each.unreached) for each in Outcome.of(ran).lost] == [(2, "at"), (0, "")]


@pytest.mark.parametrize(
    ("learned", "evaluated", "misled"),
    [(100, 384, True), (100, 480, False), (97, 470, False), (90, 200, False)],
)
def test_a_lighter_simulator_misled_where_a_program_is_good_there_alone_beyond_chance(
    learned: int, evaluated: int, misled: bool
) -> None:
    assert Limits(success=0.97).misled(Outcome(learned, 100), Outcome(evaluated, 500)) == misled
