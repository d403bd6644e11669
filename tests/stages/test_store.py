"""The store: finished stages are found, damaged ones done again, interrupted ones gone on with."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from time import sleep

import pytest

from roboscribe.errors import ArtifactError
from roboscribe.stages.runtime.progress import ProgressCallback
from roboscribe.stages.runtime.store import MANIFEST, METRICS, PROGRESS, Inputs, Stage, Store


@dataclass(frozen=True)
class Config:
    """What the stage multiplies with."""

    factor: int = 2


@dataclass(frozen=True)
class Holder:
    """Settings that name something with code."""

    part: object


class Counting:
    """A stage that multiplies the number in its input, and counts how often it was run."""

    def __init__(self, then: Callable[[Path], None] = lambda out: None) -> None:
        self.runs = 0
        self._then = then
        self.stage = Stage("multiply", Config, self._run)

    def _run(self, config: Config, inputs: Inputs, out: Path, report: ProgressCallback) -> None:
        self.runs += 1
        (out / "product.txt").write_text(str(config.factor * int(inputs["number"].read_text())))
        self._then(out)


@pytest.fixture
def number(tmp_path: Path) -> dict[str, Path]:
    (tmp_path / "number.txt").write_text("21")
    return {"number": tmp_path / "number.txt"}


def test_a_finished_stage_is_not_run_again(tmp_path: Path, number: dict[str, Path]) -> None:
    counting = Counting()
    first = Store(tmp_path / "store").run(counting.stage, Config(), number)
    second = Store(tmp_path / "store").run(counting.stage, Config(), number)
    assert first == second
    assert (second / "product.txt").read_text() == "42"
    assert counting.runs == 1


def test_settings_and_contents_of_inputs_decide(tmp_path: Path, number: dict[str, Path]) -> None:
    store, counting = Store(tmp_path / "store"), Counting()
    first = store.run(counting.stage, Config(), number)
    other = store.run(counting.stage, Config(3), number)
    moved = tmp_path / "elsewhere.txt"
    moved.write_text("21")
    same = store.run(counting.stage, Config(), {"number": moved})
    moved.write_text("5")
    changed = store.run(counting.stage, Config(), {"number": moved})
    assert [(out / "product.txt").read_text() for out in (first, other, same, changed)] == ["42", "63", "42", "10"]
    assert first == same
    assert counting.runs == 3


def test_code_that_settings_name_decides(tmp_path: Path, number: dict[str, Path]) -> None:
    """A task's code may lie anywhere; what was computed with other code is stale."""
    version = ["1"]

    @dataclass(frozen=True)
    class Named:
        name: str = "task"

        def code(self) -> str:
            return version[0]

    runs: list[Path] = []
    stage = Stage("count", Holder, lambda config, inputs, out, report: runs.append(out))
    first = Store(tmp_path / "store").run(stage, Holder(Named()), number)
    again = Store(tmp_path / "store").run(stage, Holder(Named()), number)
    version[0] = "2"
    other = Store(tmp_path / "store").run(stage, Holder(Named()), number)
    assert first == again != other
    assert len(runs) == 2


@pytest.mark.parametrize("damage", ["change", "delete", "link"])
def test_damaged_outputs_are_made_again(tmp_path: Path, number: dict[str, Path], damage: str) -> None:
    store, counting = Store(tmp_path / "store"), Counting()
    product = store.run(counting.stage, Config(), number) / "product.txt"
    product.unlink() if damage != "change" else product.write_text("43")
    if damage == "link":
        (tmp_path / "forged.txt").write_text("42")
        product.symlink_to(tmp_path / "forged.txt")
    store.run(counting.stage, Config(), number)
    assert product.read_text() == "42"
    assert not product.is_symlink()
    assert counting.runs == 2


def test_an_interrupted_stage_keeps_progress_and_metrics_only(tmp_path: Path, number: dict[str, Path]) -> None:
    def stop(out: Path) -> None:
        (out / PROGRESS).mkdir(exist_ok=True)
        (out / PROGRESS / "checkpoint").write_text("half")
        (out / METRICS).write_text("{}\n")
        (out / ".product.txt.0123.unfinished").write_text("torn")
        raise KeyboardInterrupt

    interrupted, seen = Counting(stop), []
    with pytest.raises(KeyboardInterrupt):
        Store(tmp_path / "store").run(interrupted.stage, Config(), number)
    again = Counting(lambda out: seen.extend(sorted(path.name for path in out.rglob("*"))))
    out = Store(tmp_path / "store").run(again.stage, Config(), number)
    assert seen == ["checkpoint", METRICS, "product.txt", PROGRESS]
    assert sorted(path.name for path in out.iterdir()) == [MANIFEST, METRICS, "product.txt", "timing.json"]
    assert set(json.loads((out / MANIFEST).read_text())["outputs"]) == {"product.txt"}


def test_a_torn_manifest_proves_nothing(tmp_path: Path, number: dict[str, Path]) -> None:
    store, counting = Store(tmp_path / "store"), Counting()
    out = store.run(counting.stage, Config(), number)
    whole = (out / MANIFEST).read_bytes()
    (out / MANIFEST).write_bytes(whole[: len(whole) // 2])
    store.run(counting.stage, Config(), number)
    assert counting.runs == 2
    assert (out / MANIFEST).read_bytes() == whole


def test_two_processes_share_one_run(tmp_path: Path, number: dict[str, Path]) -> None:
    def work() -> None:
        def note(out: Path) -> None:
            sleep(0.2)
            with (tmp_path / "runs").open("a") as file:
                file.write("run\n")

        Store(tmp_path / "store").run(Counting(note).stage, Config(), number)

    both = [get_context("fork").Process(target=work) for _ in range(2)]
    for process in both:
        process.start()
    for process in both:
        process.join(30)
    assert [process.exitcode for process in both] == [0, 0]
    assert (tmp_path / "runs").read_text() == "run\n"


def test_a_missing_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match=r"gone\.txt: cannot be read"):
        Store(tmp_path / "store").run(Counting().stage, Config(), {"number": tmp_path / "gone.txt"})


def test_put_finds_the_output_that_has_the_bytes(tmp_path: Path, number: dict[str, Path]) -> None:
    store = Store(tmp_path / "store")
    out = store.run(Counting().stage, Config(), number)
    assert store.put("product.txt", b"42") == out / "product.txt"
    other = store.put("other.txt", b"43")
    assert other.read_bytes() == b"43"
    other.write_bytes(b"damaged")
    assert Store(tmp_path / "store").put("other.txt", b"43").read_bytes() == b"43"
