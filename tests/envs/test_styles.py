"""Styles of demonstrations: each does what its name says and still solves the task; the default one is as ever."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from roboscribe.envs import demonstrator, multi_block_demonstrator, single_block_demonstrator
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.demonstrator import DemonstrationAttempt, ScriptedTask, demonstrate
from roboscribe.envs.performer import PAUSE
from roboscribe.envs.single_block_demonstrator import NEAR
from roboscribe.envs.styles import DEFAULT, MIXED, STYLES, choices, style_names
from roboscribe.errors import TaskError
from roboscribe.io.validation import Screened, screen
from roboscribe.stages.collect import Config, collect
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.world.layout import BoolArray, FloatArray
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

ATTEMPTS = 30
HAND, BLOCK, GOAL = slice(0, 3), slice(7, 10), slice(16, 19)


@lru_cache
def task(name: str = "pick-place-1") -> ScriptedTask:
    known = make_task(name)
    assert isinstance(known, ScriptedTask)
    return known


@lru_cache
def attempts(style: str, name: str = "pick-place-1", count: int = ATTEMPTS) -> tuple[DemonstrationAttempt, ...]:
    wave = tuple(demonstrator.start(5, index, choices(style)) for index in range(count))
    demonstrator.run(task(name), task(name).world(count), wave)
    return wave


def shown(style: str) -> list[Trajectory]:
    found = (demonstrator.success(task(), episode) for episode in attempts(style))
    return [trajectory for trajectory in found if trajectory is not None]


def solved(trajectory: Trajectory, where: Task | None = None) -> BoolArray:
    return (where or task()).solved(trajectory.states)


def length(style: str) -> float:
    """Median of the control steps until the task is solved, where it was not at the start."""
    firsts = np.array([solved(trajectory).argmax() for trajectory in shown(style)])
    return float(np.median(firsts[firsts > 0]))


def stretches(flags: BoolArray) -> FloatArray:
    """Lengths of the stretches of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int64), [0]])))
    return edges[1::2] - edges[::2]


def stands(trajectory: Trajectory) -> FloatArray:
    """Lengths of the stretches without any displacement."""
    assert trajectory.actions is not None
    return stretches((trajectory.actions[:, :3] == 0).all(axis=1))


def grasps(trajectory: Trajectory) -> int:
    """How often the fingers begin to close."""
    assert trajectory.actions is not None
    closes = trajectory.actions[:, 3] < 0
    return int(np.count_nonzero(closes[1:] & ~closes[:-1]))


@pytest.mark.parametrize("style", style_names())
def test_one_block_is_placed_in_every_style(style: str) -> None:
    assert np.mean([episode.succeeded for episode in attempts(style)]) >= 0.95


@pytest.mark.parametrize(("name", "style"), [("pick-place-4", "clumsy"), ("tower-2", "topdown"), ("tower-2", MIXED)])
def test_several_blocks_are_placed(name: str, style: str) -> None:
    assert np.mean([episode.succeeded for episode in attempts(style, name, 20)]) >= 0.95


def test_the_default_is_the_script_with_noise() -> None:
    """What was written before there were styles is written still: an independent loop gives the same bits."""
    rng, noise = np.random.default_rng(np.random.SeedSequence((7, 0))), np.zeros(4)
    world, row = task().world(1), np.array([0])
    states = [world.reset(row, rng.integers(2**62, size=1))]
    found = task().demonstrate(1, seed=7)[0]
    assert found.actions is not None
    for action in found.actions:
        noise = 0.7 * noise + np.sqrt(1 - 0.7**2) * (rng.normal(size=4) * multi_block_demonstrator.SPREAD)
        wanted = np.clip(single_block_demonstrator.command(states[-1])[0] + noise, -1.0, 1.0)
        assert (wanted == action).all()
        states.append(world.step(row, wanted[None]))
    assert (np.concatenate(states) == found.states).all()
    assert solved(found)[-10:].all()
    assert (demonstrate(task(), 2, 7)[0].states == found.states).all()


def actions(trajectory: Trajectory) -> FloatArray:
    """Return the actions of a demonstration, which has some."""
    assert trajectory.actions is not None
    return trajectory.actions


def test_brisk_is_faster_and_slow_is_slower() -> None:
    assert length("brisk") < length(DEFAULT) < length("slow") / 2
    speeds = {name: [np.abs(actions(t)[:, :3]).max() for t in shown(name)] for name in ("slow", DEFAULT)}
    assert np.median(speeds["slow"]) < 0.55
    assert np.median(speeds[DEFAULT]) == 1.0


def test_topdown_comes_down_vertically() -> None:
    def slant(style: str) -> float:
        """Greatest distance from the block's axis, 6 to 12 cm above it and before it is touched."""
        seen = np.concatenate([t.states[: max(1, solved(t).argmax())] for t in shown(style)])
        gap = seen[:, HAND] - seen[:, BLOCK]
        above = (gap[:, 2] > 0.06) & (gap[:, 2] < 0.12) & (seen[:, 6] < -0.2)
        return float(np.percentile(np.linalg.norm(gap[above, :2], axis=1), 90))

    assert slant("topdown") < 0.04
    assert slant(DEFAULT) > 0.08


def test_pauses_stand_still_for_a_while() -> None:
    still = np.concatenate([stands(trajectory) for trajectory in shown("pauses")])
    assert still.min() >= PAUSE[0]
    assert np.median(still) < PAUSE[1]
    assert len(still) > ATTEMPTS / 2
    assert not any(len(stands(trajectory)) for trajectory in shown(DEFAULT))


