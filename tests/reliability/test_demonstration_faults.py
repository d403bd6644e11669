"""Faults in demonstration files: reliability rows 6 to 12."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from roboscribe.errors import DemonstrationError, Fail
from roboscribe.io import Screened, read_demonstrations, screen
from roboscribe.world import Layout
from tests.io.examples import BOX, ROBOT, TASK, carried, mapped, replaced, rewrite, same, write

Change = Callable[[pa.Table], pa.Table]
GOOD = [carried(seed, length=12) for seed in range(5)]
ROW = 2 * 12 + 4
"""Row of episode 2, frame 4."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "demos.parquet", GOOD)


def refuse(path: Path, message: str) -> None:
    """Expect one typed error that names the file."""
    with pytest.raises(DemonstrationError, match=f"^{re.escape(str(path))}: {message}"):
        read_demonstrations(path, TASK)


def flipped(data: bytes, bit: int) -> bytes:
    """Flip one bit."""
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def test_row_6_a_truncated_file_is_refused(path: Path) -> None:
    data = path.read_bytes()
    for size in {*range(0, len(data), len(data) // 80), *range(len(data) - 60, len(data))}:
        path.write_bytes(data[:size])
        refuse(path, "damaged")


def test_row_6_every_flipped_bit_is_seen(path: Path) -> None:
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    for bit in rng.choice(8 * len(data), 300, replace=False):
        path.write_bytes(flipped(data, int(bit)))
        refuse(path, "damaged")


def test_row_6_flips_in_the_seal_and_at_both_ends_are_seen(path: Path) -> None:
    data = path.read_bytes()
    footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    for byte in (*range(4), *range(footer - 96, footer + 4), *range(len(data) - 8, len(data))):
        path.write_bytes(flipped(data, 8 * byte + byte % 8))
        refuse(path, "damaged")


def test_row_6_other_damage_is_seen(path: Path) -> None:
    data = path.read_bytes()
    half = len(data) // 2
    for damaged in (data + b"\0", b"\0" + data, data + data, data[:half] + bytes(64) + data[half + 64 :], data[::-1]):
        path.write_bytes(damaged)
        refuse(path, "damaged")


def test_row_6_the_damaged_episode_is_named(path: Path) -> None:
    data = path.read_bytes()
    for episode in range(len(GOOD)):
        chunk = pq.ParquetFile(path).metadata.row_group(episode).column(5)
        end = chunk.data_page_offset + chunk.total_compressed_size
        path.write_bytes(flipped(data, 8 * (end - 20)))
        refuse(path, f"damaged in episode {episode} since it was written")
        path.write_bytes(data)


def test_row_6_flips_in_a_file_without_a_seal_never_change_a_value_silently(path: Path) -> None:
    data = rewrite(path, lambda table: table).read_bytes()
    footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    refused = 0
    for bit in np.random.default_rng(0).choice(8 * footer, 200, replace=False):
        path.write_bytes(flipped(data, int(bit)))
        try:
            found = read_demonstrations(path, TASK)
        except DemonstrationError:
            refused += 1
        else:
            assert same(found.trajectories, GOOD)
    assert refused > 150


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_row_7_nan_and_infinity_are_located(path: Path, value: float) -> None:
    def put(part: int) -> Callable[[int, Any], object]:
        return lambda row, old: [*old[:part], value, *old[part + 1 :]] if row == ROW else old

    data = path.read_bytes()
    for column, name in (("b1.position", "b1.position.y"), ("g(b2).position", r"g\(b2\).position.y")):
        rewrite(path, partial(mapped, column=column, change=put(1)))
        refuse(path, rf"episode 2, frame 4, column {name}: found {value:g}, expected a finite number")
        path.write_bytes(data)
    rewrite(path, lambda table: mapped(table, "mu.opening", lambda row, old: value if row == ROW else old))
    refuse(path, rf"episode 2, frame 4, column mu.opening: found {value:g}, expected a finite number")
    path.write_bytes(data)
    rewrite(path, lambda table: mapped(table, "action", put(2)))
    refuse(path, rf"episode 2, frame 4, column action\[2\]: found {value:g}, expected a number from -1 to 1")


def test_row_7_a_goal_that_is_nan_throughout_an_episode_is_no_missing_goal(path: Path) -> None:
    nothing = [np.nan] * 3
    rewrite(path, lambda t: mapped(t, "g(b1).position", lambda row, old: nothing if 24 <= row < 36 else old))
    refuse(path, r"episode 2, frame 0, column g\(b1\).position.x: found nan")


def without_metadata(table: pa.Table) -> pa.Table:
    return table.replace_schema_metadata(None)


def stating(key: str, value: str) -> Change:
    """State another value in the metadata."""
    return lambda table: table.replace_schema_metadata(
        {**table.schema.metadata, f"roboscribe.{key}".encode(): value.encode()}
    )


def in_unit(column: str, unit: str) -> Change:
    """State another unit for a column."""

    def change(table: pa.Table) -> pa.Table:
        place = table.column_names.index(column)
        field = table.schema.field(column).with_metadata({"unit": unit})
        return table.set_column(place, field, table.column(column))

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.drop_columns("b2.position"), r"missing column b2.position: found episode_index, .*, expected epi"),
        (lambda t: t.drop_columns(["action", "g(b1).position"]), r"missing column g\(b1\).position, action: found "),
        (lambda t: t.drop_columns("timestamp"), r"missing column timestamp: found "),
        (lambda t: t.drop_columns("snapshot"), r"missing column snapshot: found "),
        (lambda t: t.append_column("action", t["action"]), r"column action: found it more than once, expected it once"),
        (lambda t: replaced(t, "mu.opening", ["0"] * 60, pa.string()), r"column mu.opening: found string, expected fl"),
        (
            lambda t: replaced(t, "mu.opening", [0] * 60, pa.int64()),
            r"column mu.opening: found int64, expected floating",
        ),
        (
            lambda t: replaced(t, "b1.position", [0.0] * 60, pa.float64()),
            r"column b1.position: found double, expected lists of 3",
        ),
        (
            lambda t: replaced(t, "b1.tilt", [[0.0]] * 60, pa.list_(pa.float64())),
            r"column b1.tilt: found list<.*, expected floating",
        ),
        (
            lambda t: replaced(t, "action", [["a"]] * 60, pa.list_(pa.string())),
            r"column action: found list<.*, expected lists of 4",
        ),
        (
            lambda t: replaced(t, "episode_index", [0.0] * 60, pa.float64()),
            r"column episode_index: found double, expected whole",
        ),
        (
            lambda t: replaced(t, "frame_index", [None] * 60),
            r"column frame_index: found int64 with nulls, expected whole",
        ),
        (
            lambda t: mapped(t, "b1.position", lambda i, v: v[:2] if i == ROW else v),
            r"episode 2, frame 4, column b1.position: found a list of 2, expected lists of 3",
        ),
        (
            lambda t: mapped(t, "action", lambda i, v: v and [*v, 0.0]),
            r"episode 0, frame 0, column action: found a list of 5, ex",
        ),
        (stating("schema_version", "2"), r"metadata roboscribe.schema_version: found 2, expected 1$"),
        (without_metadata, r"metadata roboscribe.schema_version: found none, expected 1$"),
        (stating("task", "stack-2"), r"metadata roboscribe.task: found stack-2, expected carry-2$"),
        (stating("frequency", "50.0"), r"metadata roboscribe.frequency: found 50.0, expected 25.0 frames per second"),
        (stating("frequency", "often"), r"metadata roboscribe.frequency: found often, expected 25.0 frames per second"),
        (stating("objects", "[]"), r"metadata roboscribe.objects: found \[\], expected a JSON object"),
    ],
)
def test_row_8_wrong_columns_and_metadata_say_found_and_expected(path: Path, change: Change, message: str) -> None:
    refuse(rewrite(path, change), message)


