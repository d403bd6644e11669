"""What is cut out of demonstrations to be imitated."""

from __future__ import annotations

import numpy as np

from roboscribe.rl.warm_start import busy
from roboscribe.world.trajectory import Trajectory
from tests.rl.carry_world import layout


def test_steps_in_which_nothing_changes_are_not_imitated() -> None:
    """The hand goes right, waits with a tremor, and drags the block on; the last step moves the block alone."""
    states = np.zeros((8, 6))
    states[:, 0] = [0.0, 0.1, 0.2, 0.2001, 0.2, 0.2, 0.3, 0.3]
    states[:, 2] = [0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.3, 0.4]
    assert busy([Trajectory(layout(), states)])[0].tolist() == [True, True, False, False, False, True, True]


def test_slow_demonstrations_are_busy_all_the_time() -> None:
    states = np.zeros((50, 6))
    states[:, 0] = np.linspace(0.0, 0.05, 50)
    assert all(each.all() for each in busy([Trajectory(layout(), states)] * 2))
