"""Saved programs that cannot be trusted: reliability rows 2, 13 and 19."""

from __future__ import annotations

import io
import json
import os
import pickle
import re
import tarfile
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from roboscribe.errors import ArtifactError
from roboscribe.io import SavedProgram, canonical_json, load_program, save_program
from roboscribe.io.atomic import Json, sha256_of_bytes
from tests.io.examples import kill_everywhere

PROGRAM = SavedProgram(
    program_text="def carry(μ : EE):\n  hold(μ, b) until held\n",
    tree={"children": []},
    weights={"hold.weight": np.arange(40.0)},
    controllers={"hold": {"inputs": 6}},
    manifest={"task": "carry-2", "profile": "actions", "seed": 0, "figures": {"success": 0.5}},
)
FILES = ("program.txt", "tree.json", "controllers.safetensors", "manifest.json")


class Trap:
    """Leaves a mark when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = str(mark)

    def __reduce__(self) -> tuple[object, tuple[str]]:
        """Ask for a directory to be made."""
        return os.mkdir, (self.mark,)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_program(tmp_path / "out", PROGRAM)
    return tmp_path / "out"


def refuse(directory: Path, message: str) -> None:
    """Expect one error of one line."""
    with pytest.raises(ArtifactError, match=message) as caught:
        load_program(directory)
    assert "\n" not in str(caught.value)


def forge(directory: Path, name: str, data: bytes) -> None:
    """Replace a file and let the manifest vouch for it."""
    (directory / name).write_bytes(data)
    manifest = json.loads((directory / "manifest.json").read_text())
    manifest["files"][name] = sha256_of_bytes(data)
    forge_manifest(directory, manifest)


def forge_manifest(directory: Path, manifest: dict[str, Json]) -> None:
    """Replace the manifest by one whose digest is right."""
    stated = {key: value for key, value in manifest.items() if key != "digest"}
    digest = sha256_of_bytes(canonical_json(stated).encode())
    (directory / "manifest.json").write_text(canonical_json({**stated, "digest": digest}))


@pytest.mark.parametrize("name", FILES[1:])
def test_any_flipped_bit_is_refused(saved: Path, name: str) -> None:
    data = (saved / name).read_bytes()
    for byte in range(0, len(data), max(len(data) // 60, 1)):
        changed = bytearray(data)
        changed[byte] ^= 1 << byte % 8
        (saved / name).write_bytes(changed)
        refuse(saved, name)
    for size in range(0, len(data), max(len(data) // 20, 1)):
        (saved / name).write_bytes(data[:size])
        refuse(saved, name)


def test_other_whitespace_in_the_manifest_is_no_damage(saved: Path) -> None:
    manifest = json.loads((saved / "manifest.json").read_text())
    (saved / "manifest.json").write_text(json.dumps(manifest))
    assert load_program(saved).controllers == PROGRAM.controllers


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_named(saved: Path, name: str) -> None:
    (saved / name).unlink()
    refuse(saved, rf"out/{name}: cannot be read \(No such file or directory\); expected a regular file")


@pytest.mark.parametrize("name", ["controllers.pt", "policy.PKL", "run.ckpt", "weights.npz"])
def test_row_19_pickles_are_refused_by_name(saved: Path, tmp_path: Path, name: str) -> None:
    (saved / name).write_bytes(pickle.dumps(Trap(tmp_path / "mark")))
    refuse(saved, f"{name}: pickles are refused; expected JSON, text and safetensors only")
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize("name", FILES[1:])
def test_row_19_a_pickle_in_place_of_a_file_is_refused(saved: Path, tmp_path: Path, name: str) -> None:
    data = pickle.dumps(Trap(tmp_path / "mark"))
    if name == "manifest.json":
        (saved / name).write_bytes(data)
    else:
        forge(saved, name, data)
    refuse(saved, rf"{name}: (is no text|is no safetensors file)")
    assert not (tmp_path / "mark").exists()


def test_row_19_yaml_is_refused(saved: Path) -> None:
    (saved / "manifest.json").write_text("!!python/object/apply:os.system ['true']")
    refuse(saved, r"manifest.json: is no JSON \(.*\); expected one JSON object")
    (saved / "manifest.yaml").write_text("task: carry-2")
    refuse(saved, "manifest.yaml: YAML are refused")


@pytest.mark.parametrize("name", FILES)
def test_row_19_links_are_refused(saved: Path, tmp_path: Path, name: str) -> None:
    (saved / name).rename(tmp_path / name)
    (saved / name).symlink_to(Path("..") / name)
    refuse(saved, f"{name}: is a link; expected a regular file")


@pytest.mark.parametrize("name", FILES)
def test_row_19_what_is_no_regular_file_is_refused(saved: Path, name: str) -> None:
    (saved / name).unlink()
    os.mkfifo(saved / name)
    refuse(saved, f"{name}: is no regular file")
    (saved / name).unlink()
    (saved / name).mkdir()
    refuse(saved, rf"{name}: is no regular file")


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd", "..", "sub/program.txt"])
def test_row_19_paths_in_the_manifest_are_refused(saved: Path, name: str) -> None:
    manifest = json.loads((saved / "manifest.json").read_text())
    manifest["files"][name] = "0" * 64
    forge_manifest(saved, manifest)
    refuse(saved, rf"manifest.json: lists the files .*{re.escape(name)}")


@pytest.mark.parametrize("name", ["../hold", "a/b", "", "hold\n", "hold.x", "__import__('os')"])
def test_row_19_names_of_controllers_are_identifiers(saved: Path, name: str) -> None:
    manifest = json.loads((saved / "manifest.json").read_text())
    forge_manifest(saved, {**manifest, "controllers": {name: {}}})
    refuse(saved, rf"controller name {re.escape(repr(name))}")


def test_row_19_weights_of_no_controller_are_refused(saved: Path) -> None:
    manifest = json.loads((saved / "manifest.json").read_text())
    forge_manifest(saved, {**manifest, "controllers": {"lift": {}}})
    refuse(saved, "weight 'hold.weight'; expected a name that begins with one of lift")


def test_row_19_archives_are_refused(saved: Path, tmp_path: Path) -> None:
    for kind in ("zip", "tar.gz"):
        archive = tmp_path / f"program.{kind}"
        if kind == "zip":
            with zipfile.ZipFile(archive, "w") as packed:
                packed.writestr("../outside", "x")
        else:
            with tarfile.open(archive, "w:gz") as packed:
                packed.addfile(tarfile.TarInfo("../outside"), io.BytesIO())
        refuse(archive, f"program.{kind}: is a file; expected a directory with program.txt")
        (saved / archive.name).write_bytes(archive.read_bytes())
        refuse(saved, f"program.{kind}: archives are refused")
        forge(saved, "controllers.safetensors", archive.read_bytes())
        (saved / archive.name).unlink()
        refuse(saved, "controllers.safetensors: is no safetensors file")
    assert not list(tmp_path.rglob("outside"))


@pytest.mark.parametrize("text", ["[" * 100_000, "[]", "null", '{"a": NaN}', '{"a": 1, "a": 2}', "", '{"a": 1}}'])
def test_row_19_hostile_json_is_refused(saved: Path, text: str) -> None:
    forge(saved, "tree.json", text.encode())
    refuse(saved, "tree.json: (is no JSON|holds a JSON)")
    (saved / "manifest.json").write_text(text)
    refuse(saved, "manifest.json: ")


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("program.txt", 2 << 20),
        ("tree.json", 33 << 20),
        ("controllers.safetensors", 2 << 30),
        ("manifest.json", 9 << 20),
    ],
)
def test_row_19_sizes_are_limited(saved: Path, name: str, size: int) -> None:
    os.truncate(saved / name, size)
    refuse(saved, f"{name}: has {size} bytes; expected at most")


def test_row_19_a_safetensors_header_that_promises_too_much_is_refused(saved: Path) -> None:
    header = json.dumps({"hold.weight": {"dtype": "F64", "shape": [1 << 40], "data_offsets": [0, 1 << 43]}}).encode()
    for length in (len(header), 1 << 62):
        forge(saved, "controllers.safetensors", length.to_bytes(8, "little") + header)
        refuse(saved, r"controllers.safetensors: is no safetensors file \(")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema_version": 2}, "has schema version 2; expected 1"),
        ({"schema_version": None}, "has schema version None; expected 1"),
        ({"files": None}, "lists the files None; expected "),
        ({"controllers": []}, "has no controllers; expected an object"),
        ({"task": 7}, "manifest entry task is 7; expected a JSON str"),
        ({"seed": True}, "manifest entry seed is True; expected a JSON int"),
        ({"figures": None}, "manifest entry figures is None; expected a JSON dict"),
        (
            {"files": {"program.txt": 1, "tree.json": [], "controllers.safetensors": None}},
            "(tree.json: was changed|lists)",
        ),
    ],
)
def test_a_manifest_of_another_shape_is_refused(saved: Path, change: dict[str, Json], message: str) -> None:
    manifest = json.loads((saved / "manifest.json").read_text())
    forge_manifest(saved, {**manifest, **change})
    refuse(saved, message)


def test_a_program_that_is_no_text_is_refused(saved: Path) -> None:
    (saved / "program.txt").write_bytes(b"def \xff")
    refuse(saved, r"program.txt: is no text \(byte 4\); expected UTF-8")


def test_a_directory_that_does_not_exist_is_named(tmp_path: Path) -> None:
    refuse(tmp_path / "nowhere", "nowhere: does not exist; expected a directory with program.txt")


def test_row_2_killed_while_saving_gives_the_old_the_new_or_a_refusal(saved: Path) -> None:
    new = replace(PROGRAM, program_text="new", tree={"new": True}, weights={"hold.weight": np.ones(3)})
    seen = set()

    def check() -> None:
        try:
            found = load_program(saved)
        except ArtifactError:
            seen.add("refused")
        else:
            parts = (found.program_text, found.tree, len(found.weights["hold.weight"]), found.edited)
            assert parts in ((PROGRAM.program_text, PROGRAM.tree, 40, False), ("new", {"new": True}, 3, False))
            seen.add(found.program_text)
        save_program(saved, PROGRAM)
        assert {path.name for path in saved.iterdir()} == set(FILES)

    kill_everywhere(lambda: save_program(saved, new), check, within="write_files")
    assert seen == {PROGRAM.program_text, "refused", "new"}
