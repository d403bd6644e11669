"""Robomimic's HDF5: a file with a group per demonstration.

    data                attributes: total (count of actions), env_args (JSON with env_name, type, env_kwargs)
    data/demo_0         attribute: num_samples, the count N of actions
      actions (N, A)    rewards (N,), dones (N,), states (N, S)
      obs/KEY (N, w)    before each action
      next_obs/KEY      after it

An attribute is an observation of its own, named as in our files. The state after the last action is the last row of
`next_obs`; our last simulator state, for which the format has no place, is the dataset `final_state`. The frequency is
where robosuite has it, `control_freq` of env_kwargs. Without actions there is no dataset of them.

Source: robomimic's documentation of datasets.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import replacing
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
    named_parts,
)
from roboscribe.world import Trajectory
from roboscribe.world.layout import FloatArray

if TYPE_CHECKING:
    import h5py

_PREFIX = "demo_"
_GYM = 2
"""Robomimic's number for environments of Gym."""
_FINAL = "final_state"


@dataclass(frozen=True)
class _Demo:
    """One group: its number, where it lies, and its datasets by path."""

    number: int
    where: str
    datasets: dict[str, h5py.Dataset]
    samples: int

    @property
    def length(self) -> int:
        """Count of frames: one more than actions where the state after the last one is known."""
        return self.samples + any(name.startswith("next_obs/") for name in self.datasets)


@dataclass(frozen=True)
class _File:
    """An open file."""

    contents: Contents
    _demos: tuple[_Demo, ...]

    def recordings(self, columns: Sequence[str]) -> Iterator[Recording]:
        """Read columns of every demonstration."""
        for demo in self._demos:
            yield {name: values for name in columns if (values := _column(demo, name)) is not None}


@contextmanager
def open_robomimic(path: Path, episode: str | None = None) -> Iterator[Source]:
    """Open a file; `episode` is not asked for, demonstrations are groups.

    Raises:
        DemonstrationError: the file is damaged, or holds no demonstrations.
    """
    with hdf5.opened(path) as file:
        data = hdf5.child(file, "data", str(path))
        found = hdf5.groups(data, f"{path}: data")
        names = hdf5.numbered(found, _PREFIX)
        demos = tuple(_demo(found[name], number, name, path) for number, name in enumerate(names))
        if not demos:
            msg = f"{path}: data: no group {_PREFIX}0, expected a group for each demonstration"
            raise DemonstrationError(msg)
        lengths = tuple(demo.length for demo in demos)
        yield _File(Contents(_fields(demos), lengths, _frequency(data, path)), demos)


def write_robomimic(path: Path, shown: Shown) -> None:
    """Write demonstrations as one file; each must have an action's worth of frames.

    Raises:
        ArtifactError: the system refused the write.
    """
    with replacing(path) as hidden, hdf5.created(hidden) as file:
        data = file.create_group("data")
        for number, trajectory in enumerate(shown.trajectories()):
            _write_demo(data.create_group(f"{_PREFIX}{number}"), trajectory, shown)
        data.attrs["total"] = sum(length - 1 for length in shown.header.lengths)
        environment = {
            "env_name": shown.header.task_name, "type": _GYM, "env_type": _GYM,
            "env_kwargs": {"control_freq": shown.header.frequency},
        }  # fmt: skip
        data.attrs["env_args"] = json.dumps(environment)


def _write_demo(group: h5py.Group, trajectory: Trajectory, shown: Shown) -> None:
    """Write one demonstration."""
    samples = len(trajectory) - 1
    group.attrs["num_samples"] = samples
    for column, values in named_parts(trajectory):
        hdf5.store(group.require_group("obs"), column.name, values[:-1])
        hdf5.store(group.require_group("next_obs"), column.name, values[1:])
    reached = np.asarray(shown.task.solved(trajectory.states[1:]), dtype=np.float64)
    hdf5.store(group, "rewards", reached)
    hdf5.store(group, "dones", np.append(np.zeros(samples - 1), 1.0))
    if trajectory.actions is not None:
        hdf5.store(group, "actions", trajectory.actions)
    states = np.zeros((samples, 0)) if trajectory.snapshots is None else trajectory.snapshots[:-1]
    hdf5.store(group, "states", states)
    if trajectory.snapshots is not None:
        hdf5.store(group, _FINAL, trajectory.snapshots[-1:])


def _demo(group: h5py.Group, number: int, name: str, path: Path) -> _Demo:
    """Look at one demonstration, and compare the lengths of what it holds."""
    where = f"{path}: episode {number} ({name})"
    found = hdf5.datasets(group, where)
    stated = hdf5.attribute(group, "num_samples", where)
    lengths = [hdf5.rows(dataset, where) for key, dataset in found.items() if key.startswith("obs/")]
    if not lengths:
        msg = f"{where}: no observations of numbers in obs/"
        raise DemonstrationError(msg)
    samples = int(stated) if isinstance(stated, int | np.integer) else lengths[0]
    for key, dataset in found.items():
        length = hdf5.rows(dataset, where)
        if key != _FINAL and length != samples:
            msg = f"{where}, column {key}: found {length} rows, expected {samples} (num_samples)"
            raise DemonstrationError(msg)
    return _Demo(number, where, found, samples)


def _fields(demos: Sequence[_Demo]) -> tuple[Field, ...]:
    """List observations, actions and simulator states of all demonstrations."""
    found: dict[str, Field] = {}
    for demo in demos:
        for key in sorted(demo.datasets, key=_observations_first):
            partial = key == "states" and _FINAL not in demo.datasets
            if not (partial or key == _FINAL or key.startswith("next_obs/")):
                found.setdefault(_public(key), Field(_public(key), hdf5.width(demo.datasets[key], demo.where)))
    return tuple(found.values())


def _observations_first(key: str) -> tuple[bool, str]:
    """Sort observations before anything else."""
    return not key.startswith("obs/"), key


def _public(key: str) -> str:
    """Name a dataset as a column."""
    return {"actions": ACTION, "states": SNAPSHOT}.get(key, key.removeprefix("obs/"))


def _column(demo: _Demo, name: str) -> FloatArray | None:
    """Read one column; None where this demonstration has none."""
    if name == ACTION:
        return _read(demo, "actions")
    if name == SNAPSHOT:
        return _joined(_read(demo, "states"), _read(demo, _FINAL)) if _FINAL in demo.datasets else None
    if f"obs/{name}" not in demo.datasets:
        return _read(demo, name)
    after = _read(demo, f"next_obs/{name}")
    return _joined(_read(demo, f"obs/{name}"), None if after is None else after[-1:])


def _joined(values: FloatArray | None, last: FloatArray | None) -> FloatArray | None:
    """Append the last frame."""
    if values is None or last is None:
        return values
    return np.concatenate([values, last])


def _read(demo: _Demo, key: str) -> FloatArray | None:
    """Read a dataset; None where there is none."""
    dataset = demo.datasets.get(key)
    return None if dataset is None else hdf5.read(dataset, f"{demo.where}, column {key}")


def _frequency(data: h5py.Group, path: Path) -> float | None:
    """Return the frequency that the environment's arguments state."""
    text = hdf5.attribute(data, "env_args", f"{path}: data")
    try:
        arguments = json.loads(text) if isinstance(text, str) else {}
        frequency = arguments["env_kwargs"]["control_freq"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return float(frequency) if isinstance(frequency, int | float) and frequency > 0 else None


FORMAT = Format(
    name="robomimic",
    spelling="an HDF5 file with the group data/demo_0 (robomimic)",
    directory=False,
    least_frames=2,
    open=open_robomimic,
    write=write_robomimic,
)
