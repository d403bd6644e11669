"""Damaged files of other programs: a typed error or the right numbers, never a traceback, never other numbers."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roboscribe.errors import DemonstrationError
from roboscribe.io import read_demonstrations
from roboscribe.io.formats.provenance import place_of
from roboscribe.io.formats.table import FORMATS
from roboscribe.io.formats.transfer import export, ingest, suggest_mapping
from tests.io.examples import TASK, carried, same, write
from tests.io.formats.test_round_trips import NAMES

GOOD = [carried(0, length=6), carried(1, length=4)]
GUARDED = [kind for kind in FORMATS if kind != "csv"]
"""Formats with checksums of their own, in the form in which we write them; text has none."""


def files_of(path: Path) -> list[Path]:
    """List the files of an export."""
    return sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a directory with one export in each format."""
    root = tmp_path_factory.mktemp("exports")
    ours = write(root / "ours.parquet", GOOD)
    for kind, name in NAMES.items():
        export(ours, TASK, FORMATS[kind], root / name)
    return root


def copied(exports: Path, kind: str, target: Path, *, guarded: bool) -> Path:
    """Copy one export, with or without the record beside it."""
    path, copy = exports / NAMES[kind], target / NAMES[kind]
    if path.is_dir():
        shutil.copytree(path, copy)
    else:
        shutil.copy(path, copy)
    if not guarded:
        place_of(copy).unlink(missing_ok=True)
    elif place_of(copy) != copy and not path.is_dir():
        shutil.copy(place_of(path), place_of(copy))
    return copy


def try_to_read(path: Path, kind: str, out: Path) -> bool:
    """Read a damaged export; True where it was refused, and otherwise the numbers must be right."""
    out.unlink(missing_ok=True)
    with suppress(DemonstrationError):
        ingest(path, TASK, FORMATS[kind], None, out)
        assert same(read_demonstrations(out, TASK).trajectories, GOOD)
    return not out.exists()


def flip(file: Path, bit: int) -> None:
    """Flip one bit of a file."""
    data = bytearray(file.read_bytes())
    data[bit // 8 % len(data)] ^= 1 << bit % 8
    file.write_bytes(data)


@pytest.mark.parametrize("kind", FORMATS)
def test_every_flipped_bit_of_a_recorded_export_is_seen(tmp_path: Path, exports: Path, kind: str) -> None:
    copy = copied(exports, kind, tmp_path, guarded=True)
    rng = np.random.default_rng(0)
    for file in (*files_of(copy), place_of(copy)):
        data = file.read_bytes()
        for bit in rng.integers(8 * len(data), size=8):
            flip(file, int(bit))
            assert try_to_read(copy, kind, tmp_path / "out")
            file.write_bytes(data)
        file.write_bytes(data[: len(data) // 2])
        assert try_to_read(copy, kind, tmp_path / "out")
        file.write_bytes(data)
    assert not try_to_read(copy, kind, tmp_path / "out")


@pytest.mark.parametrize("kind", GUARDED)
def test_a_flipped_bit_without_the_record_never_changes_a_number(tmp_path: Path, exports: Path, kind: str) -> None:
    copy = copied(exports, kind, tmp_path, guarded=False)
    rng = np.random.default_rng(1)
    refused = 0
    for file in files_of(copy):
        data = file.read_bytes()
        for bit in rng.integers(8 * len(data), size=80 // len(files_of(copy))):
            flip(file, int(bit))
            refused += try_to_read(copy, kind, tmp_path / "out")
            file.write_bytes(data)
    assert refused > 20


@pytest.mark.parametrize("kind", GUARDED)
def test_truncated_files_without_the_record_are_refused(tmp_path: Path, exports: Path, kind: str) -> None:
    copy = copied(exports, kind, tmp_path, guarded=False)
    for file in files_of(copy):
        data = file.read_bytes()
        for size in (0, 1, len(data) // 3, len(data) // 2, len(data) - 1):
            file.write_bytes(data[:size])
            try_to_read(copy, kind, tmp_path / "out")
        file.unlink()
        try_to_read(copy, kind, tmp_path / "out")
        file.write_bytes(data)
    assert not try_to_read(copy, kind, tmp_path / "out")


def test_a_truncated_table_lacks_frames_and_says_so(tmp_path: Path, exports: Path) -> None:
    copy = copied(exports, "csv", tmp_path, guarded=False)
    text = copy.read_text()
    copy.write_text(text[: text.rindex("\n", 0, len(text) - 40) + 60])
    with pytest.raises(DemonstrationError, match=r"demos.csv"):
        ingest(copy, TASK, FORMATS["csv"], None, tmp_path / "out")


@given(st.binary(max_size=400), st.sampled_from(["robomimic", "csv", "npz"]))
@settings(max_examples=30, deadline=None)
def test_anything_else_is_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes, kind: str) -> None:
    path = tmp_path_factory.getbasetemp() / NAMES[kind]
    path.write_bytes(data)
    with pytest.raises(DemonstrationError):
        ingest(path, TASK, FORMATS[kind], None, path.with_name("out"))


@given(st.integers(0, 10**9), st.binary(min_size=1, max_size=40), st.sampled_from(GUARDED))
@settings(max_examples=30, deadline=None)
def test_bytes_put_anywhere_never_change_a_number(
    tmp_path_factory: pytest.TempPathFactory, exports: Path, place: int, put: bytes, kind: str
) -> None:
    tmp_path = tmp_path_factory.mktemp("damage")
    copy = copied(exports, kind, tmp_path, guarded=False)
    files = files_of(copy)
    file = files[place % len(files)]
    data = bytearray(file.read_bytes())
    start = place % len(data)
    data[start : start + len(put)] = put
    file.write_bytes(data)
    try_to_read(copy, kind, tmp_path / "out")


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_that_is_not_there_is_named(tmp_path: Path, kind: str) -> None:
    with pytest.raises(DemonstrationError, match=str(tmp_path / "nowhere")):
        suggest_mapping(tmp_path / "nowhere", TASK, FORMATS[kind])
