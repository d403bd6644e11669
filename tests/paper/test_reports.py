"""Reports: a row per evaluation, tables and figures that agree with it, and what changed since the last run."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image

from roboscribe.stages.paper import confined, curves, demos, table1
from roboscribe.stages.paper.report import About, Report, report_files, spell_steps
from roboscribe.stages.paper.rows import (
    CELL_COLUMNS,
    COLUMNS,
    GIVEN_UP,
    NO_PROGRAM,
    EvaluationPoint,
    Record,
    Trial,
    rows_of,
    tabulate,
)
from roboscribe.stages.paper.since import COMMIT, changes, newest
from roboscribe.stages.paper.values import REPORTED
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.experiment import ChildRun, track_experiment
from roboscribe.success_rate import wilson
from tests.pipelines.stores import empty_store, points, statuses

ONE = "pick-place-1"


def record(rates: list[tuple[int, int]], last: int, *, ended: str = "", refinements: int | None = 2) -> Record:
    """Say that evaluations of 100 episodes found so many successes, and the last one of 500."""
    way = tuple(EvaluationPoint(steps, count, 100, 1.0) for steps, count in rates)
    end = EvaluationPoint(rates[-1][0] + 50 if rates else 0, last, 500, 2.0, final=True)
    return Record((*way, end), "actions", "ab" * 32, "c0", refinements, ended, "why" if ended == NO_PROGRAM else "")


def sample() -> pd.DataFrame:
    """Programs of two seeds, one of which found nothing; a clone; a learner that was given up."""
    ours = Trial(TaskConfig(ONE))
    rows = [
        *rows_of(ours, record([(1_000, 0), (60_000, 97)], 495)),
        *rows_of(replace(ours, seed=1), record([(1_000, 0)], 0, ended=NO_PROGRAM, refinements=None)),
        *rows_of(replace(ours, method="bc", profile=""), record([], 400, refinements=None)),
        *rows_of(replace(ours, method="gail"), record([(500_000, 0)], 0, ended=GIVEN_UP, refinements=None)),
        *rows_of(replace(ours, task=TaskConfig("tower-5")), record([(300_000, 50)], 250, refinements=5)),
    ]
    return tabulate(rows)


def made(report: Report, name: str) -> dict[str, bytes]:
    """Make the files of a report."""
    return report_files(report, About(name, f"roboscribe paper {name}", "c0", missing=("table-top",), since=("-",)))


def test_a_row_per_evaluation() -> None:
    table = sample()
    assert list(table) == list(COLUMNS)
    first, final = table.iloc[1], table.iloc[2]
    assert (first["control_steps"], first["successes"], first["episodes"], first["kind"]) == (
        60_000,
        97,
        100,
        "on the way",
    )
    assert (final["success"], final["episodes"], final["kind"], final["refinements"]) == (0.99, 500, "final", 2)
    assert (final["ci_low"], final["ci_high"]) == pytest.approx(wilson(495, 500), abs=1e-6)


def test_curves_table_and_figure_agree_with_the_rows() -> None:
    report = curves.report(sample(), (ONE, "table-top", "tower-5"), ("table-top",), quick=False)
    files = made(report, "curves")
    lines = files["curves.md"].decode().splitlines()
    each = "99.0, 0.0 (no program) | not reached"
    assert f"| pick-place-1 | roboscribe, actions | 0, 1 | 49.5 | 49.5 (0.0 to 99.0) | {each} | 98.0 |" in lines
    assert "| pick-place-1 | bc | 0 | 80.0 | 80.0 | 80.0 | - | 84.8 |" in lines
    assert "| pick-place-1 | gail | 0 | 0.0 | 0.0 | 0 up to 500k | not reached | 81.0 |" in lines
    assert "| tower-5 | roboscribe, actions | 0 | 50.0 | 50.0 | 50.0 | not reached | - |" in lines
    assert "- table-top: not built yet" in lines
    assert "| bc | 1 | 80.0 | 0.50 |" in lines
    assert set(files) == {"curves.csv", "curves.md", "curves.png", "curves.svg", "manifest.json"}
    assert Image.open(io.BytesIO(files["curves.png"])).format == "PNG"
    assert b"not built yet" in files["curves.svg"]
    assert pd.read_csv(io.BytesIO(files["curves.csv"]))["success"].tolist() == report.table["success"].tolist()


def test_pictures_show_what_changes_and_nothing_else() -> None:
    tasks, table = (ONE, "tower-5"), sample()
    before = curves.report(table, tasks, (), quick=False).pictures
    assert curves.report(table, tasks, (), quick=False).pictures == before
    changed = curves.report(table.assign(success=table["success"] / 2), tasks, (), quick=False).pictures
    assert all(changed[name] != picture for name, picture in before.items())
    assert b"quick: not a result" in curves.report(table, tasks, (), quick=True).pictures["curves.svg"]


def test_more_refinements_than_the_paper_are_named() -> None:
    report = table1.report(sample(), (ONE, "table-top", "tower-5"), ("table-top",), quick=False)
    assert "| pick-place-1 | roboscribe, actions | 0, 1 | 2.0 | 2, no program | 2.2 |  |" in report.text
    assert "| tower-5 | roboscribe, actions | 0 | 5.0 | 5 | 4.4 | more than the paper |" in report.text
    assert "| table-top | roboscribe | - | - | not built yet | 5.6 |  |" in report.text
    assert set(report.pictures) == {"table1.png", "table1.svg"}


def test_demonstration_sizes_stand_beside_the_paper_s() -> None:
    few = Trial(TaskConfig(ONE), n_demonstrations=10)
    rows = [*rows_of(few, record([(60_000, 97)], 495)), *rows_of(replace(few, style="slow"), record([(9_000, 3)], 20))]
    report = demos.report(tabulate(rows), (ONE,), (), quick=False)
    assert "| pick-place-1 | actions | 10 | default | 0% | 0 | 99.0 | 99.0 | 99.0 | 60k | 99.8 | 2.28M |" in report.text
    assert "| pick-place-1 | actions | 10 | slow | 0% | 0 | 4.0 | 4.0 | 4.0 | not reached | - | - |" in report.text
    assert set(report.pictures) == {"demos.png", "demos.svg"}


def test_guards_stand_beside_the_paper_s() -> None:
    low, high = wilson(40, 50)
    figures = {"successes": 40, "episodes": 50, "success": 0.8, "ci_low": low, "ci_high": high, "control_steps": 9}
    old = confined.Measurement(
        trained="push-3", task="push-confined-3", method="roboscribe", profile="actions", seed=0, way=confined.OLD,
        loop="while x", n_demonstrations=0, demonstrations="", contact="stable", timing="fast", quick=False,
        commit="c0", figures=figures, seconds=1.0,
    )  # fmt: skip
    new = replace(old, way=confined.NEW, loop="while y", figures={**figures, "success": 0.9}, n_demonstrations=10)
    report = confined.report(confined.tabulate([old, new]), quick=False)
    assert "| roboscribe | old guard | 0 | 80.0 | 80.0 | 80.0 | - |" in report.text
    assert "| roboscribe | new guard | 0 | 90.0 | 90.0 | 90.0 | 86.3 ± 0.5 |" in report.text
    assert "- seed 0, new guard: `while y`" in report.text


def test_the_paper_s_tasks() -> None:
    """Table 1 and the ends of the axes of Fig. 19, in the paper's order."""
    assert [task.refinements for task in REPORTED.values()] == [2.2, 2.2, 5.4, 4.4, 4.4, 5.6, 4.6]
    assert [task.axis / 1e6 for task in REPORTED.values()] == [4.0, 4.0, 6.0, 8.0, 16.7, 6.0, 18.5]
    for task in REPORTED.values():
        assert list(task.curve) == sorted(task.curve)


