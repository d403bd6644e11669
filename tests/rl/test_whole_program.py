"""What the whole program says of a controller that was improved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from roboscribe.rl.program_training import ProgramTraining
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_job import SkillJob, SkillReport
from roboscribe.rl.train_program import train_program
from roboscribe.rl.whole_program import WholeProgram
from roboscribe.world.layout import BoolArray, IntArray
from tests.rl.carry_world import PROGRAM, Carry
from tests.rl.test_train_program import QUICK, SHOWN, TASK

OLD: Any = SimpleNamespace(name="old")
NEW: Any = SimpleNamespace(name="new")
CONFIG = replace(QUICK, assurance=40)


def outcome(successes: int, first: int = 0) -> BoolArray:
    """Say in which of forty episodes a program succeeds: so many, from one on."""
    return (np.arange(40) >= first) & (np.arange(40) < first + successes)


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch) -> tuple[WholeProgram, dict[str, BoolArray]]:
    """Return a comparison, and what programs with an old and a new `hold` reach, which tests fill in."""
    reached: dict[str, BoolArray] = {}

    def tried(_: ProgramTraining, skills: Mapping[str, Any], seeds: IntArray) -> tuple[BoolArray, int]:
        assert len(seeds) == CONFIG.assurance
        return reached[skills["hold"].name], 1000

    monkeypatch.setattr("roboscribe.rl.whole_program.tried", tried)
    return WholeProgram(ProgramTraining(TASK, PROGRAM, SHOWN, CONFIG, 0, True, 0)), reached


def suffers(whole: WholeProgram) -> bool:
    known = {"hold": OLD, "at": OLD}
    return whole.suffers(known, {**known, "hold": NEW})


@pytest.mark.parametrize(
    ("after", "worse"),
    [
        (outcome(20), True),
        (outcome(30), False),
        (outcome(36), False),
        (outcome(35, first=1), False),  # one lost: that may be chance
        (outcome(30, first=10), False),  # as many won as lost
    ],
)
def test_a_program_suffers_where_it_loses_more_than_chance(
    whole: tuple[WholeProgram, dict[str, BoolArray]], after: BoolArray, worse: bool
) -> None:
    comparison, reached = whole
    reached.update(old=outcome(30), new=after)
    assert suffers(comparison) == worse
    assert comparison.take_steps() == 2000
    assert comparison.take_steps() == 0


def test_what_was_kept_is_what_the_next_one_is_compared_with(whole: tuple[WholeProgram, dict[str, BoolArray]]) -> None:
    comparison, reached = whole
    reached.update(old=outcome(30), new=outcome(40))
    assert not suffers(comparison)
    reached.update(new=outcome(30))
    assert suffers(comparison)
    assert comparison.take_steps() == 3000, "the program before is not run again"


def test_programs_that_lack_a_controller_or_steps_say_nothing(
    whole: tuple[WholeProgram, dict[str, BoolArray]],
) -> None:
    comparison, _ = whole
    lacking = {"hold": OLD}
    assert not comparison.suffers(lacking, {"hold": NEW})
    assert comparison.most(lacking) == 0
    poor = WholeProgram(ProgramTraining(TASK, PROGRAM, SHOWN, replace(CONFIG, budget=1000), 0, True, 0))
    known = {"hold": OLD, "at": OLD}
    assert (poor.most(known), comparison.most(known)) == (0, 2 * 40 * Carry().horizon)
    assert not suffers(poor)


def test_what_is_little_worse_each_time_is_measured_by_the_best(
    whole: tuple[WholeProgram, dict[str, BoolArray]],
) -> None:
    comparison, reached = whole
    reached.update(old=outcome(40))
    suffered = []
    for successes in range(39, 35, -1):
        reached.update(new=outcome(successes))
        suffered.append(suffers(comparison))
    assert suffered == [False, True, True, True], "two lost of none won are more than a standard deviation"


def test_what_makes_the_program_worse_is_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is better gets another round, from where the others now leave the robot; what was undone gets none."""
    before = train_program(TASK, PROGRAM, SHOWN, {}, QUICK, 0).library
    other = {name: skill.with_layers(skill.layers) for name, skill in before.items()}

    def learn(_: object, __: object, job: SkillJob, ___: object, ____: int) -> tuple[Skill, SkillReport]:
        name = job.run.controller
        return other[name], SkillReport(name, "ppo", 9, 0.8, 0.9, 100, unfinished=True, known_success=0.7)

    monkeypatch.setattr("roboscribe.rl.train_program._learn", learn)
    for worse, kept, learner, success, rounds in ((True, before, "undone", 0.7, 1), (False, other, "ppo", 0.9, 2)):
        monkeypatch.setattr(WholeProgram, "suffers", lambda *_, worse=worse: worse)
        result = train_program(TASK, PROGRAM, SHOWN, before, replace(QUICK, target=2.0), 0)
        assert all(result.library[name] is kept[name] for name in before)
        found = [(r.controller, r.learner, r.success, r.unfinished) for r in result.reports]
        assert found == [(name, learner, success, not worse) for name in ("hold", "at")] * rounds