def test_row_8_other_objects_are_refused(path: Path) -> None:
    one_box = replace(TASK, layout=Layout(ROBOT, (BOX,)))
    with pytest.raises(DemonstrationError, match=r"object b2: found \{.*\}, expected none"):
        read_demonstrations(path, one_box)
    three_boxes = replace(TASK, layout=Layout(ROBOT, (BOX, BOX, BOX)))
    with pytest.raises(DemonstrationError, match=r'object b3: found none, expected \{.*"unit":"m".*\}'):
        read_demonstrations(path, three_boxes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: mapped(t, "b1.position", lambda _, v: [1000 * x for x in v]),
            r"episode 0, frame 0, column b1.position.\w: found .*, expected -2 to 2 m \(is it in millimetres\?\)",
        ),
        (
            lambda t: mapped(t, "b1.tilt", lambda i, v: 57.3 if i == ROW else v),
            r"episode 2, frame 4, column b1.tilt: found 57.3, expected -4 to 4 rad \(is it in degrees\?\)",
        ),
        (
            lambda t: mapped(t, "b2.orientation", lambda i, v: [0.7, 0.7, 0.7, 0.7] if i == ROW else v),
            r"episode 2, frame 4, column b2.orientation: found norm 1.4, expected 1",
        ),
        (
            lambda t: mapped(t, "action", lambda i, v: [0.0, 1.5, 0.0, 0.0] if i == ROW else v),
            r"episode 2, frame 4, column action\[1\]: found 1.5, expected a number from -1 to 1",
        ),
        (in_unit("b1.position", "mm"), r"column b1.position: unit: found mm, expected m$"),
        (in_unit("timestamp", "ms"), r"column timestamp: unit: found ms, expected s$"),
    ],
)
def test_row_9_values_that_cannot_be_right_name_the_column(path: Path, change: Change, message: str) -> None:
    refuse(rewrite(path, change), message)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: mapped(t, "timestamp", lambda i, v: v + 0.03 if i == ROW else v),
            r"episode 2, frame 4, column timestamp: found 0.19 s after the first frame, expected 0.16 s",
        ),
        (
            lambda t: mapped(t, "timestamp", lambda i, v: float("nan") if i == ROW else v),
            r"episode 2, frame 4, column timestamp: found nan",
        ),
        (
            lambda t: mapped(t, "frame_index", lambda i, v: v + 1 if i == ROW else v),
            r"episode 2, frame 5, column frame_index: found 5, expected 4",
        ),
        (
            lambda t: pa.concat_tables([t[:ROW], t[ROW + 1 :]]),
            r"episode 2, frame 5, column frame_index: found 5, expected 4",
        ),
        (
            lambda t: pa.concat_tables([t, t[:12]]),
            r"episode 0, frame 0, column episode_index: out of order in row 60, expected asc",
        ),
        (
            lambda t: mapped(t, "episode_index", lambda _, v: v - 1),
            r"episode -1, frame 0, column episode_index: out of order in row 0",
        ),
        (
            lambda t: mapped(t, "episode_index", lambda _, v: v + 10**12),
            r"episode 10+, frame 0, column episode_index: out of order",
        ),
        (
            lambda t: mapped(t, "action", lambda i, v: None if i == ROW else v),
            r"episode 2, frame 4, column action: found no value, expected an action as in the episode's other frames",
        ),
        (
            lambda t: mapped(t, "action", lambda _, v: v or [0.0] * 4),
            r"episode 0, frame 11, column action: found an action, expected none at the last frame",
        ),
        (
            lambda t: mapped(t, "snapshot", lambda i, v: None if i == ROW else v),
            r"episode 2, frame 4, column snapshot: found no value",
        ),
        (
            lambda t: mapped(t, "g(b1).position", lambda i, v: None if i == ROW else v),
            r"episode 2, frame 4, column g\(b1\).position: found no value",
        ),
        (
            lambda t: mapped(t, "mu.position", lambda i, v: None if i // 12 == 2 else v),
            r"episode 2, frame 0, column mu.position.x: found nan",
        ),
    ],
)
def test_frames_that_are_not_one_after_the_other_are_located(path: Path, change: Change, message: str) -> None:
    refuse(rewrite(path, change), message)


