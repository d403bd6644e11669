"""ONNX files beside a program act as its controllers do, in whatever runs ONNX."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx.reference import ReferenceEvaluator

import roboscribe
from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.io.saved_program import load_program
from roboscribe.policy import Policy
from roboscribe.programs import TRAINED
from roboscribe.rl.onnx_graph import skill_model
from roboscribe.rl.skill import Skill
from roboscribe.world.layout import ROBOT, FloatArray, IntArray

ROWS = 20
CLOSE = 1e-5
"""What single precision may make of an action."""


def seen(policy: Policy, controller: str, states: FloatArray, entities: IntArray) -> dict[str, NDArray[np.float64]]:
    """Look up, by the names a user reads in the program, what a controller sees of some states."""
    run = next(run for run in controllers(policy.program) if run.controller == controller)
    skill = policy.runnable.library[controller]
    assert isinstance(skill, Skill)
    columns, found = policy.task.layout.columns, {}
    for part in skill.spec.parts:
        owner = "mu" if part.slot == ROBOT else run_variables(run)[part.slot]
        objects = np.full(len(states), ROBOT) if part.slot == ROBOT else entities[:, part.slot]
        rows = [state[columns[which, part.attribute, part.goal]] for state, which in zip(states, objects, strict=True)]
        found[f"g({owner}).{part.attribute}" if part.goal else f"{owner}.{part.attribute}"] = np.array(rows)
    return found


@pytest.mark.parametrize("name", ["pick-place-1", "tower-5", "push-3", "table-top"])
def test_onnx_files_give_the_actions_of_the_controllers(name: str, tmp_path: Path) -> None:
    policy = roboscribe.load(name)
    rng = np.random.default_rng(0)
    layout = policy.task.layout
    starts = policy.task.world(ROWS).reset(np.arange(ROWS), np.arange(ROWS))
    states = starts + rng.normal(0.0, 0.02, starts.shape)
    files = policy.save_onnx(tmp_path)
    assert {path.stem for path in files} == set(policy.runnable.library)
    for path in files:
        skill = policy.runnable.library[path.stem]
        assert isinstance(skill, Skill)
        kinds = [[rank for rank, kind in enumerate(layout.entities) if kind.name == name] for name in skill.spec.types]
        entities = np.stack([rng.choice(ranks, ROWS) for ranks in kinds], axis=1)
        model = onnx.load(path)
        onnx.checker.check_model(model, full_check=True)
        (action,) = ReferenceEvaluator(model).run(None, seen(policy, path.stem, states, entities))
        np.testing.assert_allclose(np.asarray(action), skill.act(states, entities), atol=CLOSE)


def test_what_is_seen_from_near_by_alone_fades_in_onnx_too() -> None:
    policy = roboscribe.load("tower-5")
    run, known = controllers(policy.program)[0], policy.runnable.library["hold"]
    assert isinstance(known, Skill)
    skill = replace(known, spec=replace(known.spec, nearby=(len(known.spec.pairs) - 1,)))
    rows, columns = np.arange(ROWS), policy.task.layout.columns
    states, entities = policy.task.world(ROWS).reset(rows, rows), np.zeros((ROWS, 1), np.int64)
    states[::2, columns[0, "position", True]] = states[::2, columns[ROBOT, "position", False]] + 0.05
    inputs = seen(policy, "hold", states, entities)
    (action,) = ReferenceEvaluator(skill_model(skill, run)).run(None, inputs)
    np.testing.assert_allclose(np.asarray(action), skill.act(states, entities), atol=CLOSE)
    assert not np.allclose(skill.act(states, entities), known.act(states, entities), atol=CLOSE)


def test_a_program_with_onnx_files_beside_it_loads(tmp_path: Path) -> None:
    policy = roboscribe.load("pick-place-1")
    for path in (TRAINED / "pick-place-1").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (file, *_) = policy.save_onnx(tmp_path)
    assert file.parent == tmp_path / "onnx"
    assert not load_program(tmp_path).edited
    assert onnx.load(file).graph.doc_string.startswith(f"π_{file.stem}(μ, b")
