"""The programs that come with the package: small, said how they were made, and good at what they were made for."""

from __future__ import annotations

import pytest

from roboscribe.io.saved_program import load_program
from roboscribe.pipelines.programs import evaluation, load_with_task
from roboscribe.programs import TRAINED, shipped_names
from roboscribe.stages.evaluate import Config

NAMES = shipped_names()


def test_loops_conditions_and_another_robot_are_shipped() -> None:
    assert {
        "pick-place-4",
        "pick-place-cond",
        "place-cubes-drawer-3",
        "push-3",
        "table-top",
        "tower-4",
        "tower-5",
    } <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_small_and_says_how_it_was_made(name: str) -> None:
    assert sum(path.stat().st_size for path in (TRAINED / name).iterdir()) < 1_000_000
    manifest = load_program(TRAINED / name).manifest
    assert manifest["task"] == name
    assert str(manifest["command"]).startswith(f"roboscribe synthesize {name} --seed {manifest['seed']}")
    assert len(str(manifest["commit"])) >= 40


@pytest.mark.parametrize("name", NAMES)
def test_each_solves_its_task(name: str) -> None:
    program, where = load_with_task(TRAINED / name, None, "stable", "fast")
    result = evaluation(program, Config(where, seed=123, evaluation_episodes=8))
    success = result["success"]
    assert isinstance(success, float)
    assert success >= 7 / 8