def test_detours_take_other_ways() -> None:
    def way(style: str) -> float:
        return float(sum(np.linalg.norm(np.diff(t.states[:, HAND], axis=0), axis=1).sum() for t in shown(style)))

    assert way("detours") > 1.2 * way(DEFAULT)


def test_the_clumsy_miss_and_drop() -> None:
    def drops(trajectory: Trajectory) -> int:
        """How often a block that was held and lifted comes down without the hand, away from its goal."""
        states = trajectory.states
        near = np.linalg.norm(states[:, HAND] - states[:, BLOCK], axis=1) < NEAR
        lifted = states[:, BLOCK][:, 2] > states[0, BLOCK][2] + 0.02
        loose = ~near & lifted & (np.linalg.norm(states[:, BLOCK] - states[:, GOAL], axis=1) > 0.1)
        return len(stretches(loose))

    assert sum(map(drops, shown("clumsy"))) >= 4 > 1 >= sum(map(drops, shown(DEFAULT)))
    assert sum(map(grasps, shown("clumsy"))) > 1.3 * sum(map(grasps, shown(DEFAULT)))


def test_stop_ends_at_success_and_linger_goes_on() -> None:
    for trajectory in shown("stop"):
        assert solved(trajectory).tolist() == [False] * (len(trajectory) - 1) + [True]
    for trajectory in shown("linger"):
        assert solved(trajectory)[-40:].all()
    assert STYLES["linger"].after / task().frequency > 1.0


def test_mixed_has_several_styles() -> None:
    used = {episode.performer.style for episode in attempts(MIXED)}
    assert used <= set(STYLES.values())
    assert len(used) > len(STYLES) / 2


def test_a_longer_collection_starts_with_the_shorter_one() -> None:
    few, many = demonstrate(task(), 3, 2, MIXED), demonstrate(task(), 6, 2, MIXED)
    assert all((a.states == b.states).all() for a, b in zip(few, many, strict=False))


@pytest.mark.parametrize(("name", "style"), [("pick-place-1", DEFAULT), ("tower-2", MIXED)])
def test_as_many_fail_as_asked(name: str, style: str) -> None:
    found = demonstrate(task(name), 16, 3, style, 0.25)
    fails = [not solved(trajectory, task(name)).any() for trajectory in found]
    assert sum(fails) == 4
    kept = screen(task(name), found)
    assert isinstance(kept, Screened)
    assert len(kept.kept) == 12
    assert len(kept.report) == 4
    assert all("never reaches the goal; left out" in line for line in kept.report)
    again = [solved(t, task(name)).any() for t in demonstrate(task(name), 16, 4, style, 0.25)]
    assert again != [not fail for fail in fails], "another seed, another order"


def test_failures_are_broken_off_or_leave_a_dropped_block() -> None:
    wave = [demonstrator.start(3, index, failing=True) for index in range(30)]
    demonstrator.run(task(), task().world(30), wave)
    left = [episode for episode in wave if episode.performer.left]
    assert 3 < len(left) < 20
    for episode in left:
        hand, block = episode.states[-1][HAND], episode.states[-1][BLOCK]
        assert hand[2] - block[2] > 0.1
    for episode in wave:
        failed = demonstrator.failure(task(), episode)
        assert failed is None or not solved(failed).any()


def test_the_same_seed_gives_the_same_file(tmp_path: Path) -> None:
    def digest(**settings: Any) -> str:  # noqa: ANN401 - any field of the configuration
        return collect(
            Config(TaskConfig("pick-place-1"), 4, **{"style": MIXED, "failing": 0.5, **settings}), tmp_path / "d"
        )

    assert digest() == digest()
    assert len({digest(), digest(seed=1), digest(style="slow"), digest(failing=0.25)}) == 4


def test_a_file_names_its_style(tmp_path: Path) -> None:
    def generator(config: Config) -> str:
        collect(config, tmp_path / "d")
        return str(pq.read_metadata(tmp_path / "d").metadata[b"roboscribe.generator"], "utf-8")

    usual, other = Config(TaskConfig("pick-place-1"), 2), Config(TaskConfig("pick-place-1"), 2, 0, "slow", 0.5)
    assert encode(usual) != encode(other)
    assert generator(usual) == "roboscribe demonstrator of pick-place-1, contact stable, timing fast"
    assert generator(other).endswith(", style slow, 0.5 failing")


@pytest.mark.parametrize(
    ("name", "style", "failing", "said"),
    [
        ("pick-place-1", "quick", 0.0, "unknown style 'quick': expected one of default, brisk"),
        ("pick-place-1", DEFAULT, 0.6, "0.6 failing demonstrations: expected 0 to 0.5"),
        ("point-tower-3", "slow", 0.0, "point-tower-3 has its own demonstrator"),
        ("point-tower-3", DEFAULT, 0.1, "point-tower-3 has its own demonstrator"),
    ],
)
def test_what_cannot_be_done_is_said(name: str, style: str, failing: float, said: str) -> None:
    with pytest.raises(TaskError, match=said):
        demonstrate(make_task(name), 2, 0, style, failing)


def test_other_tasks_know_the_default_style() -> None:
    assert len(demonstrate(make_task("point-pick-place-1"), 2, 0)) == 2
