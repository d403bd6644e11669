"""Episodes last as long as demonstrations need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from roboscribe.world.episode_length import episode_length
from roboscribe.world.layout import Attribute, BoolArray, FloatArray, Layout, ObjectType
from roboscribe.world.task import Task, World
from roboscribe.world.trajectory import Trajectory


@dataclass(frozen=True)
class Walk(Task):
    """Solved where the hand has come as far as 1 m."""

    name: str = "walk"
    action_size: int = 1
    horizon: int = 20
    frequency: float = 10.0

    @property
    def layout(self) -> Layout:
        return Layout(ObjectType("EE", (Attribute("position", ("x",), "m"),)), ())

    def solved(self, states: FloatArray) -> BoolArray:
        return np.asarray(states[..., 0] >= 1.0)

    def world(self, batch: int) -> World:
        raise NotImplementedError


def walked(steps: int) -> Trajectory:
    """Show the way in so many steps, and stay there for a while."""
    way = np.concatenate([np.linspace(0.0, 1.0, steps + 1), np.ones(5)])
    return Trajectory(Walk().layout, way[:, None])


@pytest.mark.parametrize("slow", [0, 1, 4])
def test_the_task_decides_where_most_demonstrations_fit(slow: int) -> None:
    shown = [walked(12)] * 5 + [walked(60)] * slow
    assert episode_length(Walk(), shown) == (20, "")


def test_slow_demonstrations_make_episodes_longer_than_nearly_all_of_them() -> None:
    horizon, line = episode_length(Walk(), [walked(40)] * 19 + [walked(80)])
    assert 40 < horizon < 80
    assert str(horizon) in line
    assert "instead of 20" in line


def test_the_same_task_lasts_longer() -> None:
    longer = Walk().lasting(50)
    assert longer.horizon == 50
    assert longer == Walk(horizon=50)
    assert Walk().horizon == 20
