"""A program that succeeds in the lighter simulator alone is learned in the task's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.io.saved_program import load_program
from roboscribe.pipelines import synthesis_pipeline
from roboscribe.pipelines.synthesis_pipeline import _Learned
from roboscribe.stages.runtime.events import Abandoned, Evaluated, Event
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.steps import Outcome
from tests.pipelines.runs import run, scripted


class _Misled(_Learned):
    outcome = Outcome(20, 40)  # instead of what was measured


def test_it_is_learned_again_and_the_command_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    learn, plans = synthesis_pipeline._learned, list[SynthesisPlan]()

    def learned(plan: SynthesisPlan, *rest: object) -> _Learned | Fail:
        plans.append(plan)
        found = learn(plan, *rest)  # type: ignore[arg-type]
        if isinstance(found, Fail) or not plan.light:
            return found
        return _Misled(found.solution, found.running, found.tree, found.evaluated, found.figures)

    monkeypatch.setattr(synthesis_pipeline, "_learned", learned)
    # One block is shown the same way in any order; yet it is another task.
    monkeypatch.setattr(PointTask, "light", property(lambda task: replace(task, order="height")))
    told: list[Event] = []
    run(scripted(), tmp_path, on_event=told.append)
    assert [plan.light for plan in plans] == [True, False]
    reasons = [event.reason for event in told if isinstance(event, Abandoned)]
    assert reasons == [
        "100% of the episodes succeed in the lighter simulator, and 50% in the task's own: it is learned in that"
    ]
    (evaluated,) = (event for event in told if isinstance(event, Evaluated))
    assert evaluated.figures["successes"] == 40
    assert "--set light=false" in str(load_program(tmp_path / "program").manifest)
