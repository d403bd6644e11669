"""Files are whole or absent: reliability row 2, and a full disk (row 13)."""

from __future__ import annotations

import os
import resource
import signal
from pathlib import Path

import pytest

from roboscribe.errors import ArtifactError
from roboscribe.io import canonical_json, parse_json, remove_unfinished, sha256_of, write_file, write_files
from tests.conftest import Figure
from tests.io.examples import interrupted, kill_everywhere, survived

OLD, NEW = b"old" * 10, b"new" * 3_000_000


def hidden(directory: Path) -> list[Path]:
    return sorted(path for path in directory.iterdir() if path.name.startswith("."))


def test_write_replaces_the_content_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_file(path, OLD)
    write_file(path, NEW)
    assert path.read_bytes() == NEW
    assert list(tmp_path.iterdir()) == [path]


def test_row_2_killed_at_any_line_leaves_the_old_or_the_new_file(tmp_path: Path, figure: Figure) -> None:
    path = tmp_path / "file"
    write_file(path, OLD)
    seen = set()

    def check() -> None:
        content = path.read_bytes()
        assert content in (OLD, NEW)
        seen.add(content)
        write_file(path, OLD)
        assert hidden(tmp_path) == []

    kills = kill_everywhere(lambda: write_file(path, NEW), check)
    assert kills > 20
    assert seen == {OLD, NEW}
    figure("kills survived", kills, kills)


def test_row_2_first_write_killed_at_any_line_leaves_no_file_or_the_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "file"

    def check() -> None:
        assert not path.exists() or path.read_bytes() == b"new"
        path.unlink(missing_ok=True)
        remove_unfinished(tmp_path)
        assert list(tmp_path.iterdir()) == []

    kill_everywhere(lambda: write_file(path, b"new"), check)


def test_row_2_files_of_a_group_become_new_in_order(tmp_path: Path) -> None:
    first, last = tmp_path / "data", tmp_path / "manifest"
    write_files({first: b"old", last: b"old"})
    seen = set()

    def check() -> None:
        seen.add((first.read_bytes(), last.read_bytes()))
        write_files({first: b"old", last: b"old"})

    kill_everywhere(lambda: write_files({first: b"new", last: b"new"}), check)
    assert seen == {(b"old", b"old"), (b"new", b"old"), (b"new", b"new")}


def test_row_2_a_writer_that_pauses_at_any_line_is_not_disturbed_by_others(tmp_path: Path) -> None:
    path, other = tmp_path / "file", tmp_path / "other"
    waited = 0
    for step in range(1, 10_000):
        path.unlink(missing_ok=True)
        child = interrupted(step, lambda: write_file(path, b"slow"), signal.SIGSTOP)
        _, status = os.waitpid(child, os.WUNTRACED)
        if os.WIFEXITED(status):
            break
        try:
            write_file(other, b"quick")
            waited += bool(hidden(tmp_path))
        finally:
            os.kill(child, signal.SIGCONT)
        assert survived(child)
        assert path.read_bytes() == b"slow"
        assert hidden(tmp_path) == []
    assert waited > 5


def test_row_13_a_full_disk_is_one_error_and_the_old_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_file(path, OLD)

    def fill() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (5_000_000, 5_000_000))
        with pytest.raises(ArtifactError, match=r"file: could not be written \(File too large\)"):
            write_file(path, NEW)

    assert survived(interrupted(0, fill))
    assert path.read_bytes() == OLD
    assert hidden(tmp_path) == []


def test_a_missing_directory_is_named(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match=r"nowhere/file: could not be written \(No such file or directory\)"):
        write_file(tmp_path / "nowhere" / "file", b"")


def test_sha256_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"abc")
    assert sha256_of(path) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_equal_values_have_one_spelling() -> None:
    assert canonical_json({"b": [1, None], "a": "φ"}) == '{"a":"φ","b":[1,null]}'


@pytest.mark.parametrize("text", ["", "{", "NaN", "[Infinity]", '{"a": 1, "a": 2}', "[" * 100_000, "!!python/name:os"])
def test_what_is_not_strict_json_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_json(text)


def test_nan_is_not_spelled() -> None:
    with pytest.raises(ValueError, match="JSON"):
        canonical_json({"a": float("nan")})
