"""Hindsight: goals are replaced by what the same episode reached later, by the layout alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from gymnasium import spaces

from roboscribe.baselines.policy import set_policy
from roboscribe.baselines.replay import HindsightBuffer, Sampling
from roboscribe.baselines.transitions import Batch, Relabeller, cut, later, shown_transitions
from roboscribe.errors import DemonstrationError
from roboscribe.world import Trajectory
from roboscribe.world.layout import BoolArray, FloatArray
from tests.baselines.examples import KITCHEN, TINY, states_of
from tests.baselines.reach import Reach

TASK = Reach()


def test_goals_are_written_by_the_layout() -> None:
    """Every cube's goal becomes where it is in the other state, every drawer's goal its opening; all else stays."""
    states, reached = states_of(KITCHEN, 5), states_of(KITCHEN, 5, seed=1)
    found = Relabeller(KITCHEN)(states, reached)
    for entity, attribute in ((0, "position"), (1, "opening"), (2, "position"), (3, "position")):
        goal, own = (KITCHEN.columns[entity, attribute, which] for which in (True, False))
        assert (found[:, goal] == reached[:, own]).all()
        states[:, goal] = found[:, goal]
    assert (found == states).all()


def moves(places: list[float], goal: float) -> Batch:
    """Transitions of a hand that is at these places along x, one after the other."""
    states = np.array([[x, 0.0, x, 0.0, goal, 0.0] for x in places])
    solved = TASK.solved(states[1:])
    return Batch(states[:-1], np.zeros((len(places) - 1, 2)), states[1:], solved, np.zeros(len(solved), bool))


def test_the_task_judges_anew() -> None:
    batch = moves([0.0, 0.1, 0.2, 0.3], goal=5.0)
    reached = batch.following[[2, 2, 2]]
    found = batch.relabelled(np.ones(3, bool), reached, TASK)
    assert found.solved.tolist() == [False, False, True]
    assert (found.states[:, 4] == 0.3).all()
    assert (found.following[:, 4] == 0.3).all()
    assert (batch.states[:, 4] == 5.0).all()


def test_what_is_attained_already_stays_as_it_is() -> None:
    batch = moves([0.0, 0.01, 0.5], goal=5.0)
    found = batch.relabelled(np.array([True, True]), batch.following[[0, 1]], TASK)
    assert found.states[:, 4].tolist() == [5.0, 0.5]
    assert found.solved.tolist() == [False, True]


@dataclass(frozen=True)
class Strict(Reach):
    """A reach that cannot judge no states at all, like any task that lets NumPy work out a size."""

    def solved(self, states: FloatArray) -> BoolArray:
        return super().solved(states.reshape(len(states), -1, self.layout.size)[:, 0])


@pytest.mark.parametrize("chosen", [[False, False], [True, True]])
def test_no_state_is_judged_where_there_is_none(chosen: list[bool]) -> None:
    """None is chosen, or all goals are attained before."""
    batch = moves([0.0, 0.01, 0.02], goal=5.0)
    rows = np.array(chosen)
    found = batch.relabelled(rows, batch.states[rows], Strict())
    assert (found.states == batch.states).all()


def test_later_is_even() -> None:
    drawn = later(np.random.default_rng(0), np.full(4000, 3), np.full(4000, 6))
    assert np.bincount(drawn, minlength=8)[3:7].min() > 850
    assert set(drawn.tolist()) == {3, 4, 5, 6}


def test_demonstrations_are_cut_at_the_first_success() -> None:
    batch = moves([0.0, 0.2, 0.4, 0.6], goal=0.4)
    shown = Trajectory(TASK.layout, np.concatenate([batch.states, batch.following[-1:]]), np.ones((3, 2)))
    assert len(cut(shown, TASK)) == 3
    found = shown_transitions([shown, shown], TASK)
    assert found.batch.solved.tolist() == [False, True, False, True]
    assert found.last.tolist() == [1, 1, 3, 3]
    stateless = Trajectory(TASK.layout, shown.states[2:])
    with pytest.raises(DemonstrationError, match="no step before the first success"):
        shown_transitions([stateless], TASK)


def test_demonstrations_in_hindsight_stay_within_one() -> None:
    """Of two demonstrations along x, one far from the other, no goal is taken from the other."""
    near, far = (moves([base, base + 0.1, base + 0.2, base + 0.3], goal=9.0) for base in (0.0, 100.0))
    parts = [
        Trajectory(TASK.layout, np.concatenate([b.states, b.following[-1:]]), np.zeros((3, 2))) for b in (near, far)
    ]
    drawn = shown_transitions(parts, TASK).draw(np.random.default_rng(0), 500, 1.0, TASK)
    assert (drawn.states[:, 4] >= drawn.following[:, 2] - 1e-9).all()
    assert (drawn.states[:, 4] - drawn.states[:, 2] < 0.31).all()
    assert drawn.solved.any()
    assert not drawn.solved.all()


def buffer(size: int, rows: int, relabelled: float) -> HindsightBuffer:
    """Make an empty buffer for a reach."""
    tokenizer = set_policy("deepset", TASK.layout, 2, TINY.network).network.tokenizer
    sampling = Sampling(TASK, tokenizer, np.random.default_rng(0), relabelled)
    box, actions = spaces.Box(-np.inf, np.inf, (6,)), spaces.Box(-1.0, 1.0, (2,))
    return HindsightBuffer(size * rows, box, actions, "cpu", rows, sampling=sampling)


def fill(kept: HindsightBuffer, rounds: int, length: int, *, late: bool = False) -> None:
    """Store episodes of `length` steps along x: row r, episode e is at 1000 r + 100 e + 0.1 t; its goal is far."""
    rows = np.arange(kept.n_envs)
    for step in range(kept.rounds, kept.rounds + rounds):
        x = 1000.0 * rows + 100.0 * (step // length) + 0.1 * (step % length)
        state = np.stack([x, 0 * x, x, 0 * x, x * 0 - 7, 0 * x], axis=1).astype(np.float32)
        after = state.copy()
        after[:, [0, 2]] += 0.1
        done = np.full(len(rows), step % length == length - 1)
        notes = [{"TimeLimit.truncated": late} for _ in rows]
        kept.add(state, after, np.zeros((len(rows), 2), np.float32), np.zeros(len(rows), np.float32), done, notes)


@pytest.mark.parametrize("rounds", [7, 20, 33, 57])
def test_goals_come_from_the_same_episode(rounds: int) -> None:
    """Also where the buffer has gone round, and in episodes that are not over."""
    kept = buffer(20, 3, 1.0)
    fill(kept, rounds, length=9)
    drawn = kept.draw(2000, 1.0)
    away = drawn.states[:, 4] - drawn.states[:, 2]
    assert kept.pos == rounds % 20
    assert (away > 0.09).all()
    assert (away < 0.91).all()
    assert drawn.solved.any()
    assert (drawn.solved == (np.abs(drawn.following[:, 2] - drawn.states[:, 4]) < 0.05)).all()
    oldest = max(0, rounds - 20)
    stored = {1000 * r + 100 * (s // 9) + 0.1 * (s % 9) for s in range(oldest, rounds) for r in range(3)}
    assert {round(x, 1) for x in drawn.states[:, 2].tolist()} == {round(x, 1) for x in stored}


def test_goals_are_replaced_where_something_moves() -> None:
    """One row of ten moves: what is drawn with its goals is mostly that all the same, and attained before nowhere."""
    kept = buffer(20, 10, 0.5)
    fill(kept, 20, length=9)
    kept.observations[:, 1:, [0, 2]] = kept.next_observations[:, 1:, [0, 2]] = 5.0
    drawn = kept.draw(400, 0.5)
    replaced = drawn.states[:, 4] != -7
    assert 100 < replaced.sum() <= 200
    assert (drawn.states[replaced, 2] != 5.0).all()
    assert not TASK.solved(drawn.states[replaced]).any()
    assert (drawn.states[~replaced, 2] == 5.0).mean() > 0.8


@pytest.mark.parametrize(("late", "ended"), [(True, False), (False, True)])
def test_time_that_is_up_does_not_cut_bootstrapping(late: bool, ended: bool) -> None:
    kept = buffer(20, 2, 0.0)
    fill(kept, 20, length=4, late=late)
    drawn = kept.draw(400, 0.0)
    assert drawn.ended.any() == ended
    assert (drawn.states[:, 4] == -7).all()


def test_samples_are_what_the_library_expects() -> None:
    kept = buffer(20, 2, 0.8)
    fill(kept, 20, length=4)
    found = kept.sample(64)
    shapes = [tuple(part.shape) for part in found[:5]]
    assert shapes == [(64, 6), (64, 2), (64, 6), (64, 1), (64, 1)]
    assert ((found.rewards == 1) <= (found.dones == 1)).all()
    assert 0 < float(found.rewards.mean()) < 1