def test_steps_are_spelled() -> None:
    assert [spell_steps(steps) for steps in (68_400, 2_200_000, float("inf"))] == ["68k", "2.20M", "not reached"]


def tracked(home: Path, commit: str, table: pd.DataFrame, *, quick: bool = False) -> None:
    """Track a run of `paper curves`."""
    files = {"curves.csv": table.to_csv(index=False).encode()}
    directory = home / "data" / "runs" / f"run-{commit}-{quick}"
    directory.mkdir(parents=True)
    child = ChildRun("cell", {"task": ONE}, {"success": 0.5}, ((10, 0.1), (20, 0.5)), "ab" * 32, {COMMIT: commit})
    params = {"quick": str(quick)}
    track_experiment(
        directory, home / "mlruns", "paper curves", "paper curves", params, {}, files, {COMMIT: commit}, [child]
    )


def test_changes_since_the_last_run_of_another_commit(tmp_path: Path) -> None:
    empty_store(tmp_path / "mlruns")
    runs, table = tmp_path / "data" / "runs", sample()
    assert newest(runs, "paper curves", "curves", "c1", quick=False) is None
    worse = table.assign(success=table["success"] / 2, ci_low=table["ci_low"] / 2, ci_high=table["ci_high"] / 2)
    tracked(tmp_path, "c0", worse)
    tracked(tmp_path, "quick", table, quick=True)
    earlier = newest(runs, "paper curves", "curves", "c1", quick=False)
    assert earlier is not None
    assert earlier.commit == "c0"
    assert newest(runs, "paper curves", "curves", "c0", quick=False) is None
    lines = changes(table, earlier, CELL_COLUMNS)
    assert lines[0] == "5 cells are in the run of commit c0 too; 3 of them differ by more than their intervals."
    cell = "pick-place-1, roboscribe, actions, 0, stable, fast, default, 50, default, 0"
    assert f"- {cell}: 49.5 % before, 99.0 % now" in lines
    assert changes(worse, earlier, CELL_COLUMNS) == (
        "5 cells are in the run of commit c0 too; none differs by more than chance.",
    )
    assert points(tmp_path / "mlruns", "curve/success")[:2] == [("cell", 10, 0.1), ("cell", 10, 0.1)]
    assert set(statuses(tmp_path / "mlruns")) == {"paper curves", "cell"}
