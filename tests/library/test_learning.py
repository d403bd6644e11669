"""The library finds what the command finds, without files."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import roboscribe
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.errors import DemonstrationError, RoboScribeError, TaskError
from roboscribe.evaluation import Evaluation
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import load_program, save_program
from roboscribe.learning import Learning, TrainedControllers
from roboscribe.programs import program_directory
from roboscribe.runnable import Runnable
from roboscribe.steps import Steps
from roboscribe.success_rate import wilson
from roboscribe.world.task import Task
from tests.pipelines.runs import TASK, run, scripted

SHOWN = roboscribe.Demonstrations.collected(POINT_TASKS[TASK.name], 12, 0)


def test_the_library_finds_the_program_that_the_command_finds(tmp_path: Path) -> None:
    lines: list[str] = []
    found = roboscribe.synthesize(
        TASK.name, SHOWN, profile="scripted", rollout_episodes=20, evaluation_episodes=40, tell=lines.append
    )
    assert isinstance(found, roboscribe.Synthesis)
    found.save(tmp_path / "mine")
    run(scripted(), tmp_path)
    mine, theirs = load_program(tmp_path / "mine"), load_program(tmp_path / "program")
    assert mine.program_text == theirs.program_text
    assert (mine.tree, mine.controllers) == (theirs.tree, theirs.controllers)
    assert {name: theirs.manifest[name] for name in mine.manifest if name != "demonstrations"} == {
        name: value for name, value in mine.manifest.items() if name != "demonstrations"
    }
    assert any(line.startswith("at ≡") for line in lines)
    assert str(found.evaluation) == lines[-1]


def test_a_result_is_loaded_again_and_shown(tmp_path: Path) -> None:
    found = roboscribe.synthesize(
        POINT_TASKS[TASK.name], SHOWN, profile="scripted", rollout_episodes=20, evaluation_episodes=4
    )
    assert isinstance(found, roboscribe.Synthesis)
    assert str(roboscribe.load(found.save(tmp_path / "p"))) == str(found.policy)
    page = found._repr_html_()
    assert all(f"{rank}. {each.node.name}" in page for rank, each in enumerate(found.refinements, start=1))


def test_demonstrations_that_show_nothing_give_a_reason() -> None:
    still = [np.repeat(each.states[:1], 5, axis=0) for each in SHOWN.trajectories]
    found = roboscribe.synthesize(TASK.name, roboscribe.Demonstrations.from_arrays(POINT_TASKS[TASK.name], still))
    assert isinstance(found, roboscribe.Fail)
    assert "ever reaches the goal" in found.reason


def test_actions_cannot_be_learned_from_states() -> None:
    states = roboscribe.Demonstrations.from_arrays(POINT_TASKS[TASK.name], [t.states for t in SHOWN.trajectories])
    with pytest.raises(DemonstrationError, match="found no actions, expected them for profile actions"):
        roboscribe.synthesize(TASK.name, states, profile="actions")


def test_a_task_without_controllers_of_its_own_says_so() -> None:
    class Bare(type(POINT_TASKS[TASK.name])):  # type: ignore[misc]  # the toy without what it brings
        controller = None

    bare = Bare("bare", ("block",))
    with pytest.raises(TaskError, match="bare brings no controllers"):
        roboscribe.synthesize(bare, SHOWN.trajectories, profile="scripted", rollout_episodes=5)


def test_controllers_are_learned_in_the_lighter_simulator_as_the_command_does(monkeypatch: pytest.MonkeyPatch) -> None:
    practised = []

    def started(learning: Learning, name: str) -> Steps[TrainedControllers]:
        practised.append(learning.task)
        raise RoboScribeError(name)

    monkeypatch.setattr(Learning, "steps", started)
    task = make_task("pick-place-1")
    with pytest.raises(RoboScribeError):
        roboscribe.synthesize(task, task.demonstrate(4, 0))
    assert practised[0] != task
    assert practised[0] == task.light


def test_a_program_is_measured_in_the_simulator_for_which_it_was_made(tmp_path: Path) -> None:
    with program_directory("pick-place-1") as shipped:
        shutil.copytree(shipped, tmp_path / "p")
    saved = load_program(tmp_path / "p")
    save_program(tmp_path / "p", replace(saved, manifest={**saved.manifest, "timing": "faithful"}))
    task = make_task("pick-place-1", timing="faithful")
    assert roboscribe.load(tmp_path / "p").task == task.lasting(saved.horizon or task.horizon)


class _Twofold(type(POINT_TASKS[TASK.name])):  # type: ignore[misc]  # the toy, with a lighter simulator
    @property
    def light(self) -> Task:
        return POINT_TASKS[TASK.name]


def test_what_succeeds_in_the_lighter_simulator_alone_is_learned_in_the_tasks_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first evaluation is made to fail in half of its episodes, as if the simulators differed."""
    practised: list[Task] = []
    steps, rates = Learning.steps, iter((0.5, 1.0))

    def started(learning: Learning, name: str) -> Steps[TrainedControllers]:
        practised.append(learning.task)
        return steps(learning, name)

    def measured(program: Runnable, task: Task, seed: int, episodes: int) -> Evaluation:
        won = round(next(rates) * episodes)
        low, high = wilson(won, episodes)
        figures: dict[str, Json] = {"successes": won, "episodes": episodes, "success": won / episodes}
        return Evaluation(task.name, seed, {**figures, "ci_low": low, "ci_high": high}, {})

    monkeypatch.setattr(Learning, "steps", started)
    monkeypatch.setattr("roboscribe.learning.measure", measured)
    task, lines = _Twofold(TASK.name, ("block",)), list[str]()
    found = roboscribe.synthesize(task, SHOWN.trajectories, profile="scripted", rollout_episodes=20, tell=lines.append)
    assert isinstance(found, roboscribe.Synthesis)
    assert practised == [task.light, task]
    assert found.evaluation.success == 1.0
    assert any("lighter simulator" in line for line in lines)