def test_row_10_flawed_demonstrations_are_reported_and_left_out(path: Path) -> None:
    empty = replace(GOOD[0], states=GOOD[0].states[:0], actions=None, snapshots=None)
    write(path, [GOOD[0], empty, carried(8, reach=0.5), GOOD[1], carried(9, length=1), GOOD[0], empty])
    found = screen(TASK, read_demonstrations(path, TASK).trajectories)
    assert isinstance(found, Screened)
    assert same(found.kept, GOOD[:2])
    assert [line.removesuffix("; left out") for line in found.report] == [
        "episode 1: empty",
        "episode 2: never reaches the goal",
        "episode 4: one frame only",
        "episode 5: duplicate of episode 0",
        "episode 6: empty",
    ]


def test_row_10_too_few_left_is_an_error(path: Path) -> None:
    trajectories = read_demonstrations(write(path, [GOOD[0], GOOD[0]]), TASK).trajectories
    with pytest.raises(DemonstrationError, match="1 usable demonstrations of carry-2 found, expected at least 2"):
        screen(TASK, trajectories)


@pytest.mark.parametrize(
    ("columns", "reason"),
    [
        (["g(b2).position"], "goals disagree: g(b2).position is given in only one of episodes 0 and 3"),
        (
            ["b2.position", "b2.orientation", "b2.tilt", "g(b2).position"],
            "object counts disagree: episode 3 has no b2, the task has",
        ),
    ],
)
def test_row_11_objects_and_goals_that_disagree_fail_with_the_reason(
    path: Path, columns: list[str], reason: str
) -> None:
    def change(table: pa.Table) -> pa.Table:
        for column in columns:
            table = mapped(table, column, lambda row, old: None if row // 12 == 3 else old)
        return table

    trajectories = read_demonstrations(rewrite(path, change), TASK).trajectories
    assert screen(TASK, trajectories) == Fail(reason)


def test_row_12_demonstrations_that_never_reach_the_goal_fail_with_the_reason(path: Path) -> None:
    trajectories = read_demonstrations(write(path, [carried(seed, reach=0.9) for seed in range(4)]), TASK).trajectories
    assert screen(TASK, trajectories) == Fail("none of the 4 demonstrations of carry-2 ever reaches the goal")


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1PAR1", b"PK\x03\x04" + bytes(100), b"a,b\n1,2\n" * 50])
def test_what_is_not_parquet_is_refused(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    refuse(path, "damaged, or not Parquet")
