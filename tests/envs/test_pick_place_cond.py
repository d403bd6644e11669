"""Shapes that are stacked in the order of their goals' heights."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs import demonstrator, fetch
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.demonstrator import ScriptedTask
from roboscribe.envs.tasks.pick_place_cond import CUBE, PEG, as_blocks


def test_goals_are_a_stack_in_both_orders() -> None:
    task = make_task("pick-place-cond")
    goals = fetch.view(task.world(32).reset(np.arange(32), np.arange(32))).goals
    cube_first = goals[:, 0, 2] < goals[:, 1, 2]
    assert 0.2 < cube_first.mean() < 0.8
    assert (goals[:, 0, :2] == goals[:, 1, :2]).all()
    assert np.abs(goals[:, 0, 2] - goals[:, 1, 2]) == pytest.approx(CUBE.half[2] + PEG.half[2])


@pytest.mark.parametrize("name", ["pick-place-cond", "pick-place-cond-3"])
def test_the_script_stacks_them(name: str) -> None:
    task = make_task(name)
    assert isinstance(task, ScriptedTask)
    wave = [demonstrator.start(3, index, look=task.script.look) for index in range(24)]
    demonstrator.run(task, task.world(24), wave)
    assert np.mean([episode.succeeded for episode in wave]) >= 0.95


def test_types_are_told_apart() -> None:
    assert make_task("pick-place-cond").layout.names == ("c1", "p1")
    assert make_task("pick-place-cond-3").layout.names == ("c1", "p1", "d1")


def test_a_peg_is_seen_by_its_upper_end() -> None:
    task = make_task("pick-place-cond")
    state = task.world(1).reset(np.array([0]), np.array([0]))
    changed = fetch.view(as_blocks((CUBE, PEG), state))
    assert changed.blocks[0, 1, 2] - fetch.view(state).blocks[0, 1, 2] == pytest.approx(0.02)
    assert (changed.blocks[0, 0] == fetch.view(state).blocks[0, 0]).all()
