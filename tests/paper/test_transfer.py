"""A saved program is measured elsewhere; the report puts what was found beside the paper's figures."""

from __future__ import annotations

import io
import math
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import SavedProgram, save_program
from roboscribe.stages import transfer
from roboscribe.stages.paper.report import About, report_files
from roboscribe.stages.paper.towers import Measurement, draw, report, summarise, tabulate
from roboscribe.stages.paper.values import RENN, TASKS, paper_success
from roboscribe.stages.runtime.files import OUTCOME, read_json
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.store import Store
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.success_rate import wilson

ABOUT: dict[str, Json] = {"task": "tower-2", "profile": "actions", "seed": 0, "figures": {}}


def test_the_paper_s_figures() -> None:
    """Those that its text repeats, the ends of each row, and nothing beyond."""
    assert (paper_success(4, "tower-5"), paper_success(4, "tower-6")) == (0.55, 0.15)
    assert (paper_success(5, "tower-7"), paper_success(5, "pyramid-9")) == (0.13, 0.34)
    assert (paper_success(4, "tower-7"), paper_success(4, "multitower-4")) == (0.0, 0.88)
    for trained, task in ((4, "tower-8"), (4, "tower-3"), (6, "tower-5"), (4, "pick-place-4"), (5, "tower-2")):
        assert paper_success(trained, task) is None
    assert len(TASKS) == 16
    assert {"tower-4", "tower-7", "multitower-4", "multitower-9", "pyramid-4", "pyramid-9"} <= set(TASKS)
    assert not {"tower-8", "pyramid-3", "multitower-10"} & set(TASKS)
    assert paper_success(4, "tower-5", RENN) == pytest.approx(0.013)
    for task in TASKS:
        assert TaskConfig(task).make().horizon == 50 * int(task.rpartition("-")[2])


def test_an_idle_program_builds_no_tower(tmp_path: Path) -> None:
    """It runs in the physics of a tower, for as long as the task gives it, and is found in the store again."""
    save_program(tmp_path / "idle", SavedProgram("def P(μ : EE):\n  skip\n", {}, {}, {}, ABOUT))
    config = transfer.Config(TaskConfig("tower-2"), seed=1, evaluation_episodes=2)
    store, told = Store(tmp_path / "store"), list[Progress]()
    out = store.run(transfer.STAGE, config, transfer.inputs_of(tmp_path / "idle"), told.append)
    figures = read_json(out / OUTCOME)
    assert (figures["successes"], figures["episodes"]) == (0, 2)
    count = len(told)
    assert count > 0
    assert store.run(transfer.STAGE, config, transfer.inputs_of(tmp_path / "idle"), told.append) == out
    assert len(told) == count


def test_files_of_two_programs_do_not_mix(tmp_path: Path) -> None:
    trees: dict[str, dict[str, Json]] = {"one": {}, "two": {"nodes": []}}
    for name, tree in trees.items():
        save_program(tmp_path / name, SavedProgram("def P(μ : EE):\n  skip\n", tree, {}, {}, ABOUT))
    inputs = {**transfer.inputs_of(tmp_path / "one"), "tree": tmp_path / "two" / "tree.json"}
    with pytest.raises(ArtifactError, match=r"tree\.json: was changed"):
        transfer.run(transfer.Config(TaskConfig("tower-2"), evaluation_episodes=1), inputs, tmp_path)


def measurement(trained: int, seed: int, contact: str, task: str, successes: int) -> Measurement:
    """Say that a program succeeded so often of 100."""
    low, high = wilson(successes, 100)
    figures = {"successes": successes, "episodes": 100, "success": successes / 100, "control_steps": 7, "diverged": 0}
    return Measurement(trained, seed, contact, task, {**figures, "ci_low": low, "ci_high": high})


@pytest.fixture
def table() -> pd.DataFrame:
    """Two programs in two tasks and contact models, another in a task that the paper does not have."""
    counts = {("stable", "tower-5"): (90, 70), ("paper", "tower-5"): (50, 60), ("stable", "pyramid-4"): (100, 100)}
    two = [measurement(4, s, c, t, given[s]) for (c, t), given in counts.items() for s in (0, 1)]
    return tabulate([*two, measurement(2, 5, "stable", "tower-3", 0)])


def test_a_row_per_measurement(table: pd.DataFrame) -> None:
    found = pd.read_csv(io.BytesIO(report_files(report(table, quick=False), About("towers"))["towers.csv"]))
    assert list(found) == [
        "trained", "method", "seed", "contact", "task", "successes", "episodes", "success", "ci_low", "ci_high",
        "control_steps", "paper", "renn", "timing", "quick", "commit",
    ]  # fmt: skip
    first, last = found.iloc[0], found.iloc[-1]
    assert (first["trained"], first["seed"], first["contact"], first["task"]) == (4, 0, "stable", "tower-5")
    assert (first["successes"], first["success"], first["paper"]) == (90, 0.9, 0.55)
    assert (first["ci_low"], first["ci_high"]) == pytest.approx(wilson(90, 100))
    assert math.isnan(last["paper"])
    assert len(found) == 7


def test_the_summary_is_a_mean_over_programs(table: pd.DataFrame) -> None:
    lines = summarise(table).splitlines()
    assert "| trained on | method | task | stable contact | paper contact | paper | ReNN |" in lines
    assert "| tower-4 | roboscribe | tower-5 | 80.0 (70.0 to 90.0) | 55.0 (50.0 to 60.0) | 55.0 | 1.3 |" in lines
    assert "| tower-4 | roboscribe | pyramid-4 | 100.0 (100.0 to 100.0) | - | 90.0 | 62.0 |" in lines
    assert "| tower-2 | roboscribe | tower-3 | 0.0 | - | - | - |" in lines
    assert lines[0].endswith("seeds 0, 1, 5; 100 episodes each.")


def test_the_picture_shows_the_figures(table: pd.DataFrame) -> None:
    """It is a picture, the same each time, and another one for other figures."""
    made = draw(table)
    assert Image.open(io.BytesIO(made["towers.png"])).format == "PNG"
    assert made["towers.svg"].startswith(b"<?xml")
    assert draw(table) == made
    for other in (table.assign(success=table["success"] * 0.5, ci_low=0.0), table.assign(paper=table["paper"] * 0.5)):
        changed = draw(other)
        assert changed["towers.png"] != made["towers.png"]
        assert changed["towers.svg"] != made["towers.svg"]
