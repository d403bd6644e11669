"""Minari's dataset: `data/metadata.json` and `data/main_data.hdf5` in a directory.

    metadata.json             dataset_id, spaces, totals
    main_data.hdf5
      episode_0               attributes: id, total_steps (T)
        observations          (T + 1, w), or a group of such datasets
        actions (T, A)        rewards, terminations, truncations (T,)
        infos                 a group of datasets, optional

An attribute is an observation of its own, named as in our files; a simulator state is `infos/snapshot`. Minari wants
actions: where none are known they are NaN throughout an episode. The frequency, for which it has no place, is an entry
of its own in metadata.json. To list a dataset with `minari list`, put the directory where Minari keeps them.

Source: Minari's own storage (0.5).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import Json
from roboscribe.io.directories import building
from roboscribe.io.formats import hdf5
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
    named_parts,
    snapshots_of,
)
from roboscribe.world import Trajectory

if TYPE_CHECKING:
    import h5py

_VERSION = "0.5.0"
_DATA = "main_data.hdf5"
_METADATA = "metadata.json"
_EPISODE = "episode_"
_OBSERVATIONS = "observations"
_BY_STEP = ("rewards", "terminations", "truncations")
_NAME = re.compile(r"[-\w]+-v\d+")


@dataclass(frozen=True)
class _Episode:
    """One group: its number, where it lies, its datasets by path and its count of steps."""

    number: int
    where: str
    datasets: dict[str, h5py.Dataset]
    steps: int


@dataclass(frozen=True)
class _Dataset:
    """An open dataset."""

    contents: Contents
    _episodes: tuple[_Episode, ...]

    def recordings(self, columns: Sequence[str]) -> Iterator[Recording]:
        """Read columns of every episode."""
        for episode in self._episodes:
            paths = {name: path for path in episode.datasets if (name := _public(path)) in columns}
            yield {
                name: hdf5.read(episode.datasets[path], f"{episode.where}, column {path}")
                for name, path in paths.items()
            }


@contextmanager
def open_minari(path: Path, episode: str | None = None) -> Iterator[Source]:
    """Open a dataset, by its directory or the one called `data` in it; `episode` is not asked for.

    Raises:
        DemonstrationError: there is no dataset, it is stored otherwise, or it is damaged.
    """
    root = path / "data" if (path / "data" / _METADATA).is_file() else path
    metadata = _metadata(root)
    with hdf5.opened(root / _DATA) as file:
        found = hdf5.groups(file, str(root / _DATA))
        names = hdf5.numbered(found, _EPISODE)
        episodes = tuple(_episode(found[name], number, root / _DATA) for number, name in enumerate(names))
        if not episodes or len(episodes) != metadata.get("total_episodes"):
            msg = f"{root}: found {len(episodes)} episodes, {_METADATA} says {metadata.get('total_episodes')}"
            raise DemonstrationError(msg)
        rate = metadata.get("frequency")
        frequency = float(rate) if isinstance(rate, int | float) and rate > 0 else None
        lengths = tuple(episode.steps + 1 for episode in episodes)
        yield _Dataset(Contents(_fields(episodes), lengths, frequency), episodes)


def write_minari(path: Path, shown: Shown) -> None:
    """Write demonstrations as a dataset.

    Raises:
        ArtifactError: the directory exists, or the system refused the write.
    """
    with building(path) as root:
        data = root / "data"
        data.mkdir()
        with hdf5.created(data / _DATA) as file:
            for number, trajectory in enumerate(shown.trajectories()):
                _write_episode(file.create_group(f"{_EPISODE}{number}"), number, trajectory, shown)
        size = (data / _DATA).stat().st_size
        (data / _METADATA).write_text(json.dumps(_described(path, shown, size)), encoding="utf-8")


def _write_episode(group: h5py.Group, number: int, trajectory: Trajectory, shown: Shown) -> None:
    """Write one episode."""
    steps = len(trajectory) - 1
    group.attrs.update({"id": number, "total_steps": steps})
    for column, values in named_parts(trajectory):
        hdf5.store(group.require_group(_OBSERVATIONS), column.name, values)
    hdf5.store(group, "actions", actions_of(trajectory, shown.task.action_size))
    reached = np.asarray(shown.task.solved(trajectory.states[1:]), dtype=np.bool_)
    ends = np.arange(steps) == steps - 1
    hdf5.store(group, "rewards", reached.astype(np.float64))
    hdf5.store(group, "terminations", ends & reached)
    hdf5.store(group, "truncations", ends & ~reached)
    if shown.snapshot_size:
        hdf5.store(group.require_group("infos"), SNAPSHOT, snapshots_of(trajectory, shown.snapshot_size))


def _described(path: Path, shown: Shown, size: int) -> dict[str, Json]:
    """Return the content of metadata.json."""
    safe = re.sub(r"[^-\w]", "-", shown.header.task_name)
    name = path.name if _NAME.fullmatch(path.name) else f"{safe}-v0"
    observations = {"type": "Dict", "subspaces": {c.name: _box(c.attribute.width) for c in shown.columns}}
    lengths = shown.header.lengths
    return {
        "total_episodes": len(lengths), "total_steps": sum(length - 1 for length in lengths), "data_format": "hdf5",
        "observation_space": json.dumps(observations),
        "action_space": json.dumps(_box(shown.task.action_size, 1.0)),
        "dataset_id": name, "minari_version": _VERSION, "algorithm_name": shown.header.generator,
        "dataset_size": round(size / 1e6, 1), "frequency": shown.header.frequency,
    }  # fmt: skip


def _box(size: int, bound: float = float("inf")) -> Json:
    """Describe a space of numbers as Minari spells it, infinite bounds included."""
    return {"type": "Box", "dtype": "float64", "shape": [size], "low": [-bound] * size, "high": [bound] * size}


def _metadata(root: Path) -> dict[str, Json]:
    """Read metadata.json; its bounds may be infinite, which strict JSON does not have."""
    place = root / _METADATA
    if not place.is_file():
        msg = f"{root}: no {_METADATA}, expected the directory of a Minari dataset"
        raise DemonstrationError(msg)
    try:
        metadata = json.loads(place.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        msg = f"{place}: not JSON ({error})"
        raise DemonstrationError(msg) from error
    stored = metadata.get("data_format", "hdf5") if isinstance(metadata, dict) else None
    if not isinstance(metadata, dict) or stored != "hdf5":
        msg = f"{place}: data_format: found {stored}, expected hdf5"
        raise DemonstrationError(msg)
    return metadata


def _episode(group: h5py.Group, number: int, path: Path) -> _Episode:
    """Look at one episode, and compare the lengths of what it holds."""
    where = f"{path}: episode {number}"
    found = hdf5.datasets(group, where)
    lengths = {key: hdf5.rows(dataset, where) for key, dataset in found.items()}
    observed = [length for key, length in lengths.items() if _is_observation(key)]
    if not observed or observed[0] < 1:
        msg = f"{where}: no observations of numbers"
        raise DemonstrationError(msg)
    steps = observed[0] - 1
    for key, length in lengths.items():
        wanted = steps + 1 if _is_observation(key) else steps
        if length != wanted and not key.startswith("infos/"):
            msg = f"{where}, column {key}: found {length} rows, expected {wanted}"
            raise DemonstrationError(msg)
    kept = {key: dataset for key, dataset in found.items() if not key.startswith("infos/") or lengths[key] == steps + 1}
    return _Episode(number, where, kept, steps)


def _is_observation(key: str) -> bool:
    """Whether a dataset is an observation."""
    return key == _OBSERVATIONS or key.startswith(f"{_OBSERVATIONS}/")


def _public(path: str) -> str:
    """Name a dataset as a column."""
    names = {"actions": ACTION, f"infos/{SNAPSHOT}": SNAPSHOT}
    return names.get(path, path.removeprefix(f"{_OBSERVATIONS}/"))


def _fields(episodes: Sequence[_Episode]) -> tuple[Field, ...]:
    """List observations, infos and actions of all episodes."""
    found: dict[str, Field] = {}
    for episode in episodes:
        for path, dataset in episode.datasets.items():
            if path not in _BY_STEP and _public(path) not in found:
                found[_public(path)] = Field(_public(path), hdf5.width(dataset, episode.where))
    return tuple(found.values())


FORMAT = Format(
    name="minari",
    spelling="a directory with data/metadata.json and data/main_data.hdf5 (Minari)",
    directory=True,
    least_frames=1,
    open=open_minari,
    write=write_minari,
)
