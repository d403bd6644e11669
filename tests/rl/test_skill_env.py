"""A skill's environment: what ends an attempt, what is paid, where it starts."""

from typing import Any

import numpy as np
import pytest

from roboscribe.dsl.syntax import Not, Solved, Truth
from roboscribe.rl.pool import StartPool
from roboscribe.rl.skill_env import SkillEnv, evaluate_skill
from roboscribe.rl.starts import Prefix, collect_starts
from roboscribe.rl.subtask import Invariant, Subtask
from roboscribe.world.layout import FloatArray, IntArray
from tests.rl.carry_world import AT, HOLD, PROGRAM, Carry, Direct

TASK = Carry()
GAMMA = 0.9


def pool(states: FloatArray, elapsed: int = 0) -> StartPool:
    count = len(states)
    snapshots = np.concatenate([states, np.zeros((count, 1))], axis=1)
    return StartPool(
        snapshots, states, np.zeros((count, 1), np.int64), np.full(count, elapsed), np.arange(count, dtype=np.int64)
    )


def env(subtask: Subtask, states: FloatArray, elapsed: int = 0) -> SkillEnv:
    made = SkillEnv(subtask, pool(states, elapsed), 1, GAMMA, np.random.default_rng(0))
    made.restart()
    return made


def hold(limit: int = 20, **options: Any) -> Subtask:  # noqa: ANN401 - any field
    return Subtask(TASK, HOLD, ("b",), limit, **options)


FAR = np.array([[0.0, 0.0, 0.2, 0.0, 0.3, 0.3]])
ON_IT = np.array([[0.0, 0.0, 0.01, 0.0, 0.3, 0.3]])
STILL = np.zeros((1, 2))


def test_reward_is_margin_plus_bonus_while_it_holds() -> None:
    far = env(hold(scales={str(HOLD.left): 0.5}), FAR).step(np.array([[1.0, 0.0]]))
    assert far.reward[0] == pytest.approx((1 - GAMMA) * (0.04 - 0.15) / 0.5)
    near = env(hold(), ON_IT).step(STILL)
    assert near.reward[0] == pytest.approx((1 - GAMMA) * (0.04 - 0.01 + 1))


def test_success_needs_three_steps_in_a_row_and_is_paid_like_holding_for_ever() -> None:
    started_on_it = env(hold(), ON_IT)
    first, second = started_on_it.step(STILL), started_on_it.step(STILL)
    assert not first.terminated[0]
    assert second.terminated[0]
    assert second.succeeded[0]
    assert second.reward[0] == pytest.approx(first.reward[0] + 1)


def test_step_limit_truncates_without_success() -> None:
    slow = env(hold(limit=2), FAR)
    assert not slow.step(STILL).truncated[0]
    outcome = slow.step(STILL)
    assert outcome.truncated[0]
    assert not outcome.terminated[0]
    np.testing.assert_array_equal(outcome.final, FAR)


def test_the_episodes_horizon_bounds_the_attempt() -> None:
    late = env(hold(limit=20), FAR, elapsed=TASK.horizon - 1)
    assert late.step(STILL).truncated[0]


def test_divergence_ends_as_a_failure_that_costs() -> None:
    edge = env(hold(), np.array([[0.99, 0.0, 0.2, 0.0, 0.3, 0.3]]))
    outcome = edge.step(np.array([[1.0, 0.0]]))
    assert outcome.terminated[0]
    assert not outcome.succeeded[0]
    assert outcome.reward[0] < -1


def test_the_last_skill_goes_on_until_the_task_is_solved() -> None:
    last = Subtask(TASK, AT, ("b",), 20, continues_if=Not(Truth()))
    almost = np.array([[0.23, 0.3, 0.23, 0.3, 0.3, 0.3]])
    made = env(last, almost)
    for _ in range(4):
        assert not made.step(STILL).terminated[0], "at holds, but the task is not solved"
    assert made.step(np.array([[1.0, 0.0]])).succeeded[0], "one step solves it; no confirmation is asked"


def test_the_opaque_goal_pays_one_when_solved() -> None:
    made = env(Subtask(TASK, Solved(), ("b",), 20), np.array([[0.23, 0.3, 0.23, 0.3, 0.3, 0.3]]))
    assert made.step(STILL).reward[0] == 0
    outcome = made.step(np.array([[1.0, 0.0]]))
    assert outcome.succeeded[0]
    assert outcome.reward[0] > 1


class _Two(Carry):
    """Two blocks; the second has been served."""

    def __init__(self) -> None:
        super().__init__(blocks=2)


SERVED = np.array([[0.0, 0.0, 0.2, 0.0, 0.3, 0.3, 0.03, 0.0, 0.0, 0.0]])
"""The hand is around the second block, which is at its goal; the first is asked for."""


def guarded() -> Subtask:
    return Subtask(_Two(), HOLD, ("b",), 20, invariant=Invariant(AT, "b", "block"))


