"""Our file, another format, our file again: what comes back is what went out, to the last bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roboscribe.io import read_demonstrations, sha256_of
from roboscribe.io.formats.provenance import place_of
from roboscribe.io.formats.table import FORMATS
from roboscribe.io.formats.transfer import export, format_of, ingest
from roboscribe.world import Trajectory
from tests.io.examples import B1, G2, TASK, carried, same, write

NAMES = {"lerobot": "demos", "robomimic": "demos.hdf5", "minari": "demos-v0", "csv": "demos.csv", "npz": "demos.npz"}


def there_and_back(tmp_path: Path, kind: str, trajectories: list[Trajectory]) -> Path:
    """Export demonstrations, read them in again, and return our new file."""
    ours, foreign, again = write(tmp_path / "ours.parquet", trajectories), tmp_path / NAMES[kind], tmp_path / "again"
    export(ours, TASK, FORMATS[kind], foreign)
    assert format_of(foreign) is FORMATS[kind]
    ingest(foreign, TASK, FORMATS[kind], None, again)
    return again


@pytest.mark.parametrize("kind", FORMATS)
def test_the_file_that_comes_back_is_the_file_that_went_out(tmp_path: Path, kind: str) -> None:
    trajectories = [carried(0), carried(1, length=5), carried(2, length=30)]
    again = there_and_back(tmp_path, kind, trajectories)
    assert same(read_demonstrations(again, TASK).trajectories, trajectories)
    assert sha256_of(again) == sha256_of(tmp_path / "ours.parquet")


@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_not_given_stays_so(tmp_path: Path, kind: str) -> None:
    bare = replace(carried(0), actions=None, snapshots=None)
    without_goal = carried(1)
    without_goal.states[:, G2] = np.nan
    without_snapshots = replace(carried(2), snapshots=None)
    trajectories = [bare, without_goal, without_snapshots]
    again = there_and_back(tmp_path, kind, trajectories)
    assert same(read_demonstrations(again, TASK).trajectories, trajectories)


@pytest.mark.parametrize("kind", FORMATS)
def test_states_alone_come_back(tmp_path: Path, kind: str) -> None:
    trajectories = [replace(carried(seed), actions=None, snapshots=None) for seed in range(2)]
    again = there_and_back(tmp_path, kind, trajectories)
    assert same(read_demonstrations(again, TASK).trajectories, trajectories)
    assert sha256_of(again) == sha256_of(tmp_path / "ours.parquet")


@pytest.mark.parametrize("kind", FORMATS)
def test_episodes_that_a_format_cannot_hold_are_left_out_and_named(tmp_path: Path, kind: str) -> None:
    empty = replace(carried(0), states=carried(0).states[:0], actions=None, snapshots=None)
    one = replace(carried(1, length=1), actions=None)
    ours = write(tmp_path / "ours.parquet", [empty, carried(2), one, carried(3)])
    done = export(ours, TASK, FORMATS[kind], tmp_path / NAMES[kind])
    gone = "0, 2" if kind == "robomimic" else "0"
    assert done.remarks == (f"{kind} cannot hold episode {gone} (too few frames); left out, others move up",)
    ingest(tmp_path / NAMES[kind], TASK, FORMATS[kind], None, tmp_path / "again")
    kept = [carried(2), carried(3)] if kind == "robomimic" else [carried(2), one, carried(3)]
    assert same(read_demonstrations(tmp_path / "again", TASK).trajectories, kept)


@pytest.mark.parametrize("kind", FORMATS)
def test_without_its_provenance_a_file_is_read_with_a_remark(tmp_path: Path, kind: str) -> None:
    there_and_back(tmp_path, kind, [carried(0), carried(1)])
    foreign = tmp_path / NAMES[kind]
    place_of(foreign).unlink()
    done = ingest(foreign, TASK, FORMATS[kind], None, tmp_path / "more")
    assert done.remarks == (f"{foreign}: nothing guards it against damage, no {place_of(foreign).name} is there",)
    assert same(read_demonstrations(tmp_path / "more", TASK).trajectories, [carried(0), carried(1)])


EPISODES = st.tuples(st.integers(1, 9), st.floats(-2.0, 2.0, width=64), st.booleans(), st.booleans())


@given(st.lists(EPISODES, min_size=1, max_size=4), st.sampled_from(list(FORMATS)))
@settings(max_examples=15, deadline=None)
def test_any_numbers_come_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, drawn: list[tuple[int, float, bool, bool]], kind: str
) -> None:
    tmp_path = tmp_path_factory.mktemp("trip")
    trajectories = []
    for seed, (length, value, actions, snapshots) in enumerate(drawn):
        trajectory = carried(seed, length=length + 1, actions=actions)
        trajectory.states[:, B1] = value
        trajectory.states[-1, B1.start] = -0.0
        trajectories.append(trajectory if snapshots else replace(trajectory, snapshots=None))
    again = there_and_back(tmp_path, kind, trajectories)
    assert same(read_demonstrations(again, TASK).trajectories, trajectories)
