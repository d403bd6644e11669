"""Files as other programs lay them out, written here by hand from their documentation."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from roboscribe.errors import DemonstrationError
from roboscribe.io import read_demonstrations
from roboscribe.io.columns import columns_of
from roboscribe.io.formats import csv_file
from roboscribe.io.formats.table import FORMATS
from roboscribe.io.formats.transfer import export, format_of, ingest
from roboscribe.world import Trajectory
from tests.io.examples import LAYOUT, TASK, carried, same, write

SHOWN = [carried(0, length=6), carried(1, length=4)]
STATES = [Trajectory(LAYOUT, t.states, t.actions) for t in SHOWN]
MAPPING = "frequency = 25\n[columns]\naction = 'action'\n" + "".join(
    f"{json.dumps(c.name)} = 'state[{c.place.start}:{c.place.stop}]'\n" for c in columns_of(LAYOUT)
)


def read_in(path: Path, kind: str, tmp_path: Path) -> tuple[Trajectory, ...]:
    """Read a file by the mapping above."""
    mapping, out = tmp_path / "map.toml", tmp_path / "out.parquet"
    mapping.write_text(MAPPING)
    ingest(path, TASK, FORMATS[kind], mapping, out)
    return read_demonstrations(out, TASK).trajectories


def robomimic_file(path: Path, *, after: bool) -> Path:
    """Write a file as robomimic's scripts do: old layout, images beside states, masks."""
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "type": 1, "env_kwargs": {"control_freq": 20}})
        for number, shown in enumerate(SHOWN):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["num_samples"] = len(shown) - after
            demo["obs/state"] = shown.states[:-1] if after else shown.states
            demo["obs/image"] = np.zeros((len(shown) - after, 8, 8, 3), np.uint8)
            if after:
                demo["next_obs/state"] = shown.states[1:]
            assert shown.actions is not None
            demo["actions"] = shown.actions if after else np.concatenate([shown.actions, shown.actions[-1:]])
        file["mask/train"] = np.array([b"demo_0"])
    return path


@pytest.mark.parametrize("after", [True, False])
def test_robomimic_with_and_without_next_observations(tmp_path: Path, after: bool) -> None:
    assert same(read_in(robomimic_file(tmp_path / "a.hdf5", after=after), "robomimic", tmp_path), STATES)


def test_robomimics_demonstrations_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    path = robomimic_file(tmp_path / "a.hdf5", after=True)
    with h5py.File(path, "a") as file:
        file.move("data/demo_0", "data/demo_10")
        file.move("data/demo_1", "data/demo_9")
    assert same(read_in(path, "robomimic", tmp_path), STATES[::-1])


def shorten(file: h5py.File) -> None:
    del file["data/demo_1/actions"]
    file["data/demo_1/actions"] = np.zeros((2, 4))


def link_elsewhere(file: h5py.File) -> None:
    del file["data/demo_0/obs/state"]
    file["data/demo_0/obs/state"] = h5py.ExternalLink("/etc/passwd", "x")


def leave_unwritten(file: h5py.File) -> None:
    del file["data/demo_1/obs/state"]
    file["data/demo_1/obs"].create_dataset("state", shape=(3, 26), dtype="f8", chunks=(1, 26))


def rename(file: h5py.File) -> None:
    file.move("data", "demos")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (shorten, r"episode 1 \(demo_1\), column actions: found 2 rows, expected 3 \(num_samples\)"),
        (link_elsewhere, r"episode 0 \(demo_0\): state is a link to another place"),
        (leave_unwritten, r"episode 1 \(demo_1\), column obs/state: damaged, or never written as a whole"),
        (rename, "no group data"),
    ],
)
def test_what_is_wrong_with_a_robomimic_file_is_located(
    tmp_path: Path, change: Callable[[h5py.File], None], message: str
) -> None:
    path = robomimic_file(tmp_path / "a.hdf5", after=True)
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(DemonstrationError, match=rf"^{path}: (data: )?{message}"):
        read_in(path, "robomimic", tmp_path)


