"""Everything that is wrong with a file, at once, and what would be right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from roboscribe.io import read_demonstrations
from roboscribe.io.inspection import describe_file, inspect
from tests.io.examples import TASK, carried, mapped, replaced, rewrite, same, write


def bare(path: Path) -> Path:
    """Write exactly the right columns with pandas, and nothing else."""
    pq.read_table(write(path, [carried(0), carried(1)])).to_pandas().to_parquet(path)
    return path


def test_nothing_is_wrong_with_our_own_file(tmp_path: Path) -> None:
    path = write(tmp_path / "demos.parquet", [carried(0), carried(1), carried(0), carried(2, reach=0.2)])
    found = inspect(path, TASK)
    assert found.problems == ()
    assert found.remarks == (
        f"{path}: episode 2: duplicate of episode 0; left out",
        f"{path}: episode 3: never reaches the goal; left out",
    )
    assert found.recipe(path) == ""


def test_the_right_columns_without_metadata_are_told_once_and_put_right_by_pasting(tmp_path: Path) -> None:
    path = bare(tmp_path / "demos.parquet")
    found = inspect(path, TASK)
    keys = ("schema_version", "task", "frequency", "objects")
    assert [line.split(": found")[0] for line in found.problems] == [f"{path}: metadata roboscribe.{k}" for k in keys]
    exec(found.recipe(path), {})
    assert inspect(path, TASK).problems == ()
    assert same(read_demonstrations(path, TASK).trajectories, [carried(0), carried(1)])


def test_every_kind_of_problem_comes_at_once(tmp_path: Path) -> None:
    path = write(tmp_path / "demos.parquet", [carried(seed) for seed in range(4)])

    def spoil(table: pa.Table) -> pa.Table:
        table = mapped(table, "b1.tilt", lambda row, old: np.nan if row >= 13 and row % 12 == 1 else old)
        table = mapped(table, "action", lambda row, old: [2.0] * 4 if row == 25 else old)
        table = replaced(table, "mu.opening", ["wide"] * 48, pa.string())
        table = table.drop_columns(["b2.position"])
        return table.replace_schema_metadata({**table.schema.metadata, b"roboscribe.task": b"stack"})

    problems = [line.removeprefix(f"{path}: ") for line in inspect(rewrite(path, spoil), TASK).problems]
    assert problems[0] == "metadata roboscribe.task: found stack, expected carry-2"
    assert problems[1].startswith("missing column b2.position: found ")
    assert problems[2] == "column mu.opening: found string, expected floating-point numbers"
    assert problems[3] == (
        "episode 1, frame 1, column b1.tilt: found nan, expected a finite number (and 2 more episodes)"
    )
    assert problems[4] == "episode 2, frame 1, column action[0]: found 2, expected a number from -1 to 1"
    assert len(problems) == 5


def test_what_is_missing_in_an_episode_and_out_of_order_is_told(tmp_path: Path) -> None:
    path = write(tmp_path / "demos.parquet", [carried(seed) for seed in range(3)])

    def spoil(table: pa.Table) -> pa.Table:
        table = mapped(table, "snapshot", lambda row, old: None if row == 3 else old)
        return mapped(table, "frame_index", lambda row, old: 40 if row == 14 else old)

    problems = [line.removeprefix(f"{path}: ") for line in inspect(rewrite(path, spoil), TASK).problems]
    assert problems == [
        "episode 0, frame 3, column snapshot: found no value, expected one as in the episode's other frames",
        "episode 1, frame 40, column frame_index: found 40, expected 2",
    ]


def test_damage_is_one_problem(tmp_path: Path) -> None:
    path = write(tmp_path / "demos.parquet", [carried(0), carried(1)])
    data = path.read_bytes()
    for damaged in (
        b"",
        b"PAR1",
        data[: len(data) // 2],
        data[:500] + bytes([data[500] ^ 1]) + data[501:],
        data[:-9] + bytes([data[-9] ^ 1]) + data[-8:],
    ):
        path.write_bytes(damaged)
        assert len(inspect(path, TASK).problems) == 1
    path.unlink()
    assert inspect(path, TASK).problems == (f"{path}: no such file, expected demonstrations in Parquet",)


def test_goals_that_pandas_leaves_out_altogether_are_not_given(tmp_path: Path) -> None:
    path = bare(tmp_path / "demos.parquet")
    exec(inspect(path, TASK).recipe(path), {})
    metadata = pq.read_schema(path).metadata
    frame = pd.read_parquet(path).assign(**{"g(b2).position": None, "action": None}).drop(columns="snapshot")
    table = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(
        {key: value for key, value in metadata.items() if b"snapshots" not in key}
    )
    pq.write_table(table, path)
    (first, _) = read_demonstrations(path, TASK).trajectories
    assert first.actions is None
    assert np.isnan(first.states[:, -3:]).all()


def test_a_description_says_what_a_file_holds(tmp_path: Path) -> None:
    path = write(tmp_path / "demos.parquet", [carried(0), carried(1, length=5), carried(2, reach=0.1, actions=False)])
    found = describe_file(path, TASK)
    assert found["episodes"] == 3
    assert found["frames"] == 29
    assert found["shortest"] == 5
    assert found["reach_the_goal"] == 2
    assert found["with_actions"] == 2
    assert found["generator"] == "examples"
    columns = found["columns"]
    assert isinstance(columns, dict)
    assert columns["b1.tilt"] == {"unit": "rad", "components": ["tilt"], "min": [0.0], "max": [0.0]}
