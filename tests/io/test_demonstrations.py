"""The Parquet file of demonstrations: what it holds, and that others can open it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from roboscribe.errors import DemonstrationError
from roboscribe.io import read_demonstrations, sha256_of, write_demonstrations
from roboscribe.world import Layout
from tests.io.examples import B1, BOX, G2, ROBOT, TASK, carried, rewrite, same, write


def test_what_is_written_is_read(tmp_path: Path) -> None:
    trajectories = [carried(0), carried(1, length=5), carried(2, length=1, actions=False)]
    path = write(tmp_path / "demos.parquet", trajectories)
    found = read_demonstrations(path, TASK)
    assert same(found.trajectories, trajectories)
    assert found.report == ()
    assert found.digest == sha256_of(path)


def test_equal_demonstrations_make_equal_files(tmp_path: Path) -> None:
    first, second = (write(tmp_path / name, [carried(0), carried(1)]) for name in "ab")
    assert sha256_of(first) == sha256_of(second) != sha256_of(write(tmp_path / "c", [carried(0), carried(2)]))


def test_states_only_goals_not_given_and_empty_episodes(tmp_path: Path) -> None:
    bare = replace(carried(0), actions=None, snapshots=None)
    without_goal = replace(bare, states=bare.states.copy())
    without_goal.states[:, G2] = np.nan
    empty = replace(bare, states=bare.states[:0])
    trajectories = [empty, bare, without_goal, empty]
    found = read_demonstrations(write(tmp_path / "demos.parquet", trajectories), TASK)
    assert same(found.trajectories, trajectories)


def test_pandas_opens_the_file(tmp_path: Path) -> None:
    trajectories = [carried(0), carried(1)]
    frame = pd.read_parquet(write(tmp_path / "demos.parquet", trajectories))
    assert list(frame.columns) == [
        "episode_index", "frame_index", "timestamp", "mu.position", "mu.opening",
        "b1.position", "b1.orientation", "b1.tilt", "g(b1).position",
        "b2.position", "b2.orientation", "b2.tilt", "g(b2).position", "action", "snapshot",
    ]  # fmt: skip
    assert list(frame["episode_index"]) == [0] * 12 + [1] * 12
    assert list(frame["frame_index"]) == [*range(12), *range(12)]
    np.testing.assert_array_equal(frame["timestamp"], np.tile(np.arange(12) / 25, 2))
    np.testing.assert_array_equal(np.stack(list(frame["b1.position"]))[12:], trajectories[1].states[:, B1])
    assert frame["action"].isna().to_numpy().nonzero()[0].tolist() == [11, 23]


def test_fields_say_their_units_and_the_file_what_it_shows(tmp_path: Path) -> None:
    schema = pq.read_schema(write(tmp_path / "demos.parquet", [carried(0)]))
    units = {name: schema.field(name).metadata[b"unit"] for name in ("timestamp", "b1.position", "b1.tilt", "action")}
    assert units == {"timestamp": b"s", "b1.position": b"m", "b1.tilt": b"rad", "action": b"1"}
    stated = {key: schema.metadata[b"roboscribe." + key] for key in (b"schema_version", b"task", b"frequency", b"seed")}
    assert stated == {b"schema_version": b"1", b"task": b"carry-2", b"frequency": b"25.0", b"seed": b"1"}
    assert schema.metadata[b"roboscribe.generator"] == b"examples"
    assert b'"b1":{"attributes":{"orientation":' in schema.metadata[b"roboscribe.objects"]
    assert b'"pyarrow":' in schema.metadata[b"roboscribe.packages"]


def test_a_file_that_another_program_rewrote_is_read_with_a_remark(tmp_path: Path) -> None:
    trajectories = [carried(0), carried(1)]
    path = rewrite(
        write(tmp_path / "demos.parquet", trajectories), lambda table: table.append_column("note", [["?"] * 24])
    )
    found = read_demonstrations(path, TASK)
    assert same(found.trajectories, trajectories)
    assert [line.split(": ", 1)[1] for line in found.report] == [
        "has no checksum, another program wrote it; only page checksums guard it",
        "unknown column note ignored",
    ]


def test_single_precision_and_fixed_size_lists_are_read(tmp_path: Path) -> None:
    path = write(tmp_path / "demos.parquet", [carried(0)])
    table = pq.read_table(path)
    fixed, single = pa.list_(pa.float64(), 3), pa.float32()
    kinds = {"b1.position": fixed, "g(b2).position": fixed, "b1.tilt": single, "b1.orientation": pa.list_(single)}
    fields = [field.with_type(kinds.get(field.name, field.type)) for field in table.schema]
    pq.write_table(table.cast(pa.schema(fields, table.schema.metadata)), path)
    assert same(read_demonstrations(path, TASK).trajectories, [carried(0)])


def test_nothing_is_written_that_could_not_be_read(tmp_path: Path) -> None:
    path = tmp_path / "demos.parquet"
    broken = carried(0)
    broken.states[3, B1.start + 2] = np.inf
    with pytest.raises(DemonstrationError, match=r"demos.parquet: episode 1, frame 3, column b1.position.z: found inf"):
        write(path, [carried(0), broken])
    one_box = Layout(ROBOT, (BOX,))
    with pytest.raises(DemonstrationError, match="episode 0: found the layout of b1, b2, expected that of b1"):
        write_demonstrations(path, "carry-1", one_box, 25.0, [carried(0)], generator="examples", seed=None)
    assert not path.exists()


def test_a_file_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(DemonstrationError, match="nowhere: no such file"):
        read_demonstrations(tmp_path / "nowhere", TASK)