def test_what_the_loop_has_achieved_must_stay() -> None:
    subtask = guarded()
    none = np.zeros((1, 1), np.int64)
    np.testing.assert_array_equal(subtask.protected(SERVED, none), [[False, True]])
    np.testing.assert_array_equal(subtask.protected(SERVED, none + 1), [[False, False]], "its own entity may move")
    made = SkillEnv(subtask, pool(SERVED), 1, GAMMA, np.random.default_rng(0))
    made.restart()
    outcomes = [made.step(np.array([[1.0, 0.0]])) for _ in range(3)]
    assert [bool(each.terminated[0]) for each in outcomes] == [False, False, True], "dragged along, confirmed"
    assert not outcomes[-1].succeeded[0]
    assert outcomes[-1].reward[0] < -0.9


class _Right:
    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        return np.repeat([[1.0, 0.0]], len(states), axis=0)


def test_evaluation_tells_harm_from_other_failures() -> None:
    away = SERVED.copy()
    away[0, :2] = (0.1, 0.1)
    subtask = guarded()
    found = evaluate_skill(subtask, pool(np.concatenate([SERVED, away])), _Right(), subtask.task.world(2))
    np.testing.assert_array_equal(found.success, [False, False])
    np.testing.assert_array_equal(found.harmful, [True, False])


def test_doing_no_harm_is_not_punished() -> None:
    away = SERVED.copy()
    away[0, :2] = (0.1, 0.1)
    made = SkillEnv(guarded(), pool(away), 1, GAMMA, np.random.default_rng(0))
    made.restart()
    assert not any(made.step(STILL).terminated[0] for _ in range(5))


def test_rows_that_end_start_again_from_the_pool() -> None:
    made = env(hold(limit=1), FAR)
    made.step(np.array([[0.0, 1.0]]))
    np.testing.assert_array_equal(made.states, FAR)


def test_evaluation_visits_every_start_once_whatever_the_batch() -> None:
    starts = np.random.default_rng(0).uniform(-0.3, 0.3, (23, 6))
    worlds = [TASK.world(batch) for batch in (1, 4, 23)]
    found = [evaluate_skill(hold(limit=9), pool(starts), Direct(carry=False), world) for world in worlds]
    for evaluation in found:
        np.testing.assert_array_equal(evaluation.final, found[0].final)
        np.testing.assert_array_equal(evaluation.success, found[0].success)
        assert evaluation.control_steps == found[0].control_steps
    near = np.linalg.norm(starts[:, :2] - starts[:, 2:4], axis=1) < 0.2
    assert found[0].success[near].all()


def test_starts_of_the_first_skill_are_the_initial_states() -> None:
    prefix = Prefix(PROGRAM, (0,), {}, {})
    found, steps = collect_starts(prefix, TASK, 6, np.arange(20), np.random.default_rng(0), batch=4)
    assert steps == 0
    assert len(found) == 6
    np.testing.assert_array_equal(found.states, TASK.world(6).reset(np.arange(6), np.arange(6)))


def test_starts_of_the_second_skill_are_where_the_first_has_arrived() -> None:
    prefix = Prefix(PROGRAM, (1,), {"hold": Direct(carry=False)}, {})
    found, steps = collect_starts(prefix, TASK, 8, np.arange(20), np.random.default_rng(0), batch=4)
    assert len(found) == 8
    assert steps >= found.elapsed.sum()
    assert (np.linalg.norm(found.states[:, :2] - found.states[:, 2:4], axis=1) < 0.04).all()
    assert (found.elapsed >= 2).all(), "hold is confirmed over three observations"
    again = TASK.world(8).load(np.arange(8), found.snapshots)
    np.testing.assert_array_equal(again, found.states)


def test_a_prefix_that_never_arrives_gives_an_empty_pool() -> None:
    class Idle:
        def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
            return np.zeros((len(states), 2))

    starts = TASK.world(40).reset(np.arange(40), np.arange(40))
    far = np.flatnonzero(np.linalg.norm(starts[:, :2] - starts[:, 2:4], axis=1) > 0.04)[:5]
    found, _ = collect_starts(Prefix(PROGRAM, (1,), {"hold": Idle()}, {}), TASK, 4, far, np.random.default_rng(0))
    assert len(found) == 0
    assert found.entities.shape == (0, 1)


def test_hard_starts_are_repeated_until_they_are_half() -> None:
    starts = pool(np.random.default_rng(0).uniform(size=(8, 6)))
    hard = np.arange(8) < 2
    stressed = starts.oversample_hard(hard)
    assert np.isin(stressed.states[:, 0], starts.states[hard, 0]).mean() == 0.5
    assert len(np.unique(stressed.states[:, 0])) == 8
    assert len(starts.oversample_hard(hard, most=2)) == 6 + 2 * 2
    assert len(starts.oversample_hard(~hard)) == len(starts.oversample_hard(np.zeros(8, np.bool_))) == 8


def test_starts_with_the_same_entities_are_capped_by_episode() -> None:
    starts = pool(np.random.default_rng(0).uniform(size=(6, 6)))
    repeated = starts.take(np.array([0, 0, 0, 1, 2, 2]))
    np.testing.assert_array_equal(repeated.capped(2).episode, [0, 0, 1, 2, 2])
