"""Trees, refinements, outcomes and libraries survive the way to the disk and back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from roboscribe.classifier import Refinement, learn_classifier
from roboscribe.controllers import Scripted
from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.rewrite import controllers
from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.errors import ArtifactError, Fail
from roboscribe.evidence import Evidence
from roboscribe.io.atomic import Json
from roboscribe.stages.runtime.controller_files import DESCRIPTIONS, WEIGHTS, read_library, write_library
from roboscribe.stages.runtime.files import FAILURES, OUTCOME, REFINEMENT, read_fail, read_json, write_fail, write_json
from roboscribe.stages.runtime.serialization import (
    failures_bytes,
    lost_to_json,
    read_failures,
    read_outcome,
    read_refinement,
    refinement_to_json,
)
from roboscribe.steps import Failure, Outcome
from roboscribe.subtask_tree import ROOT, Node, Place, Tree, update_tree
from roboscribe.tree_json import tree_from_json, tree_to_json

TASK = POINT_TASKS["point-pick-place-1"]
HOLD = Node("hold", parse_predicate("norm(mu.xz - b1.xz) < 0.02"), scales={"‖μ↓xz − b1↓xz‖": 0.25})
AT = Node("at", parse_predicate("norm(b1.xz - g(b1).xz) < 0.05"), circular=True)
TREE = update_tree(update_tree(Tree(), HOLD, ROOT), AT, ROOT)


def refinement() -> Refinement:
    """Learn from demonstrations and from states in which nothing was reached."""
    evidence = Evidence.of(TASK.demonstrate(6, 0), TASK.solved)
    failures = np.stack([TASK.initial(seed) for seed in range(200)])
    found = learn_classifier(failures, evidence, Tree(), ROOT)
    assert isinstance(found, Refinement)
    return found


def test_a_tree_survives() -> None:
    assert tree_from_json(tree_to_json(TREE)) == TREE


def test_a_loop_that_speaks_of_two_entities_survives_with_the_one_that_it_goes_over() -> None:
    into = Node("into", parse_predicate("norm(c1.xz - d1.xz) < 0.1"), circular=True, over="c1")
    tree = update_tree(Tree(), into, ROOT)
    assert tree_from_json(tree_to_json(tree)) == tree
    assert tree_from_json(tree_to_json(tree)).node("into").role == "c1"


@pytest.mark.parametrize("damage", [{}, {"nodes": [{"name": "a"}], "edges": []}, {"nodes": 3, "edges": 4}, None])
def test_what_is_no_tree_is_refused(damage: object) -> None:
    with pytest.raises(ArtifactError, match="no subtask tree"):
        tree_from_json(damage)


def test_a_tree_with_hostile_predicates_is_refused() -> None:
    value = tree_to_json(TREE)
    nodes = [{**tree_to_json(Tree((HOLD,), ()))["nodes"][0], "predicate": "__import__('os')"}]  # type: ignore[index,dict-item]
    with pytest.raises(ArtifactError, match="no subtask tree"):
        tree_from_json({**value, "nodes": nodes})


def test_a_refinement_survives_with_its_table(tmp_path: Path) -> None:
    found = refinement()
    assert len(found.table) > 1
    write_json(tmp_path / REFINEMENT, refinement_to_json(found))
    assert read_refinement(tmp_path / REFINEMENT) == found


def test_a_refinement_survives_with_its_place_and_what_was_passed_over(tmp_path: Path) -> None:
    found = refinement()
    for place in (Place("hold"), Place(apart=True)):
        other = replace(found, place=place, passed_over=(("b1.z > 0.3", "its program explains 3 of 6 demonstrations"),))
        write_json(tmp_path / REFINEMENT, refinement_to_json(other))
        assert read_refinement(tmp_path / REFINEMENT) == other


@pytest.mark.parametrize("missing", ["table", "place", "passed_over", "node"])
def test_what_is_no_refinement_is_refused(missing: str, tmp_path: Path) -> None:
    value = refinement_to_json(refinement())
    del value[missing]
    write_json(tmp_path / REFINEMENT, value)
    with pytest.raises(ArtifactError, match="no refinement"):
        read_refinement(tmp_path / REFINEMENT)


def outcome() -> Outcome:
    """Build an outcome: one episode broke, two were stuck."""
    rng = np.random.default_rng(0)
    lost = [
        Failure(rng.normal(size=(steps, TASK.layout.size)), name) for steps, name in ((0, ""), (3, "at"), (2, "at"))
    ]
    return Outcome(2, 5, tuple(lost))


def write_outcome(out: Path, outcome: Outcome) -> None:
    """Write an outcome as the stage does."""
    figures: dict[str, Json] = {"successes": outcome.successes, "episodes": outcome.episodes}
    write_json(out / OUTCOME, {**figures, **lost_to_json(outcome.lost)})
    (out / FAILURES).write_bytes(failures_bytes(outcome.failures()))


@pytest.mark.parametrize("lost", [0, 1, 3])
def test_an_outcome_survives(lost: int, tmp_path: Path) -> None:
    before = replace(outcome(), lost=outcome().lost[:lost])
    write_outcome(tmp_path, before)
    after = read_outcome(tmp_path)
    assert (after.successes, after.episodes, after.stuck_at) == (2, 5, before.stuck_at)
    assert [each.unreached for each in after.lost] == [each.unreached for each in before.lost]
    for mine, theirs in zip(before.lost, after.lost, strict=True):
        np.testing.assert_array_equal(mine.states, theirs.states)


def test_damaged_failures_are_refused(tmp_path: Path) -> None:
    write_outcome(tmp_path, outcome())
    whole = (tmp_path / FAILURES).read_bytes()
    (tmp_path / FAILURES).write_bytes(whole[:-1])
    with pytest.raises(ArtifactError, match="failing states"):
        read_outcome(tmp_path)


def test_failures_of_other_episodes_are_refused(tmp_path: Path) -> None:
    write_outcome(tmp_path, outcome())
    (tmp_path / FAILURES).write_bytes(failures_bytes(outcome().failures("at")[:-1]))
    with pytest.raises(ArtifactError, match="4 states where 5 are expected"):
        read_outcome(tmp_path)


@pytest.mark.parametrize("unreached", [None, ["at"]])
def test_what_is_no_outcome_is_refused(unreached: Json, tmp_path: Path) -> None:
    write_outcome(tmp_path, outcome())
    write_json(tmp_path / OUTCOME, {**read_json(tmp_path / OUTCOME), "unreached": unreached})
    with pytest.raises(ArtifactError, match="found no outcome"):
        read_outcome(tmp_path)


def test_failing_states_survive(tmp_path: Path) -> None:
    states = np.random.default_rng(0).normal(size=(3, TASK.layout.size))
    (tmp_path / FAILURES).write_bytes(failures_bytes(states))
    np.testing.assert_array_equal(read_failures(tmp_path / FAILURES), states)


def test_a_fail_survives(tmp_path: Path) -> None:
    assert read_fail(tmp_path) is None
    write_fail(tmp_path, Fail("no luck"))
    assert read_fail(tmp_path) == Fail("no luck")


def test_scripted_controllers_act_the_same_after_loading(tmp_path: Path) -> None:
    program = parse_program(
        "def P(mu: EE): b := get(lambda b:block. true); pi_hold(mu, b) until norm(mu.xz - b.xz) < 0.02"
    )
    (run,) = controllers(program)
    write_library(tmp_path, {"hold": Scripted.of(TASK, run, {"‖μ↓xz − b↓xz‖": 0.25}, 7)})
    loaded = read_library(tmp_path / DESCRIPTIONS, tmp_path / WEIGHTS, TASK)["hold"]
    states, entities = np.stack([TASK.initial(seed) for seed in range(5)]), np.zeros((5, 1), np.int64)
    wanted = TASK.controller(run, {"‖μ↓xz − b↓xz‖": 0.25}, 7).act(states, entities)
    np.testing.assert_array_equal(loaded.act(states, entities), wanted)


def test_scripted_controllers_are_refused_elsewhere(tmp_path: Path) -> None:
    program = parse_program(
        "def P(mu: EE): b := get(lambda b:block. true); pi_hold(mu, b) until norm(mu.xz - b.xz) < 0.02"
    )
    (run,) = controllers(program)
    write_library(tmp_path, {"hold": Scripted.of(TASK, run, {}, 7)})

    class Other:
        name = "elsewhere"

    with pytest.raises(ArtifactError, match="task elsewhere brings none"):
        read_library(tmp_path / DESCRIPTIONS, tmp_path / WEIGHTS, Other())  # type: ignore[arg-type]  # only its name is read


def test_files_that_are_no_json_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"a": NaN}')
    with pytest.raises(ArtifactError, match=r"a\.json: cannot be read as JSON"):
        read_json(tmp_path / "a.json")


def test_equality_of_refinements_is_not_trivial() -> None:
    found = refinement()
    assert replace(found, positives=found.positives + 1) != found
