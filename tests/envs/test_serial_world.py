"""Simulators of one robot, run in rows."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs.serial_world import SerialWorld
from roboscribe.world.layout import FloatArray

ROWS = np.array([0, 1])


class Counter:
    """Counts by its action; beyond 10 it breaks."""

    def __init__(self) -> None:
        self.state = np.zeros(1)

    def reset(self, seed: int) -> FloatArray:
        self.state = np.array([float(seed)])
        return self.state

    def step(self, action: FloatArray) -> FloatArray:
        self.state = self.state + action
        return np.where(self.state > 10, np.nan, self.state)

    def save(self) -> FloatArray:
        return self.state

    def load(self, snapshot: FloatArray) -> FloatArray:
        self.state = snapshot.copy()
        return self.state


def test_rows_are_on_their_own() -> None:
    world = SerialWorld(Counter, 2)
    np.testing.assert_array_equal(world.reset(ROWS, np.array([3, 5])), [[3.0], [5.0]])
    np.testing.assert_array_equal(world.step(ROWS[1:], np.array([[4.0]])), [[6.0]])
    np.testing.assert_array_equal(world.observe(ROWS), [[3.0], [6.0]])
    assert world.control_steps == 1


def test_a_broken_row_keeps_its_last_state_until_it_is_reset() -> None:
    world = SerialWorld(Counter, 2)
    world.reset(ROWS, np.array([9, 1]))
    for _ in range(3):
        world.step(ROWS, np.ones((2, 1)))
    np.testing.assert_array_equal(world.observe(ROWS), [[10.0], [4.0]])
    assert world.diverged(ROWS).tolist() == [True, False]
    assert world.save(ROWS).tolist() == [[10.0], [4.0]]
    world.load(ROWS[:1], np.array([[2.0]]))
    assert world.diverged(ROWS).tolist() == [False, False]
    assert world.step(ROWS, np.ones((2, 1))).tolist() == [[3.0], [5.0]]


def test_a_snapshot_goes_on_in_another_row() -> None:
    world = SerialWorld(Counter, 2)
    world.reset(ROWS[:1], np.array([7]))
    assert world.load(ROWS[1:], world.save(ROWS[:1])).tolist() == [[7.0]]


def test_what_cannot_be_is_refused() -> None:
    world = SerialWorld(Counter, 2)
    with pytest.raises(ValueError, match="row 1 was never reset or loaded"):
        world.step(ROWS[1:], np.zeros((1, 1)))
    world.reset(ROWS, ROWS)
    with pytest.raises(ValueError, match="not finite"):
        world.step(ROWS, np.array([[0.0], [np.nan]]))
