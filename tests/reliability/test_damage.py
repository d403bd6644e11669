"""Row 6 for every kind of file that is read: damage is refused, undone or without effect, never believed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from roboscribe.errors import RoboScribeError
from roboscribe.io import load_program, read_demonstrations, write_files
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import save_program
from roboscribe.rl.checkpoint import read_checkpoint, write_checkpoint
from roboscribe.stages.runtime.journal import Journal, read_records
from roboscribe.stages.runtime.store import MANIFEST, Store
from roboscribe.stages.tracking.mlflow_store import STATE, open_sync
from tests.conftest import Figure, effort
from tests.io.examples import TASK, carried, write
from tests.pipelines.stores import empty_store, points
from tests.reliability.test_artifact_faults import PROGRAM
from tests.reliability.test_demonstration_faults import flipped
from tests.reliability.test_tracking import CURVE, expected, tell, tracker
from tests.stages.test_store import Config, Counting

Read = Callable[[], object]


def damages(data: bytes, rng: np.random.Generator, flips: int, cuts: int) -> Iterator[bytes]:
    """Flip single bits and cut ends off, at random places."""
    for bit in rng.choice(8 * len(data), min(flips, 8 * len(data)), replace=False):
        yield flipped(data, int(bit))
    for size in rng.choice(len(data), min(cuts, len(data)), replace=False):
        yield data[: int(size)]


def withstands(path: Path, read: Read, sound: object) -> tuple[int, int]:
    """Damage a file again and again; returns how often that was refused or without effect, and how often it was tried.

    Whatever else is raised than a typed error of one line fails the test, as it would be a traceback to a user.
    """
    data, held, tried = path.read_bytes(), 0, 0
    for damaged in damages(data, np.random.default_rng(0), effort(60, 2000), effort(20, 200)):
        write_files({path: damaged})
        tried += 1
        try:
            held += read() == sound
        except RoboScribeError as error:
            held += "\n" not in str(error)
    path.write_bytes(data)
    assert read() == sound
    return held, tried


def test_row_6_demonstrations(tmp_path: Path, figure: Figure) -> None:
    path = write(tmp_path / "demos.parquet", [carried(seed, length=12) for seed in range(5)])

    def read() -> object:
        return [each.states.tobytes() for each in read_demonstrations(path, TASK).trajectories]

    figure("demonstrations", *withstands(path, read, read()))


@pytest.mark.parametrize("name", ["tree.json", "controllers.safetensors", "manifest.json", "program.txt"])
def test_row_6_saved_programs(tmp_path: Path, name: str, figure: Figure) -> None:
    """A program's text may be edited, and whoever reads it is told that it was."""
    save_program(tmp_path, PROGRAM)

    def read() -> object:
        found = load_program(tmp_path)
        weights = {name: array.tobytes() for name, array in found.weights.items()}
        told = (found.tree, weights, found.controllers, found.manifest)
        return told if found.edited else (found.program_text, *told)

    sound = read()
    assert isinstance(sound, tuple)
    seen: list[object] = []

    def readable() -> object:
        found = read()
        assert isinstance(found, tuple)
        seen.append(found)
        return (sound[0], *found) if len(found) < len(sound) else found

    figure(name, *withstands(tmp_path / name, readable, sound))


def test_row_6_checkpoints(tmp_path: Path, figure: Figure) -> None:
    path = tmp_path / "at.progress.safetensors"
    rng = np.random.default_rng(0)
    write_checkpoint(
        path, {"actor/0.weight": rng.normal(size=(8, 4)), "env": np.arange(7)}, {"seed": 3, "success": 0.5}
    )

    def read() -> object:
        found, notes = read_checkpoint(path, {"seed": 3})
        return {name: (array.dtype, array.shape, array.tobytes()) for name, array in found.items()}, notes

    figure("checkpoints", *withstands(path, read, read()))


@pytest.mark.parametrize("name", [MANIFEST, "product.txt"])
def test_row_6_stages(tmp_path: Path, name: str, figure: Figure) -> None:
    """What is damaged is computed again."""
    (tmp_path / "number.txt").write_text("21")

    def read() -> object:
        out = Store(tmp_path / "store").run(Counting().stage, Config(), {"number": tmp_path / "number.txt"})
        return (out / "product.txt").read_text()

    sound = read()
    (path,) = (tmp_path / "store").rglob(name)
    figure(f"stage outputs, {name}", *withstands(path, read, sound))


def test_row_6_journals(tmp_path: Path, figure: Figure) -> None:
    """Records before the damage are as they were; those behind it are told again when the run goes on."""
    path = tmp_path / "journal.jsonl"
    told: list[dict[str, Json]] = [
        {"run": "", "kind": "metric", "key": f"k{i}", "value": i / 7, "step": i} for i in range(12)
    ]

    def tell_all() -> object:
        journal = Journal(path, ("run", "kind", "key", "step"))
        for record in told:
            journal.append(record)
        return [{k: v for k, v in record.items() if k != "time"} for _, record in read_records(path)]

    sound = tell_all()
    assert sound == told
    figure("journals", *withstands(path, tell_all, sound))


def test_row_6_how_far_a_journal_is_copied(tmp_path: Path, figure: Figure) -> None:
    """Where that is not known everything is copied again, which changes nothing."""
    empty_store(tmp_path / "mlruns")
    tell(tracker(tmp_path), range(5))
    open_sync(tmp_path / "runs" / "abc", tmp_path / "mlruns").copy()
    path = tmp_path / "runs" / "abc" / STATE
    data, rng = path.read_bytes(), np.random.default_rng(0)
    assert json.loads(data)["offset"] > 0
    held, tried = 0, 0
    for damaged in damages(data, rng, effort(4, 40), effort(2, 10)):
        path.write_bytes(damaged)
        open_sync(tmp_path / "runs" / "abc", tmp_path / "mlruns").copy()
        held += points(tmp_path / "mlruns", CURVE) == expected(range(5))
        tried += 1
    figure("copying states", held, tried)
