"""The page about our files is right: its own code writes a file that is read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from roboscribe.envs.catalogue import make_task
from roboscribe.io import metadata_for, read_demonstrations
from roboscribe.io.formats.mapping import Draft, parse_mapping
from roboscribe.io.formats.table import FORMATS
from roboscribe.io.inspection import inspect

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "data-format.md").read_text(encoding="utf-8")
CODE = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def test_the_pages_code_writes_a_file_with_which_nothing_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(CODE[0], {})
    task = make_task("pick-place-1")
    found = read_demonstrations(tmp_path / "demos.parquet", task)
    (trajectory,) = found.trajectories
    assert len(trajectory) == 26
    assert trajectory.actions is not None
    assert bool(task.solved(trajectory.states)[-1])
    assert inspect(tmp_path / "demos.parquet", task).metadata == {}


def test_the_pages_code_has_ten_lines_beside_its_imports() -> None:
    lines = [line for line in CODE[0].splitlines() if line and not re.match("import|from", line)]
    assert len(lines) <= 10


def test_the_page_names_every_format_and_every_key() -> None:
    for name in FORMATS:
        assert f"| `{name}` |" in PAGE
    for key in metadata_for(make_task("pick-place-1"), snapshots=True):
        assert f"| `{key}` |" in PAGE


def test_the_pages_mapping_reads() -> None:
    block = re.search(r'(    task = "pick-place-1".*?action = "action"\n)', PAGE, re.DOTALL)
    assert block is not None
    draft = parse_mapping(re.sub("^    ", "", block[1], flags=re.MULTILINE), "page")
    assert isinstance(draft, Draft)
    assert draft.settings == {"task": "pick-place-1", "frequency": 25}
    assert set(draft.columns) == {
        "mu.position", "mu.opening", "b1.position", "b1.rotation", "b1.velocity", "g(b1).position", "action",
    }  # fmt: skip
