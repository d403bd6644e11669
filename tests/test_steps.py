"""What programs showed: outcomes, and when they are good enough."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.rollouts import Rollouts
from roboscribe.envs.point_world import PointTask
from roboscribe.steps import Limits, Outcome
from roboscribe.world.layout import NULL, FloatArray
from roboscribe.world.trajectory import Trajectory

LAYOUT = PointTask("toy", ("block",) * 3).layout
NO_STATES = np.empty((0, LAYOUT.size))


def outcome(successes: int, episodes: int = 20) -> Outcome:
    """Build an outcome."""
    return Outcome(successes, episodes, NO_STATES)


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
    """For 20 of 20 and z = 1.96: 20 / (20 + 3.8416) to 1; for 0 of 20 its mirror image; half is symmetric."""
    assert outcome(20).interval == pytest.approx((20 / 23.8416, 1.0))
    assert outcome(0).interval == pytest.approx((0.0, 3.8416 / 23.8416))
    low, high = outcome(10).interval
    assert low + high == pytest.approx(1.0)
    assert outcome(100, 200).interval[0] > low, "more episodes say more"


def test_better_is_what_no_chance_explains() -> None:
    assert outcome(20).beats(outcome(10))
    assert not outcome(20).beats(outcome(16)), "0.84 to 1 and 0.58 to 0.92 overlap"
    assert not outcome(10).beats(outcome(20))
    assert not outcome(15).beats(outcome(15))
    assert outcome(200, 200).beats(outcome(160, 200))


@pytest.mark.parametrize(
    ("successes", "episodes", "met"),
    [(20, 20, True), (18, 20, True), (17, 20, False), (180, 200, False), (190, 200, True), (0, 20, False)],
)
def test_limits_are_met_where_the_wanted_rate_cannot_be_ruled_out(successes: int, episodes: int, met: bool) -> None:
    """The upper ends of the intervals are 1, 0.972, 0.948, 0.934, 0.973 and 0.16; 0.97 is wanted."""
    assert Limits(success=0.97).met(outcome(successes, episodes)) == met


def test_a_lower_rate_is_met_sooner() -> None:
    assert not Limits(success=0.9).met(outcome(10))
    assert Limits(success=0.7).met(outcome(10))
    assert Limits(success=0.0).met(outcome(0))


def test_failures_are_named_by_binding_and_broken_episodes_left_out() -> None:
    outside = [[NULL], [NULL], [NULL]]
    ran = rollouts(outside, [(0,), (2, 0), (1,)], [True, False, False], [False, False, True])
    found = Outcome.of(ran)
    assert (found.successes, found.episodes) == (1, 3)
    assert np.array_equal(found.failures, failures(ran, 1, slice(None), (2, 0, 1)))


def test_a_loop_fails_at_the_entity_that_it_served_last_which_is_named_first() -> None:
    """Block 1 was placed in steps 1 and 2; block 2 was to be placed in steps 3 to 5, and never was."""
    ran = rollouts([[1, 1, 2, 2, 2]], [(1, 2)], [False])
    assert np.array_equal(Outcome.of(ran).failures, failures(ran, 0, slice(3, 6), (2, 1, 0)))


def test_an_entity_that_is_served_again_fails_in_both_visits() -> None:
    ran = rollouts([[2, 1, 2]], [(2, 1)], [False])
    both = np.concatenate([failures(ran, 0, slice(1, 2), (2, 1, 0)), failures(ran, 0, slice(3, 4), (2, 1, 0))])
    assert np.array_equal(Outcome.of(ran).failures, both)


def test_what_fails_after_a_loop_shows_the_whole_episode() -> None:
    ran = rollouts([[1, 1, NULL, NULL]], [(1,)], [False])
    assert np.array_equal(Outcome.of(ran).failures, failures(ran, 0, slice(None), (1, 0, 2)))


def test_where_nothing_fails_there_are_no_failures() -> None:
    assert Outcome.of(rollouts([[NULL]], [()], [True])).failures.shape == (0, LAYOUT.size)
