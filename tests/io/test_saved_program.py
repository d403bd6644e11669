"""A program's directory: what is saved is loaded."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roboscribe.errors import ArtifactError
from roboscribe.io import SavedProgram, load_program, save_program, sha256_of

WEIGHTS = {
    "hold.actor.0.weight": np.arange(6, dtype=np.float32).reshape(2, 3),
    "hold.actor.0.bias": np.array(0.5),
    "move.steps": np.array([3, 1, 2]),
}
PROGRAM = SavedProgram(
    program_text="def carry(μ : EE):\n  hold(μ, b) until held\n",
    tree={"subtask": "‖μ − b1‖ < φ", "children": []},
    weights=WEIGHTS,
    controllers={"hold": {"inputs": 6}, "move": {"inputs": 3}},
    manifest={"task": "carry-2", "profile": "actions", "seed": 0, "figures": {"success": 0.5}, "note": "first"},
)


def equal(left: SavedProgram, right: SavedProgram) -> bool:
    """Whether all parts are equal, the weights with their types and shapes."""
    arrays = [{n: (a.dtype, a.shape, a.tobytes()) for n, a in p.weights.items()} for p in (left, right)]
    return arrays[0] == arrays[1] and replace(left, weights={}) == replace(right, weights={})


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    save_program(tmp_path / "made" / "here", PROGRAM)
    assert equal(load_program(tmp_path / "made" / "here"), PROGRAM)


def test_weights_are_saved_whatever_their_memory_order(tmp_path: Path) -> None:
    turned = {"hold.w": np.arange(6.0).reshape(2, 3).T, "hold.v": np.arange(6.0)[::2]}
    save_program(tmp_path, replace(PROGRAM, weights=turned))
    found = load_program(tmp_path).weights
    np.testing.assert_array_equal(found["hold.w"], [[0, 3], [1, 4], [2, 5]])
    np.testing.assert_array_equal(found["hold.v"], [0, 2, 4])


def test_the_manifest_vouches_for_the_files(tmp_path: Path) -> None:
    save_program(tmp_path, PROGRAM)
    names = {"program.txt", "tree.json", "controllers.safetensors"}
    assert {path.name for path in tmp_path.iterdir()} == {*names, "manifest.json"}
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["files"] == {name: sha256_of(tmp_path / name) for name in names}
    assert manifest["schema_version"] == 1
    assert manifest["controllers"] == PROGRAM.controllers
    assert {"python", "numpy", "safetensors"} <= set(manifest["packages"])


def test_equal_programs_make_equal_files(tmp_path: Path) -> None:
    for name in "ab":
        save_program(tmp_path / name, PROGRAM)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_an_edited_program_is_loaded_and_said_to_be_edited(tmp_path: Path) -> None:
    save_program(tmp_path, PROGRAM)
    (tmp_path / "program.txt").write_text("def other(μ : EE):\n", encoding="utf-8")
    found = load_program(tmp_path)
    assert equal(found, replace(PROGRAM, program_text="def other(μ : EE):\n", edited=True))
    save_program(tmp_path / "again", found)
    assert not load_program(tmp_path / "again").edited


def test_other_files_of_the_directory_stay(tmp_path: Path) -> None:
    (tmp_path / "rollout.mp4").write_bytes(b"film")
    save_program(tmp_path, PROGRAM)
    save_program(tmp_path, replace(PROGRAM, program_text="new"))
    assert (tmp_path / "rollout.mp4").read_bytes() == b"film"
    assert load_program(tmp_path).program_text == "new"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"controllers": {"../hold": {}}}, r"controller name '../hold'"),
        (
            {"weights": {"lift.actor": np.zeros(1)}},
            r"weight 'lift.actor'; expected a name that begins with one of hold, ",
        ),
        ({"weights": {"hold": np.zeros(1)}}, r"weight 'hold'"),
        ({"weights": {"hold./etc/passwd": np.zeros(1)}}, r"weight 'hold./etc/passwd'"),
        ({"weights": {"hold.w": np.array(["text"])}}, r"weight hold.w is of type <U4; expected numbers"),
        ({"weights": {"hold.w": np.array([None])}}, r"weight hold.w is of type object; expected numbers"),
        ({"tree": {"x": float("nan")}}, r"tree.json: cannot be written as JSON"),
        (
            {"manifest": {**PROGRAM.manifest, "figures": {"success": float("inf")}}},
            r"manifest.json: cannot be written as",
        ),
        ({"manifest": {**PROGRAM.manifest, "seed": "0"}}, r"manifest entry seed is '0'; expected a JSON int"),
        ({"manifest": {"task": "carry-2"}}, r"manifest entry profile is None; expected a JSON str"),
        ({"program_text": "x" * (2 << 20)}, r"program.txt: has 2097152 bytes; expected at most 1048576"),
    ],
)
def test_what_could_not_be_loaded_is_not_saved(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(ArtifactError, match=message):
        save_program(tmp_path, replace(PROGRAM, **change))
    assert list(tmp_path.iterdir()) == []


def test_a_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ArtifactError, match=r"file/out: cannot be made a directory \(Not a directory\)"):
        save_program(tmp_path / "file" / "out", PROGRAM)
