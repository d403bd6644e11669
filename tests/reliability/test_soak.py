"""Memory of long evaluations: what happened in an episode is forgotten when it is counted."""

from __future__ import annotations

import weakref
from collections.abc import Iterator

import pytest

from roboscribe import evaluation
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.envs.point_world import POINT_TASKS, lookahead_skills
from roboscribe.runnable import Runnable
from tests.reliability.test_physics import PROGRAM

WAVES, EPISODES = 6, 10


def test_an_evaluation_keeps_the_rollouts_of_one_wave_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Formerly it kept them all: 100 kB for an episode of tower-5, 2 GB for 20,000."""
    task, program = POINT_TASKS["point-pick-place-1"], parse_program(PROGRAM)
    runnable = Runnable(program, lookahead_skills(task, program, lambda name: {}), {})
    known: list[weakref.ref[Rollouts]] = []
    original = evaluation.waves

    def waves(*arguments: object, **options: object) -> Iterator[Rollouts]:
        for rollouts in original(*arguments, **options):  # type: ignore[arg-type]  # handed through
            known.append(weakref.ref(rollouts))
            yield rollouts

    alive: list[int] = []
    monkeypatch.setattr(evaluation, "WAVE", EPISODES)
    monkeypatch.setattr(evaluation, "waves", waves)
    found = evaluation.measure(
        runnable, task, 0, WAVES * EPISODES, lambda *_: alive.append(sum(each() is not None for each in known))
    )
    assert found.episodes == WAVES * EPISODES
    assert len(known) == WAVES
    assert max(alive) <= 2
