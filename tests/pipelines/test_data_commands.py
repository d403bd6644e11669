"""Commands that bring demonstrations in and out, and that look at them."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from roboscribe.io import sha256_of
from roboscribe.io.formats.table import FORMATS
from tests.pipelines.runs import Command

TASK = "point-pick-place-1"


@pytest.fixture
def demos(command: Command, tmp_path: Path) -> Path:
    """Collect a few demonstrations, as ever."""
    path = tmp_path / "new" / "demos.parquet"
    assert command("demos", TASK, "--episodes", 8, "--seed", 3, "--out", path) == 0
    return path


def test_collecting_takes_its_arguments_in_any_order_and_by_its_own_name(command: Command, tmp_path: Path) -> None:
    ways = (["demos", TASK, "--out", "a"], ["demos", "--out", "b", TASK], ["demos", "collect", TASK, "--out", "c"])
    for way in ways:
        named = [tmp_path / word if word in "abc" else word for word in way]
        assert command(*named, "--episodes", 2) == 0
    assert len({sha256_of(tmp_path / name) for name in "abc"}) == 1


@pytest.mark.parametrize("kind", FORMATS)
def test_demonstrations_go_out_and_come_back(
    command: Command, demos: Path, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    suffix = {"robomimic": ".hdf5", "csv": ".csv", "npz": ".npz"}.get(kind, "")
    foreign, again = tmp_path / "out" / f"shown{suffix}", tmp_path / "in" / "again.parquet"
    assert command("export", demos, "--format", kind, "--out", foreign) == 0
    assert command("ingest", foreign, "--task", TASK, "--out", again) == 0
    assert f"8 demonstrations of {TASK} (" in capsys.readouterr().out
    assert sha256_of(again) == sha256_of(demos)


def test_a_mapping_is_suggested_corrected_and_used(
    command: Command, demos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign, mapping, again = tmp_path / "own.csv", tmp_path / "map.toml", tmp_path / "again.parquet"
    assert command("export", demos, "--format", "csv", "--out", foreign) == 0
    table = pd.read_csv(foreign).rename(columns={"mu.position.x": "hand_x", "episode_index": "trial"})
    table.drop(columns=["timestamp"]).to_csv(foreign, index=False)
    foreign.with_name("own.csv.roboscribe.json").unlink()
    assert command("ingest", foreign, "--task", TASK, "--suggest") == 0
    assert '"mu.position" = ""  # please fill in; 2 numbers in m (x, z)' in capsys.readouterr().out
    assert command("ingest", foreign, "--task", TASK, "--suggest", "--map", mapping) == 0
    assert command("ingest", foreign, "--task", TASK, "--suggest", "--map", mapping) == 2
    assert "exists already" in capsys.readouterr().err
    assert command("ingest", foreign, "--task", TASK, "--map", mapping, "--out", again) == 2
    lines = capsys.readouterr().err.splitlines()
    assert [line.removeprefix("error: ").split(": ")[1] for line in lines] == ["frequency", '"mu.position"']
    text = mapping.read_text().replace('"mu.position" = ""', '"mu.position" = ["hand_x", "mu.position.z"]')
    mapping.write_text("frequency = 10\n" + text)
    assert command("ingest", foreign, "--task", TASK, "--map", mapping, "--out", again) == 0
    assert "nothing guards it against damage" in capsys.readouterr().out
    assert command("demos", "check", again) == 0


def test_check_finds_everything_and_says_what_would_be_right(
    command: Command, demos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("demos", "check", demos) == 0
    pd.read_parquet(demos).to_parquet(demos)
    capsys.readouterr()
    assert command("demos", "check", demos) == 2
    assert "names no task in its metadata (roboscribe.task); name it with --task" in capsys.readouterr().err
    assert command("demos", "check", demos, "--task", TASK) == 2
    said = capsys.readouterr()
    assert said.err == f"error: {demos}: 4 problems\n"
    assert said.out.count(": found none, expected ") == 4
    exec(said.out[said.out.index("import pyarrow") :], {})
    assert command("demos", "check", demos) == 0


def test_info_says_what_a_file_holds(
    command: Command, demos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("demos", "info", demos, "--json", tmp_path / "json" / "info.json") == 0
    found = json.loads((tmp_path / "json" / "info.json").read_text())
    assert found["episodes"] == found["reach_the_goal"] == 8
    assert found["sha256"] == sha256_of(demos)
    assert f"task            {TASK}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ingest", "/nowhere", "--task", TASK, "--out", "x"], "/nowhere: of no known format, name it with --format"),
        (["ingest", "/nowhere", "--task", TASK, "--format", "rlds", "--out", "x"], "unknown format 'rlds'"),
        (["ingest", "/nowhere.csv", "--task", TASK], "--out is missing"),
        (["ingest", "/nowhere.csv", "--task", "nowhere", "--out", "x"], "unknown task 'nowhere'"),
        (["ingest", "/nowhere.csv", "--task", TASK, "--out", "x"], "/nowhere.csv: no such file"),
        (["export", "/nowhere", "--format", "csv", "--out", "x", "--task", TASK], "/nowhere: no such file"),
        (["demos", "check", "/nowhere"], "/nowhere: no such file"),
        (["demos", "info", "/nowhere"], "/nowhere: no such file"),
        (["demos", "chekc", "FILE"], "--out"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    command: Command, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(*arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert said in error
    assert len(error.splitlines()) == 1


def test_an_export_goes_nowhere_where_something_is(command: Command, demos: Path, tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    assert command("export", demos, "--format", "lerobot", "--out", tmp_path / "set") == 2
    assert list((tmp_path / "set").iterdir()) == []


def test_demonstrations_are_filmed(
    command: Command, demos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film = tmp_path / "shown.gif"
    assert command("demos", "replay", demos, "--out", film, "--grid", "2x1", "--episode", 6) == 0
    assert "demonstrations 6 to 7" in capsys.readouterr().out
    with Image.open(film) as opened:
        frames, size = getattr(opened, "n_frames", 1), opened.size
    lengths = pd.read_parquet(demos).groupby("episode_index").size()
    assert frames >= max(lengths[6], lengths[7]) - 1
    assert size[0] > size[1]
    assert command("demos", "replay", demos, "--out", film, "--episode", 8) == 2
    assert "there are 8, numbered from 0" in capsys.readouterr().err
    assert command("demos", "replay", demos, "--out", tmp_path / "x.pdf") == 2
