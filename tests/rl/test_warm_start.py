"""What is cut out of demonstrations to be imitated."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from roboscribe.dsl.rewrite import controllers
from roboscribe.rl import warm_start
from roboscribe.rl.clone import CloningSamples
from roboscribe.rl.config import CloneConfig, TrainConfig
from roboscribe.rl.observation import observation_spec
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import SkillEvaluator, Verdict
from roboscribe.rl.warm_start import busy, clone_frames
from roboscribe.world.trajectory import Trajectory
from tests.rl.carry_world import PROGRAM, layout


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


def test_a_clone_that_falls_short_is_tried_again_more_patiently_with_what_foretells_best_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hold, shown = (
        controllers(PROGRAM)[0],
        CloningSamples(np.zeros((9, 6)), np.zeros((9, 1), np.int64), np.zeros((9, 2))),
    )
    specs = [observation_spec(hold, {"b": "block"}, layout(), goals=goals) for goals in (True, False)]
    most, least = (Skill("hold", spec, (), layout()) for spec in specs)
    tried: list[tuple[Skill, int]] = []

    def clone(skill: Skill, samples: CloningSamples, config: CloneConfig, seed: int) -> Iterator[tuple[int, Skill]]:
        tried.append((skill, config.least_steps))
        yield 1, skill

    class Rates(SkillEvaluator):
        def __init__(self, rates: list[float]) -> None:
            object.__setattr__(self, "rates", iter(rates))

        rest = 1.0

        def __call__(self, skill: object, to_beat: float = 0.0) -> Verdict:
            return Verdict(next(self.rates), 0)  # type: ignore[attr-defined]

    monkeypatch.setattr(warm_start, "clone", clone)
    monkeypatch.setattr(warm_start, "foretelling_error", lambda skill, *_: {most: 2.0, least: 1.0}[skill])
    config = TrainConfig(target=0.9, clone=CloneConfig(least_steps=5, patient_steps=50))
    assert clone_frames([most, least], shown, Rates([0.95]), config, 0) == (most, 0.95)
    assert tried == [(most, 5)]
    assert clone_frames([most, least], shown, Rates([0.5, 0.7, 0.6]), config, 0) == (least, 0.7)
    assert tried[1:] == [(most, 5), (least, 50), (most, 50)]