def minari_directory(root: Path, **metadata: object) -> Path:
    """Write a dataset as Minari does: groups of observations, per-step arrays, no frequency."""
    (root / "data").mkdir(parents=True)
    with h5py.File(root / "data" / "main_data.hdf5", "w") as file:
        for number, shown in enumerate(SHOWN):
            episode = file.create_group(f"episode_{number}")
            episode.attrs.update({"id": number, "total_steps": len(shown) - 1})
            episode["observations/nested/state"] = shown.states
            episode["actions"] = shown.actions
            episode["rewards"] = np.zeros(len(shown) - 1)
            episode["infos/note"] = np.zeros((2, 2))
    stated = {"total_episodes": 2, "total_steps": 8, "data_format": "hdf5", "dataset_id": "x-v0"} | metadata
    (root / "data" / "metadata.json").write_text(json.dumps(stated))
    return root


def test_minari_by_either_directory(tmp_path: Path) -> None:
    root = minari_directory(tmp_path / "x-v0")
    assert format_of(root) is format_of(root / "data") is FORMATS["minari"]
    mapping = tmp_path / "map.toml"
    mapping.write_text(MAPPING.replace("'state[", "'nested/state["))
    for path in (root, root / "data"):
        ingest(path, TASK, FORMATS["minari"], mapping, tmp_path / "out")
        assert same(read_demonstrations(tmp_path / "out", TASK).trajectories, STATES)


@pytest.mark.parametrize(
    ("metadata", "message"),
    [({"data_format": "arrow"}, "found arrow, expected hdf5"), ({"total_episodes": 3}, "found 2 episodes, .* says 3")],
)
def test_minari_stored_otherwise_is_refused(tmp_path: Path, metadata: dict[str, object], message: str) -> None:
    with pytest.raises(DemonstrationError, match=message):
        read_in(minari_directory(tmp_path / "x-v0", **metadata), "minari", tmp_path)


def lerobot_directory(root: Path, change: Callable[[dict[str, object]], object] = lambda info: None) -> Path:
    """Write a dataset as LeRobot does: single precision, several files, a video that lies elsewhere."""
    frames = []
    for number, shown in enumerate(SHOWN):
        assert shown.actions is not None
        actions = np.concatenate([shown.actions, shown.actions[-1:]])
        columns = {
            "state": list(shown.states.astype(np.float32)), "action": list(actions.astype(np.float32)),
            "timestamp": np.arange(len(shown), dtype=np.float32) / 25, "frame_index": range(len(shown)),
            "episode_index": number, "index": range(len(shown)), "task_index": 0,
        }  # fmt: skip
        frames.append(pd.DataFrame(columns))
    for place, frame in enumerate(frames):
        folder = root / "data" / f"chunk-{place:03d}"
        folder.mkdir(parents=True)
        pq.write_table(pa.Table.from_pandas(frame), folder / "file-000.parquet")
    numbers = {name: {"dtype": "int64", "shape": [1], "names": None} for name in frames[0].columns[2:]}
    info: dict[str, object] = {
        "codebase_version": "v3.0", "fps": 25, "total_episodes": 2, "total_frames": 10,
        "features": numbers | {
            "state": {"dtype": "float32", "shape": [26], "names": {"motors": [f"m{i}" for i in range(26)]}},
            "action": {"dtype": "float32", "shape": [4], "names": None},
            "observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "names": None},
        },
    }  # fmt: skip
    change(info)
    (root / "meta").mkdir()
    (root / "meta" / "info.json").write_text(json.dumps(info))
    return root


def test_lerobot_in_single_precision_and_several_files(tmp_path: Path) -> None:
    found = read_in(lerobot_directory(tmp_path / "set"), "lerobot", tmp_path)
    for there, shown in zip(found, STATES, strict=True):
        np.testing.assert_array_equal(there.states, shown.states.astype(np.float32))
        assert there.actions is not None
        assert there.actions.shape == (len(shown) - 1, 4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"codebase_version": "v2.1"}, "found v2.1, expected v3.0; LeRobot's convert_dataset_v21_to_v30 converts"),
        ({"total_frames": 11}, "total_frames: found 10 in data/, meta/info.json says 11"),
        ({"total_episodes": 3}, "total_episodes: found 2 in data/, meta/info.json says 3"),
        ({"fps": 0}, "features and fps"),
        ({"fps": 50}, r"episode 0, frame 2, column timestamp: found 0.08 s after the first frame, expected 0.04 s|fr"),
        ({"features": {}}, "found in only one of data/ and meta/info.json"),
    ],
)
def test_what_is_wrong_with_a_lerobot_dataset_is_said(tmp_path: Path, change: dict[str, object], message: str) -> None:
    with pytest.raises(DemonstrationError, match=message):
        read_in(lerobot_directory(tmp_path / "set", lambda info: info.update(change)), "lerobot", tmp_path)


