"""LeRobotDataset v3: Parquet files of frames with their metadata, a directory.

    meta/info.json                              version, features, frames per second, totals
    meta/stats.json                             statistics of every feature
    meta/tasks.parquet                          task descriptions by number
    meta/episodes/chunk-000/file-000.parquet    length and place of every episode
    data/chunk-000/file-000.parquet             frames, a row group per episode

The robot's attributes are `observation.state`, those of all others and of goals `observation.environment_state`, each
number named after its attribute. A row holds an action too: at an episode's last frame, where nothing is done any more,
the one before is repeated, and a reader leaves it out.

Source: the layout as LeRobot's own writer produces it (codebase version v3.0).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import Json, parse_json
from roboscribe.io.directories import building
from roboscribe.io.episodes import UNREADABLE, damaged, groups_of
from roboscribe.io.formats.foreign import (
    ACTION,
    SNAPSHOT,
    Contents,
    Field,
    Format,
    Recording,
    Shown,
    Source,
    actions_of,
    component_names,
    snapshots_of,
)
from roboscribe.io.formats.statistics import Statistics
from roboscribe.io.formats.tables import EPISODE, FRAME, TIME, is_numeric, lengths_in, recordings_of
from roboscribe.io.frames import whole_numbers
from roboscribe.world import Trajectory
from roboscribe.world.layout import FloatArray

VERSION = "v3.0"
STATE = "observation.state"
ENVIRONMENT = "observation.environment_state"
_NUMBERING = {TIME: "float32", FRAME: "int64", EPISODE: "int64", "index": "int64", "task_index": "int64"}
"""Features that every dataset has."""
_FRAMES_PER_FILE_BYTES = 100 << 20
_FILES_PER_CHUNK = 1000
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"


@dataclass(frozen=True)
class _Dataset:
    """An open dataset."""

    contents: Contents
    _root: Path

    def recordings(self, columns: Sequence[str]) -> Iterator[Recording]:
        """Read columns of every episode."""
        wanted = list(dict.fromkeys((EPISODE, FRAME, TIME, *columns)))
        yield from recordings_of(
            _tables(self._root, wanted), columns,
            episode=EPISODE, lengths=self.contents.lengths, frequency=self.contents.frequency, source=str(self._root),
        )  # fmt: skip


@contextmanager
def open_lerobot(path: Path, episode: str | None = None) -> Iterator[Source]:
    """Open a dataset; `episode` is not asked for, the layout has one name for it.

    Raises:
        DemonstrationError: there is no dataset, or one of another version, or its parts do not fit together.
    """
    info = _info(path)
    features, rate = info.get("features"), info.get("fps")
    if not isinstance(features, dict) or not isinstance(rate, int | float) or rate <= 0:
        msg = f"{path}/meta/info.json: features and fps: found {features!r:.60} and {rate!r}, expected both"
        raise DemonstrationError(msg)
    lengths = lengths_in(_tables(path, [EPISODE]), EPISODE, str(path))
    _check_totals(path, info, lengths)
    yield _Dataset(Contents(_fields(path, features), lengths, float(rate)), path)


def write_lerobot(path: Path, shown: Shown) -> None:
    """Write demonstrations as a dataset.

    Raises:
        ArtifactError: the directory exists, or the system refused the write.
    """
    with building(path) as root:
        for folder in ("meta/episodes/chunk-000", "data"):
            (root / folder).mkdir(parents=True)
        features = _features(shown)
        statistics = {name: Statistics() for name in features}
        rows = _write_frames(root, shown, features, statistics)
        pq.write_table(pa.Table.from_pylist(rows), root / _EPISODES, write_page_checksum=True)
        _write_tasks(root, shown.header.task_name)
        _write_json(root / "meta/stats.json", {name: found.summary() for name, found in statistics.items()})
        _write_json(root / "meta/info.json", _described(shown, features))


def _info(path: Path) -> dict[str, Json]:
    """Read what a dataset says about itself."""
    place = path / "meta" / "info.json"
    if not place.is_file():
        msg = f"{path}: no meta/info.json, expected the directory of a LeRobot dataset"
        raise DemonstrationError(msg)
    try:
        info = parse_json(place.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        msg = f"{place}: not JSON ({error})"
        raise DemonstrationError(msg) from error
    version = info.get("codebase_version") if isinstance(info, dict) else None
    if not isinstance(info, dict) or not str(version).startswith("v3."):
        advice = "; LeRobot's convert_dataset_v21_to_v30 converts older ones" if str(version).startswith("v2") else ""
        msg = f"{place}: codebase_version: found {version}, expected {VERSION}{advice}"
        raise DemonstrationError(msg)
    return dict(info)


def _check_totals(path: Path, info: dict[str, Json], lengths: Sequence[int]) -> None:
    """Refuse a dataset whose files hold other episodes than its metadata says."""
    for key, found in (("total_episodes", len(lengths)), ("total_frames", sum(lengths))):
        if info.get(key) != found:
            msg = f"{path}: {key}: found {found} in data/, meta/info.json says {info.get(key)}"
            raise DemonstrationError(msg)
    places = sorted((path / "meta" / "episodes").glob("*/*.parquet"))
    stated = [length for place in places for length in _lengths(place)]
    if places and stated != list(lengths):
        odd = next((i for i, pair in enumerate(zip(stated, lengths, strict=False)) if pair[0] != pair[1]), len(lengths))
        msg = f"{path}: episode {odd}: data/ holds other frames than meta/episodes says"
        raise DemonstrationError(msg)


def _tables(path: Path, columns: Sequence[str]) -> Iterator[pa.Table]:
    """Read columns of all data files, a row group at a time; those that a file lacks are left out."""
    places = sorted((path / "data").glob("*/*.parquet"))
    if not places:
        msg = f"{path}: no data/*/*.parquet, expected the frames of a LeRobot dataset"
        raise DemonstrationError(msg)
    for place in places:
        try:
            with pq.ParquetFile(place, page_checksum_verification=True) as file:
                lacking = {*columns} - {*file.schema_arrow.names} - {FRAME, TIME}
                if lacking:
                    msg = f"{place}: missing column {', '.join(sorted(lacking))}"
                    raise DemonstrationError(msg)
                yield from groups_of(file, [name for name in columns if name in file.schema_arrow.names])
        except UNREADABLE as error:
            raise damaged(str(place), error) from error


def _lengths(place: Path) -> list[int]:
    """Read how many frames each episode of a file of meta/episodes has."""
    try:
        table = pq.read_table(place, columns=["length"], page_checksum_verification=True)
    except UNREADABLE as error:
        raise damaged(str(place), error) from error
    if "length" not in table.column_names:
        msg = f"{place}: missing column length"
        raise DemonstrationError(msg)
    return [int(length) for length in whole_numbers(table, "length", str(place))]


def _fields(path: Path, features: dict[str, Json]) -> tuple[Field, ...]:
    """List the features that are numbers and lie in the data files."""
    place = next(iter(sorted((path / "data").glob("*/*.parquet"))))
    try:
        schema = pq.read_schema(place)
    except UNREADABLE as error:
        raise damaged(str(place), error) from error
    elsewhere = {name for name, feature in features.items() if isinstance(feature, dict) and _is_video(feature)}
    odd = sorted({*schema.names} ^ ({*features} - elsewhere))
    if odd:
        msg = f"{path}: feature {', '.join(odd)}: found in only one of data/ and meta/info.json, expected in both"
        raise DemonstrationError(msg)
    stored = {name: feature for name, feature in features.items() if isinstance(feature, dict) and name in schema.names}
    numeric = (name for name in stored if is_numeric(schema.field(name).type) and name not in _NUMBERING)
    return tuple(_field(name, stored[name]) for name in numeric)


def _is_video(feature: dict[str, Json]) -> bool:
    """Whether a feature lies in files of its own."""
    return feature.get("dtype") == "video"


def _field(name: str, feature: dict[str, Json]) -> Field:
    """Describe one feature; names of its numbers may be a list, or a list in a dictionary."""
    shape, names = feature.get("shape"), feature.get("names")
    sizes = [size for size in shape if isinstance(size, int)] if isinstance(shape, list) else []
    if isinstance(names, dict) and len(names) == 1:
        names = next(iter(names.values()))
    width = int(np.prod(sizes)) if sizes else 1
    given = tuple(map(str, names)) if isinstance(names, list) else ()
    return Field(name, width, given if len(given) == width else ())


def _features(shown: Shown) -> dict[str, Json]:
    """Describe the features of demonstrations."""
    robot = [name for column in shown.columns if not column.of_entity for name in component_names(column)]
    others = [name for column in shown.columns if column.of_entity for name in component_names(column)]
    action = [f"action[{i}]" for i in range(shown.task.action_size)]
    features = {name: _feature("float64", names) for name, names in ((STATE, robot), (ENVIRONMENT, others)) if names}
    if shown.actions:
        features[ACTION] = _feature("float64", action)
    if shown.snapshot_size:
        features[SNAPSHOT] = _feature("float64", [f"snapshot[{i}]" for i in range(shown.snapshot_size)])
    numbering: dict[str, Json] = {
        name: {"dtype": kind, "shape": [1], "names": None} for name, kind in _NUMBERING.items()
    }
    return features | numbering


def _feature(kind: str, names: list[str]) -> Json:
    """Describe one feature."""
    return {"dtype": kind, "shape": [len(names)], "names": names}


def _described(shown: Shown, features: dict[str, Json]) -> dict[str, Json]:
    """Return the content of meta/info.json."""
    lengths, frequency = shown.header.lengths, shown.header.frequency
    return {
        "codebase_version": VERSION, "robot_type": shown.header.layout.robot.name,
        "total_episodes": len(lengths), "total_frames": sum(lengths), "total_tasks": 1,
        "chunks_size": _FILES_PER_CHUNK, "data_files_size_in_mb": _FRAMES_PER_FILE_BYTES >> 20,
        "video_files_size_in_mb": 200,
        "fps": int(frequency) if frequency == int(frequency) else frequency,
        "splits": {"train": f"0:{len(lengths)}"},
        "data_path": _DATA, "video_path": None, "features": features,
    }  # fmt: skip


def _write_frames(
    root: Path, shown: Shown, features: dict[str, Json], statistics: dict[str, Statistics]
) -> list[dict[str, Json]]:
    """Write the data files; returns a row of meta/episodes for each episode."""
    schema = pa.schema([_arrow(name, feature) for name, feature in features.items()])
    per_frame = sum(field.type.list_size if pa.types.is_fixed_size_list(field.type) else 1 for field in schema) * 8
    rows: list[dict[str, Json]] = []
    writer: pq.ParquetWriter | None = None
    start, file, held = 0, 0, 0
    try:
        for number, trajectory in enumerate(shown.trajectories()):
            if held and (held + len(trajectory)) * per_frame > _FRAMES_PER_FILE_BYTES and writer is not None:
                writer.close()
                writer, file, held = None, file + 1, 0
            chunk, index = divmod(file, _FILES_PER_CHUNK)
            if writer is None:
                target = root / _DATA.format(chunk_index=chunk, file_index=index)
                target.parent.mkdir(exist_ok=True)
                writer = pq.ParquetWriter(target, schema, compression="snappy", write_page_checksum=True)
            values = _values(trajectory, number, start, shown)
            arrays = [_array(values[field.name], field.type) for field in schema]
            writer.write_table(pa.table(arrays, schema=schema), row_group_size=len(trajectory))
            counted = ((name, statistics[name].add(values[name])) for name in features)
            found = {f"stats/{name}/{key}": value for name, them in counted for key, value in them.items()}
            stop = start + len(trajectory)
            place = {"data/chunk_index": chunk, "data/file_index": index}
            rows.append(_episode_row(number, shown, start, stop) | place | found)
            start, held = stop, held + len(trajectory)
    finally:
        if writer is not None:
            writer.close()
    return rows


def _episode_row(number: int, shown: Shown, start: int, stop: int) -> dict[str, Json]:
    """Return what meta/episodes says of an episode and the rows that it has in the whole dataset."""
    return {
        "episode_index": number, "tasks": [shown.header.task_name], "length": stop - start,
        "dataset_from_index": start, "dataset_to_index": stop,
        "meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0,
    }  # fmt: skip


def _arrow(name: str, feature: Json) -> pa.Field:
    """Return the column of a feature."""
    assert isinstance(feature, dict)
    shape = feature["shape"]
    assert isinstance(shape, list)
    kind = {"float64": pa.float64(), "float32": pa.float32(), "int64": pa.int64()}[str(feature["dtype"])]
    return pa.field(name, kind if shape == [1] else pa.list_(kind, shape[0]))


def _array(values: FloatArray, kind: pa.DataType) -> pa.Array:
    """Store rows (n, w) as a column."""
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), kind.list_size)
    return pa.array(values[:, 0]).cast(kind)


def _values(trajectory: Trajectory, number: int, start: int, shown: Shown) -> dict[str, FloatArray]:
    """Return the values of one episode by feature, each (n, w)."""
    length = len(trajectory)
    frames = np.arange(length, dtype=np.float64)[:, None]
    robot = [column.place for column in shown.columns if not column.of_entity]
    others = [column.place for column in shown.columns if column.of_entity]
    values = {
        TIME: frames / shown.header.frequency, FRAME: frames, "index": frames + start,
        EPISODE: np.full((length, 1), float(number)), "task_index": np.zeros((length, 1)),
        ACTION: _actions(trajectory, shown.task.action_size), SNAPSHOT: snapshots_of(trajectory, shown.snapshot_size),
    }  # fmt: skip
    for name, places in ((STATE, robot), (ENVIRONMENT, others)):
        if places:
            values[name] = np.concatenate([trajectory.states[:, place] for place in places], axis=1)
    return values


def _actions(trajectory: Trajectory, size: int) -> FloatArray:
    """Return an action for every frame (T + 1, A); NaN throughout where none are known."""
    actions = actions_of(trajectory, size)
    last = actions[-1:] if len(actions) else np.full((1, size), np.nan)
    return np.concatenate([actions, last])


def _write_tasks(root: Path, description: str) -> None:
    """Write the one task's description, as pandas writes a frame with an index."""
    import pandas as pd

    index = pd.Index([description], name="task")
    pd.DataFrame({"task_index": [0]}, index=index).to_parquet(root / "meta" / "tasks.parquet")


def _write_json(path: Path, value: Json) -> None:
    """Write JSON for human readers; keys keep their order, which names the columns."""
    import json

    path.write_text(json.dumps(value, indent=4, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


FORMAT = Format(
    name="lerobot",
    spelling="a directory with meta/info.json (LeRobotDataset v3)",
    directory=True,
    least_frames=1,
    open=open_lerobot,
    write=write_lerobot,
)
