"""Row 21: episodes whose physics diverges fail and are counted; the others and the run go on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.rewrite import controllers
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.fetch_world import FetchWorld
from roboscribe.envs.point_world import PointTask, PointWorld, lookahead_skills
from roboscribe.evaluation import measure
from roboscribe.runnable import Runnable
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from tests.conftest import Figure, effort

EVERY = 5
"""One seed in so many breaks, after `LATE` steps."""
LATE = 4
PROGRAM = """def P(μ : EE):
  b := get(λb:block. true)
  π_hold(μ, b) until hold(μ, b)
  π_at(μ, b, g(b)) until at(b)
where
  hold(μ, b) ≡ ‖μ↓xz − b↓xz‖ < 0.0124
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.0301
"""


class BreakingWorld(PointWorld):
    """Rows that started from every fifth seed leave physics after a few steps."""

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        """Note which rows will break."""
        self.__dict__.setdefault("age", np.zeros(self.batch, dtype=np.int64))[rows] = 0
        self.__dict__.setdefault("frail", np.zeros(self.batch, dtype=np.bool_))[rows] = seeds % EVERY == 0
        return super().reset(rows, seeds)

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        """Move the sound rows."""
        self.__dict__["age"][rows] += 1
        return super().step(rows, actions)

    def diverged(self, rows: IntArray) -> BoolArray:
        """Tell which rows broke."""
        broken: BoolArray = self.__dict__["frail"][rows] & (self.__dict__["age"][rows] >= LATE)
        return broken


@dataclass(frozen=True)
class Breaking(PointTask):
    """The point task in such a world."""

    def world(self, batch: int) -> BreakingWorld:
        """Build a world that breaks."""
        return BreakingWorld(self, batch)


def test_row_21_diverged_episodes_fail_and_are_counted(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> None:
    task, episodes = Breaking("point-pick-place-1", ("block",)), effort(60, 1000)
    seeds = np.arange(episodes)
    monkeypatch.setattr("roboscribe.evaluation.episode_seeds", lambda *_: seeds)
    program = parse_program(PROGRAM)
    library = lookahead_skills(task, program, lambda name: {})
    assert {run.controller for run in controllers(program)} == set(library)
    found = measure(Runnable(program, library, {}), task, 0, episodes)
    broken = [row[3] == 1 for row in found.table["data"]]  # type: ignore[index,union-attr]
    assert broken == (seeds % EVERY == 0).tolist()
    assert found.figures["diverged"] == sum(broken)
    assert found.figures["successes"] == episodes - sum(broken), "the others are not disturbed"
    figure("diverged episodes counted", sum(broken), len(seeds[seeds % EVERY == 0]))


def test_row_21_numbers_that_explode_fail_their_row_alone(figure: Figure) -> None:
    """Velocities beyond all measure, objects off the table: the engine goes on with the other rows."""
    world = make_task("pick-place-1").world(4)
    assert isinstance(world, FetchWorld)
    everyone, rng = np.arange(4), np.random.default_rng(0)
    held = tried = 0
    for size in np.geomspace(1e3, 1e300, effort(4, 40)):
        world.reset(everyone, everyone)
        snapshots = world.save(np.array([2]))
        spoilt = snapshots.copy()
        spoilt[0, 1 + rng.integers(40)] = size
        world.load(np.array([2]), spoilt)
        for _ in range(3):
            states = world.step(everyone, np.zeros((4, 4)))
        lost = world.diverged(everyone)
        held += bool(np.isfinite(states).all() and not lost[[0, 1, 3]].any())
        tried += 1
    figure("exploding rows that disturb no other", held, tried)
