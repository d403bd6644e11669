"""Rows of PlaceCubesDrawer: seeds, snapshots, independence."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs.catalogue import make_task
from roboscribe.envs.drawer.world import DrawerWorld
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, IntArray

ROWS = np.arange(3)
COMMANDS = np.random.default_rng(0).uniform(-1, 1, size=(8, 3, 4))


def world(rows: int = 3) -> DrawerWorld:
    return DrawerWorld(2, False, "fast", rows)


def drive(one: DrawerWorld, rows: IntArray, commands: FloatArray) -> FloatArray:
    return np.array([one.step(rows, command) for command in commands])


def test_a_start_depends_on_its_seed_alone() -> None:
    one = world()
    states = one.reset(ROWS, np.array([11, 12, 11]))
    assert (states[0] == states[2]).all()
    assert (states[0] != states[1]).any()
    one.step(ROWS, COMMANDS[0])
    assert (one.reset(ROWS[1:2], np.array([11])) == states[0]).all()
    assert not make_task("place-cubes-drawer-2").solved(states).any()


def test_a_row_moves_alone_as_in_a_batch() -> None:
    together, alone = world(), world(1)
    together.reset(ROWS, ROWS)
    alone.reset(ROWS[:1], np.array([2]))
    assert (drive(together, ROWS, COMMANDS)[:, 2] == drive(alone, ROWS[:1], COMMANDS[:, 2:])[:, 0]).all()


def test_a_saved_row_goes_on_bit_for_bit_elsewhere() -> None:
    one, other = world(), world()
    one.reset(ROWS, ROWS)
    seen = drive(one, ROWS, COMMANDS[:4])[-1]
    saved = one.save(ROWS)
    rest = drive(one, ROWS, COMMANDS[4:])
    order = np.array([2, 0, 1])
    assert (other.load(order, saved) == seen).all()
    assert (drive(other, order, COMMANDS[4:]) == rest).all()
    assert (other.save(order) == one.save(ROWS)).all()
    assert one.control_steps == 24


def test_other_rows_stand_still() -> None:
    one = world()
    states = one.reset(ROWS, ROWS)
    one.step(ROWS[2:], np.ones((1, 4)))
    assert (one.observe(ROWS[:2]) == states[:2]).all()


def test_what_cannot_be_stepped_or_loaded_is_said() -> None:
    one = world()
    with pytest.raises(ValueError, match="never reset"):
        one.step(ROWS[:1], np.zeros((1, 4)))
    one.reset(ROWS, ROWS)
    with pytest.raises(ValueError, match="not finite"):
        one.step(ROWS[:1], np.array([[0.0, np.nan, 0.0, 0.0]]))
    with pytest.raises(TaskError, match="for 2 cubes"):
        one.load(ROWS[:1], np.zeros((1, 10)))


def test_demonstrations_can_be_replayed() -> None:
    task = make_task("place-cubes-drawer-1")
    shown = task.demonstrate(1, seed=7)[0]
    assert shown.actions is not None
    assert shown.snapshots is not None
    one = task.world(1)
    assert (one.load(ROWS[:1], shown.snapshots[:1])[0] == shown.states[0]).all()
    states = np.array([one.step(ROWS[:1], action[None])[0] for action in shown.actions])
    assert (states == shown.states[1:]).all()
    assert task.solved(shown.states)[-1]