def csv_text(tmp_path: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Path:
    """Export demonstrations as text and change them with pandas."""
    path = tmp_path / "demos.csv"
    export(write(tmp_path / "ours.parquet", STATES), TASK, FORMATS["csv"], path)
    change(pd.read_csv(path)).to_csv(path, index=False)
    path.with_name("demos.csv.roboscribe.json").unlink()
    return path


def test_text_that_pandas_wrote_is_read(tmp_path: Path) -> None:
    path = csv_text(tmp_path, lambda frame: frame[frame.columns[::-1]].assign(note="a, b"))
    ingest(path, TASK, FORMATS["csv"], None, tmp_path / "out")
    found = read_demonstrations(tmp_path / "out", TASK).trajectories
    np.testing.assert_allclose(found[1].states, STATES[1].states, atol=1e-12)


def test_a_first_row_without_others_holds_no_demonstrations(tmp_path: Path) -> None:
    path = csv_text(tmp_path, lambda frame: frame.head(0).drop(columns="episode_index"))
    with pytest.raises(DemonstrationError, match=r"demos\.csv"):
        ingest(path, TASK, FORMATS["csv"], None, tmp_path / "out")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.astype({"b1.tilt": object}).assign(**{"b1.tilt": ["x" if i == 7 else 0 for i in range(10)]}),
         "demos.csv: .*b1.tilt"),
        (lambda f: f.drop(index=3), "episode 0, frame 3, column frame_index: found 4, expected 3"),
        (lambda f: f.assign(timestamp=f["timestamp"] + 0.1 * (f.index == 8)),
         "episode 1, frame 2, column timestamp: found 0.18 s"),
        (lambda f: f.iloc[::-1], "column episode_index: out of order"),
        (lambda f: f.assign(**{"b1.position.y": [np.nan if i == 7 else 0 for i in range(10)]}),
         "episode 1, frame 1, column b1.position.y: found nan, expected a finite number"),
        (lambda f: f.drop(columns=["b1.position.y"]), '"b1.position": nothing is said of it'),
        (lambda f: f.assign(episode_index="first"), "column episode_index|no comma-separated values"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_text_is_located(
    tmp_path: Path, change: Callable[[pd.DataFrame], pd.DataFrame], message: str
) -> None:
    path = csv_text(tmp_path, change)
    with pytest.raises(DemonstrationError, match=message):
        ingest(path, TASK, FORMATS["csv"], None, tmp_path / "out")


def test_a_cell_that_is_no_number_is_located_far_down_a_file(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    rows = ["state,episode_index", *(f"{i},{i // 50}" for i in range(200_000))]
    rows[150_001] = "zero,3000"
    path.write_text("\n".join(rows))
    with csv_file.open_csv(path) as source, pytest.raises(DemonstrationError) as caught:
        list(source.recordings(["state"]))
    assert str(caught.value) == f"{path}: episode 3000, frame 0, column state: found 'zero', expected a number"


def test_one_recording_in_a_file_needs_no_episode_numbers(tmp_path: Path) -> None:
    path = tmp_path / "one.csv"
    pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, 4.0]}).to_csv(path, index=False)
    with csv_file.open_csv(path) as source:
        assert source.contents.lengths == (2,)
        (recording,) = source.recordings(["b"])
    np.testing.assert_array_equal(recording["b"], [[3.0], [4.0]])


def test_pickled_arrays_are_never_loaded(tmp_path: Path) -> None:
    path = tmp_path / "evil.npz"
    np.savez(path, goal=np.array([{"a": 1}], dtype=object), state=np.zeros((3, 2)))
    with FORMATS["npz"].open(path, None) as source:
        assert [field.name for field in source.contents.fields] == ["state"]
