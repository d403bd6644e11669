"""The learners on Pick&Place-1 with its two skills given by hand: the targets that docs/lab-notes.md keeps account of.

python -m tests.rl.test_pick_place PROFILE SEEDS [DEMONSTRATIONS]
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from time import perf_counter

import numpy as np
import pytest

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.parser import parse_program
from roboscribe.envs.catalogue import make_task
from roboscribe.rl.config import Profile, TrainConfig
from roboscribe.rl.program_training import step_limits
from roboscribe.rl.train_program import no_log, train_program

PROGRAM = parse_program(
    """def PickPlace(μ : EE):
      b := get(λb:block. true);
      π_hold(μ, b) until ‖μ↓xyz − b↓xyz‖ < 0.033;
      π_at(μ, b, g(b)) until ‖b↓xyz − g(b)↓xyz‖ < 0.08"""
)
EPISODES = 500


def train_and_evaluate(profile: Profile, seed: int, count: int, log: object = no_log) -> tuple[float, int, float]:
    """Train both skills; returns success on fresh episodes, control steps of training, and seconds of training."""
    task = make_task("pick-place-1")
    shown = task.demonstrate(count, seed)
    assert callable(log)
    start = perf_counter()
    result = train_program(task, PROGRAM, shown, {}, TrainConfig(profile=profile), seed, log)
    seconds = perf_counter() - start
    limits = step_limits(PROGRAM, shown, task)
    rollouts = execute(PROGRAM, result.library, task, np.arange(EPISODES) + 10_000_000, limits=limits)
    return float(rollouts.success.mean()), result.control_steps, seconds


@pytest.mark.slow
@pytest.mark.parametrize(
    ("profile", "count", "seeds", "success", "steps"),
    [
        ("actions", 50, (0, 1, 2), 0.99, 100_000),
        ("actions", 20, (0,), 0.98, 500_000),
        ("actions", 10, (0,), 0.98, 500_000),
        ("states", 50, (0, 1, 2), 0.97, 600_000),
    ],
)
def test_reaches_its_target(profile: Profile, count: int, seeds: tuple[int, ...], success: float, steps: int) -> None:
    found = [train_and_evaluate(profile, seed, count) for seed in seeds]
    assert np.mean([rate for rate, _, _ in found]) >= success
    assert max(spent for _, spent, _ in found) <= steps


def _tell(controller: str, metrics: Mapping[str, float], step: int) -> None:
    known = {name: round(value, 3) for name, value in metrics.items() if "success" in name}
    if known.keys() & {"warm_success", "best_success"}:
        print(f"  {controller:6s} {step:8d}", known, flush=True)  # noqa: T201 - run by hand


if __name__ == "__main__":
    for number in sys.argv[2].split(","):
        shown = int(sys.argv[3]) if len(sys.argv) > 3 else 50
        print(number, train_and_evaluate(sys.argv[1], int(number), shown, _tell), flush=True)  # type: ignore[arg-type] # noqa: T201
