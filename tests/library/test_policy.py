"""A program drives one robot as the batched interpreter drives many, and says where it stands."""

from __future__ import annotations

import shutil
from pathlib import Path
from time import process_time

import numpy as np
import pytest

import roboscribe
from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.rewrite import controllers
from roboscribe.errors import ArtifactError, ProgramError, TaskError
from roboscribe.programs import TRAINED
from roboscribe.world.states import column_places

MOST_SECONDS = 1e-3
"""What one step of one robot may take."""


@pytest.mark.parametrize("name", ["pick-place-1", "pick-place-4"])
def test_it_acts_as_the_batched_interpreter_bit_for_bit(name: str) -> None:
    policy = roboscribe.load(name)
    program, seeds = policy.runnable, np.array([3, 4])
    ran = execute(program.program, program.library, policy.task, seeds, limits=program.limits, keep_actions=True)
    for trajectory, lines in zip(ran.trajectories, ran.lines, strict=True):
        policy.reset()
        assert trajectory.actions is not None
        for state, action, line in zip(trajectory.states, trajectory.actions, lines, strict=False):
            np.testing.assert_array_equal(policy.act(state), action)
            assert policy.counter == line


def test_one_step_takes_less_than_a_millisecond() -> None:
    policy = roboscribe.load("tower-5")
    state = policy.task.world(1).reset(np.array([0]), np.array([0]))[0]
    seconds = []
    for _ in range(100):
        start = process_time()
        policy.act(state)
        seconds.append(process_time() - start)
    assert np.median(seconds) <= MOST_SECONDS


def test_where_it_stands_can_be_read() -> None:
    policy = roboscribe.load("pick-place-1")
    assert (policy.counter, policy.line, policy.bound, policy.ended) == (-1, "", {}, False)
    world = policy.task.world(1)
    state, row = world.reset(np.array([0]), np.array([1])), np.array([0])
    policy.act(state[0])
    assert (policy.counter, policy.bound) == (0, {"b": "b1"})
    assert policy.line.startswith("π_hold(μ, b) until")
    for _ in range(policy.task.horizon):
        state = world.step(row, policy.act(state[0])[None])
    assert policy.counter == 1
    assert policy.ended
    assert policy.task.solved(state[0])
    policy.reset()
    assert (policy.counter, policy.bound) == (-1, {})


def test_a_state_may_come_by_the_names_of_its_columns() -> None:
    policy = roboscribe.load("pick-place-1")
    state = policy.task.world(1).reset(np.array([0]), np.array([1]))[0]
    named = {name: state[place] for name, place in column_places(policy.task.layout).items()}
    action = policy.act(state)
    policy.reset()
    np.testing.assert_array_equal(policy.act(named), action)
    named["b2.position"] = named.pop("b1.position")
    with pytest.raises(TaskError, match=r"missing column b1\.position, unknown column b2\.position"):
        policy.act(named)


@pytest.mark.parametrize("bad", [[1.0], "up", [[0.0] * 19]])
def test_what_is_no_observation_is_refused(bad: object) -> None:
    with pytest.raises(TaskError, match="observation of pick-place-1"):
        roboscribe.load("pick-place-1").act(bad)


def test_an_edited_program_runs_with_the_same_controllers() -> None:
    policy = roboscribe.load("pick-place-1")
    edited = policy.edited(str(policy).replace("0.0501", "0.03"))
    assert "< 0.03" in str(edited)
    assert edited.runnable.library is policy.runnable.library
    assert [run.controller for run in controllers(edited.program)] == ["hold", "at"]
    with pytest.raises(ProgramError, match=r"runs π_seize; controllers given: at, hold"):
        policy.edited(str(policy).replace("π_hold", "π_seize"))


def test_a_directory_is_loaded_as_a_name_is(tmp_path: Path) -> None:
    shutil.copytree(TRAINED / "pick-place-1", tmp_path / "mine")
    assert str(roboscribe.load(tmp_path / "mine")) == str(roboscribe.load("pick-place-1"))


def test_what_is_no_program_is_told_the_shipped_names() -> None:
    with pytest.raises(
        ArtifactError, match=r"expected a program's directory, an MLflow run id or a shipped program .pick-place-1"
    ):
        roboscribe.load("fetch")


def test_an_evaluation_is_the_one_of_the_command() -> None:
    found = roboscribe.evaluate("pick-place-1", episodes=5, seed=3)
    assert (found.episodes, found.success, found.figures["successes"]) == (5, 1.0, 5)
    assert found.interval[0] == pytest.approx(0.565518)
    assert "pick-place-1: success 100.0 % (56.6 to 100.0) of 5 episodes" in str(found)
    assert str(found) in found._repr_html_()


def test_another_task_is_measured_where_asked() -> None:
    assert roboscribe.evaluate("tower-4", "tower-3", episodes=1).task == "tower-3"
