"""Cloning of actions and of chunks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from roboscribe.baselines.cloning import Seen, chunks_of, clone_actions, clone_chunks, learning_rate
from roboscribe.baselines.config import ChunkConfig, CloningConfig, SetConfig
from roboscribe.baselines.course import Course
from roboscribe.baselines.policy import Policy, as_program, to_parts
from roboscribe.dsl.interpreter import execute
from roboscribe.errors import ArtifactError, DemonstrationError
from roboscribe.world import Trajectory
from tests.baselines.examples import TINY, only_controller
from tests.baselines.reach import Reach

TASK = Reach()
SHOWN = TASK.demonstrate(40, seed=0)
Clone = Callable[[Course], Policy]


def tiny_actions(course: Course) -> Policy:
    return clone_actions(TASK, SHOWN, TINY.network, TINY.cloning, course)


def tiny_chunks(course: Course) -> Policy:
    return clone_chunks(TASK, SHOWN, TINY.chunks, course)


def success(policy: Policy, task: Reach = TASK, episodes: int = 100) -> float:
    """Measure a policy."""
    program = as_program(policy.method)
    seeds = np.arange(10_000, 10_000 + episodes)
    done = execute(program, {only_controller(program): policy}, task, seeds, limits={}, batch=100)
    return float(done.success.mean())


def weights(policy: Policy) -> Mapping[str, bytes]:
    return {name: array.tobytes() for name, array in to_parts(policy)[1].items()}


def test_bc_learns_to_reach() -> None:
    config = CloningConfig(batch=128)
    policy = clone_actions(TASK, SHOWN, SetConfig(units=64), config, Course(600))
    assert success(policy) >= 0.9


def test_chunks_learn_to_reach() -> None:
    config = ChunkConfig(CloningConfig(batch=64, learning_rate=1e-3), actions=8, units=32, layers=1, heads=2)
    policy = clone_chunks(TASK, SHOWN, config, Course(400))
    assert success(policy) >= 0.9


def test_chunks_by_hand() -> None:
    shown = Trajectory(TASK.layout, np.zeros((4, 6)), np.array([[0.1, 0.0], [0.2, 0.0], [3.0, 0.0]]))
    chunks, known = chunks_of([shown, shown], 2)
    assert chunks[:3, :, 0].tolist() == [[0.1, 0.2], [0.2, 1.0], [1.0, 1.0]]
    assert known.tolist() == [[1, 1], [1, 1], [1, 0]] * 2


@pytest.mark.parametrize("clone", [tiny_actions, tiny_chunks])
def test_a_killed_run_goes_on_to_the_same_weights(clone: Clone, tmp_path: Path) -> None:
    told: list[int] = []

    def killed(metrics: Mapping[str, float], step: int) -> None:
        told.append(step)
        if step == 30 and told.count(30) == 1:
            raise KeyboardInterrupt

    whole = clone(Course(40, seed=3))
    course = Course(40, 3, tmp_path / "c.safetensors", killed)
    with pytest.raises(KeyboardInterrupt):
        clone(course)
    assert weights(clone(course)) == weights(whole)
    assert told == [10, 20, 30, 30, 40]
    assert weights(clone(course)) == weights(whole)
    assert weights(clone(Course(40, seed=4))) != weights(whole)


def test_another_run_s_checkpoint_is_refused(tmp_path: Path) -> None:
    tiny_actions(Course(10, 0, tmp_path / "c.safetensors"))
    with pytest.raises(ArtifactError, match="another run's"):
        tiny_actions(Course(10, 1, tmp_path / "c.safetensors"))


@pytest.mark.parametrize("clone", [clone_actions, clone_chunks])
def test_states_only_cannot_be_cloned(clone: Callable[..., Policy]) -> None:
    without_actions = [SHOWN[0], replace(SHOWN[1], actions=None)]
    settings = (TINY.network, TINY.cloning) if clone is clone_actions else (TINY.chunks,)
    with pytest.raises(DemonstrationError, match="demonstration 1 has none"):
        clone(TASK, without_actions, *settings, Course(1))


def test_the_learning_rate_falls_along_a_cosine() -> None:
    config = CloningConfig(learning_rate=0.2)
    assert [learning_rate(config, step, 4) for step in (1, 3)] == pytest.approx([0.2, 0.1])
    assert 0 < learning_rate(config, 20_000, 20_000) < 1e-6


def test_numbers_are_blurred_and_types_are_not() -> None:
    seen = Seen(torch.zeros(5, 2, 400), numbers=399)
    blurred = seen.blurred(torch.tensor([0, 3, 3]), 0.3, torch.Generator().manual_seed(0))
    assert blurred.shape == (3, 2, 400)
    assert float(blurred[..., :399].std()) == pytest.approx(0.3, rel=0.05)
    assert not blurred[..., 399].any()
    assert not seen.tokens.any()
    assert not seen.blurred(torch.tensor([1]), 0.0, torch.Generator()).any()
