"""PPO: solves a one-step problem, never returns less than it was given, and resumes bit for bit."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from roboscribe.dsl.rewrite import controllers
from roboscribe.errors import ArtifactError
from roboscribe.rl.checkpoint import read_checkpoint, write_checkpoint
from roboscribe.rl.clone import initial_skill
from roboscribe.rl.config import PpoConfig
from roboscribe.rl.learner import LearnerTask
from roboscribe.rl.observation import observation_spec
from roboscribe.rl.ppo import train_ppo
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import SkillEvaluator, Verdict
from roboscribe.rl.starts import Prefix, collect_starts
from roboscribe.rl.subtask import Subtask
from tests.rl.carry_world import HOLD, PROGRAM, Carry

TASK = Carry()
SMALL = PpoConfig(worlds=8, steps=10, epochs=2, minibatches=2, critic_iterations=1, evaluate_every=1)


def problem(limit: int = 15, target: float = 2.0, budget: int = 320) -> tuple[LearnerTask, Skill]:
    subtask = Subtask(TASK, HOLD, ("b",), limit, confirm=1)
    pool, _ = collect_starts(Prefix(PROGRAM, (0,), {}, {}), TASK, 24, np.arange(24), np.random.default_rng(0))
    held_out, training = pool.take(np.arange(8)), pool.take(np.arange(8, len(pool)))
    world = TASK.world(8)
    task = LearnerTask(subtask, training, SkillEvaluator(subtask, held_out, world), target, budget)
    spec = observation_spec(controllers(PROGRAM)[0], {"b": "block"}, TASK.layout)
    fitted = spec.fitted(TASK.layout, pool.states, pool.entities)
    return task, initial_skill(Skill("hold", fitted, (), TASK.layout), 2, (32, 32), 0)


def weights(skill: Skill) -> NDArray[np.floating[Any]]:
    return np.concatenate([array.ravel() for layer in skill.layers for array in layer])


def test_learns_to_reach() -> None:
    task, skill = problem(limit=20, target=0.9, budget=20_000)
    config = PpoConfig(worlds=32, steps=20, critic_iterations=2, noise=0.5, actor_rate=5e-4)
    learned = train_ppo(skill, task.evaluate(skill, 0.0).rate, task, config, seed=0)
    assert learned.success >= 0.9
    assert learned.success == task.evaluate(learned.skill, 0.0).rate


def test_what_evaluates_worse_is_thrown_away() -> None:
    task, skill = problem()
    untouched = replace(task, evaluate=lambda candidate, to_beat: Verdict(0.4, 0))
    learned = train_ppo(skill, 0.5, untouched, SMALL, seed=0)
    np.testing.assert_array_equal(weights(learned.skill), weights(skill))
    assert learned.success == 0.5


def test_only_the_critic_learns_at_first() -> None:
    task, skill = problem(budget=80)
    moved: list[bool] = []

    def look(candidate: Skill, to_beat: float) -> Verdict:
        moved.append(not (weights(candidate) == weights(skill)).all())
        return Verdict(0.0, 0)

    train_ppo(skill, 0.0, replace(task, evaluate=look, budget=80 * 4), replace(SMALL, critic_iterations=2), seed=0)
    assert moved == [True, True], "the first two iterations are not even evaluated"
    train_ppo(skill, 0.0, replace(task, evaluate=look, budget=80 * 2), replace(SMALL, critic_iterations=2), seed=0)
    assert len(moved) == 2


def test_stays_within_its_budget_and_stops_at_the_target() -> None:
    task, skill = problem(budget=250)
    free = replace(task, evaluate=lambda candidate, to_beat: Verdict(0.0, 0))
    assert train_ppo(skill, 0.0, free, SMALL, seed=0).control_steps == 240
    assert train_ppo(skill, 0.7, replace(task, target=0.7), SMALL, seed=0).control_steps == 0


def test_gives_up_when_patience_is_spent() -> None:
    task, skill = problem(budget=8000)
    stuck = replace(task, evaluate=lambda candidate, to_beat: Verdict(0.0, 0))
    assert train_ppo(skill, 0.5, stuck, replace(SMALL, patience=3), seed=0).control_steps == 80 * 4


@pytest.mark.parametrize(
    ("rates", "unfinished"),
    [
        ([0.3, 0.4, 0.5, 0.6, 0.7], True),
        ([0.3, 0.4, 0.5, 0.6, 0.5], True),
        ([0.3, 0.6, 0.5, 0.5, 0.5], False),
        ([0.1, 0.1, 0.1, 0.1, 0.1], False),
        ([0.3, 0.4, 0.5, 0.99, 0.99], False),
    ],
)
def test_it_says_whether_steps_ran_out_while_it_was_getting_better(rates: list[float], unfinished: bool) -> None:
    task, skill = problem(budget=80 * 6)
    found = iter([*rates, *[rates[-1]] * 20])
    looked = replace(task, target=0.9, evaluate=lambda candidate, to_beat: Verdict(next(found), 0))
    settings = replace(SMALL, critic_iterations=1, evaluate_every=1, patience=9)
    assert train_ppo(skill, 0.2, looked, settings, seed=0).unfinished == unfinished


def test_same_seed_same_weights_another_seed_others() -> None:
    task, skill = problem()
    learned = [weights(train_ppo(skill, -1.0, task, SMALL, seed).skill) for seed in (3, 3, 4)]
    np.testing.assert_array_equal(learned[0], learned[1])
    assert not (learned[0] == learned[2]).all()


class KilledError(Exception):
    """Stands for kill -9."""


def test_stopped_and_resumed_it_ends_with_the_same_weights(tmp_path: Path) -> None:
    task, skill = problem(budget=80 * 6)
    best = iter(np.linspace(0.1, 0.9, 30).tolist())
    rising = replace(task, evaluate=lambda candidate, to_beat: Verdict(next(best), 7))
    straight = train_ppo(skill, 0.0, rising, SMALL, seed=5)

    def kill(metrics: object, step: int) -> None:
        if step == (80 + 7) * 4 - 7:
            raise KilledError

    path = tmp_path / "hold.ppo.safetensors"
    best = iter(np.linspace(0.1, 0.9, 30).tolist())
    with pytest.raises(KilledError):
        train_ppo(skill, 0.0, rising, SMALL, 5, kill, path)
    kept, _ = read_checkpoint(path, {})
    resumed = train_ppo(skill, 0.0, rising, SMALL, 5, checkpoint=path)
    np.testing.assert_array_equal(weights(resumed.skill), weights(straight.skill))
    assert not (kept["actor/0.weight"] == straight.skill.layers[0][0]).all(), "it did go on learning"
    assert resumed.control_steps == straight.control_steps


def test_a_checkpoint_of_another_run_is_refused(tmp_path: Path) -> None:
    task, skill = problem()
    path = tmp_path / "hold.ppo.safetensors"
    train_ppo(skill, 0.0, task, SMALL, 0, checkpoint=path)
    with pytest.raises(ArtifactError, match="another run"):
        train_ppo(skill, 0.0, task, SMALL, 1, checkpoint=path)


@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: b"\x80\x04K\x01."]
)
def test_a_damaged_or_pickled_checkpoint_is_refused(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    path = tmp_path / "hold.ppo.safetensors"
    write_checkpoint(path, {"a": np.arange(9.0)}, {"seed": 1})
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ArtifactError, match=str(path.name)):
        read_checkpoint(path, {})


def test_writing_a_checkpoint_leaves_nothing_else_behind(tmp_path: Path) -> None:
    path = tmp_path / "deeper" / "hold.ppo.safetensors"
    write_checkpoint(path, {"a": np.arange(9.0)}, {"seed": 1})
    write_checkpoint(path, {"a": np.arange(3.0)}, {"seed": 1})
    arrays, notes = read_checkpoint(path, {"seed": 1})
    np.testing.assert_array_equal(arrays["a"], [0, 1, 2])
    assert notes == {"seed": 1}
    assert list(path.parent.iterdir()) == [path]


def test_metrics_arrive_with_the_steps_spent() -> None:
    task, skill = problem()
    seen: list[tuple[int, set[str]]] = []
    task = replace(task, evaluate=lambda candidate, to_beat: Verdict(0.0, 7))
    train_ppo(skill, 0.0, task, SMALL, 0, lambda metrics, step: seen.append((step, set(metrics))))
    assert [step for step, _ in seen] == [80 * rank + 7 * (rank - 1) for rank in (1, 2, 3, 4)]
    assert {"value_loss", "surrogate_loss", "collect_time", "learn_time"} <= seen[0][1]
    assert "best_success" in seen[-1][1]
