"""The transfer experiment: every program in every task, once, with a report of what was found."""

from __future__ import annotations

import io
import os
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from roboscribe.abstraction_refinement import Limits
from roboscribe.errors import ArtifactError, TaskError
from roboscribe.io.saved_program import load_program, save_program
from roboscribe.pipelines.paper import cells
from roboscribe.pipelines.paper.cell_runner import Runner
from roboscribe.pipelines.paper.experiment import ExperimentContext, ExperimentResult, Options
from roboscribe.pipelines.paper.towers import Experiment, measure_towers
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages import transfer
from roboscribe.stages.paper.rows import Trial
from roboscribe.stages.runtime.store import Stage
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.mlflow_store import synchronise
from tests.pipelines.runs import Command, contents, run, scripted
from tests.pipelines.stores import empty_store, points, rows, statuses

EPISODES = 6
TASKS = ("point-pick-place-1", "point-tower-3")
"""The scripted program solves the first; in the second it takes care of one object of three."""
SMALL = Options(evaluation_episodes=EPISODES, tasks=TASKS)
NAMES = {"towers.csv", "towers.md", "towers.png", "towers.svg", "manifest.json"}
SCRIPT = """
import sys
from pathlib import Path
from rich.console import Console
from roboscribe.pipelines.workspace import Workspace
from roboscribe.pipelines.paper.experiment import ExperimentContext
from roboscribe.pipelines.paper.towers import Experiment, measure_towers
from tests.paper.test_towers_command import SMALL, replace
options = replace(SMALL, programs=(sys.argv[1],))
context = ExperimentContext(Workspace(Path(sys.argv[2])), out=Path(sys.argv[3]), track=False)
measure_towers(Experiment(), options, context, Console())
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a program for a point task that says it was made for a tower of 4 blocks, with seed 2."""
    home = tmp_path_factory.mktemp("made")
    run(scripted(), home)
    saved = load_program(home / "program")
    save_program(home / "tower", replace(saved, manifest={**saved.manifest, "task": "tower-4", "seed": 2}))
    return home / "tower"


def conduct(
    options: Options, home: Path, *, track: bool = False, experiment: Experiment | None = None
) -> tuple[ExperimentResult, str]:
    """Run an experiment without Prefect; returns what it leaves and what was said."""
    said = io.StringIO()
    console = Console(file=said, width=200)
    context = ExperimentContext(Workspace(home), Runner("local"), home / "report", track)
    return measure_towers(experiment or Experiment(), options, context, console), said.getvalue()


def read(home: Path) -> pd.DataFrame:
    """Read the table of every measurement."""
    return pd.read_csv(home / "report" / "towers.csv")


def test_a_given_program_is_measured_everywhere(made: Path, tmp_path: Path) -> None:
    report, said = conduct(replace(SMALL, programs=(str(made),)), tmp_path)
    table = read(tmp_path)
    assert list(zip(table["contact"], table["task"], strict=True)) == [
        (c, t) for c in ("stable", "paper") for t in TASKS
    ]
    assert set(table["trained"]) == {4}
    assert set(table["seed"]) == {2}
    assert list(table["successes"]) == [EPISODES, 0, EPISODES, 0]
    assert "tower-4 seed 2 on point-pick-place-1, paper contact: 100.0 % (61.0 to 100.0)" in said
    assert report.summary == (tmp_path / "report" / "towers.md").read_text()
    assert "| tower-4 | roboscribe | point-tower-3 | 0.0 | 0.0 | - | - |" in report.summary
    assert set(contents(tmp_path / "report")) == NAMES
    assert not (tmp_path / "data" / "stages" / "train").exists()


def test_measurements_are_not_repeated(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted in the third of four measurements, the experiment goes on with it."""
    begun: list[str] = []
    dead = iter((False, False, True, False, False))

    def work(*arguments: object) -> None:
        begun.append(str(arguments[0]))
        if next(dead):
            raise KeyboardInterrupt
        transfer.run(*arguments)  # type: ignore[arg-type]

    work.__module__ = transfer.run.__module__
    monkeypatch.setattr(transfer, "STAGE", Stage("transfer", transfer.Config, work))
    options = replace(SMALL, programs=(str(made),))
    with pytest.raises(KeyboardInterrupt):
        conduct(options, tmp_path)
    assert not (tmp_path / "report").exists()
    conduct(options, tmp_path)
    assert len(begun) == 5
    assert begun[2] == begun[3]
    conduct(options, tmp_path)
    assert len(begun) == 5
    assert len(read(tmp_path)) == 4


@pytest.fixture
def small_syntheses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Synthesize for a point task where towers are asked for; that of 4 blocks with seed 1 finds no program."""

    def plan(trial: Trial, given: Path | None = None) -> SynthesisPlan:
        limits = Limits(refinements=0 if (trial.task.name, trial.seed) == ("tower-4", 1) else 12)
        return scripted(trial.seed, limits=limits)

    assert (cells.planned(Trial(TaskConfig("tower-5"), seed=2)).task.name, 2) == ("tower-5", 2)
    monkeypatch.setattr(cells, "planned", plan)


@pytest.mark.usefixtures("small_syntheses")
def test_programs_are_synthesized_for_every_tower_and_seed(tmp_path: Path) -> None:
    """One synthesis that fails does not keep the others from being measured."""
    options = replace(SMALL, tasks=TASKS[:1], seeds=2)
    report, said = conduct(options, tmp_path, experiment=Experiment((4, 5), ("stable",)))
    table = read(tmp_path)
    assert list(zip(table["trained"], table["seed"], strict=True)) == [(4, 0), (5, 0), (5, 1)]
    assert set(table["successes"]) == {EPISODES}
    assert len(report.failures) == 1
    assert report.failures[0].startswith("roboscribe tower-4 seed 1: ")
    assert "refinement 1: hold" in said
    assert report.failures[0] in report.summary


def test_nothing_to_measure_leaves_no_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cells, "planned", lambda trial, given=None: scripted(limits=Limits(refinements=0)))
    report, _ = conduct(replace(SMALL, seeds=1), tmp_path, experiment=Experiment((4,), ("stable",)))
    assert (report.summary, len(report.failures)) == ("", 1)
    assert not (tmp_path / "report").exists()


def test_one_run_in_mlflow(made: Path, tmp_path: Path) -> None:
    """Parameters, a metric per cell, and the report; the same experiment once more is the same run."""
    mlruns = empty_store(tmp_path / "mlruns")
    options = replace(SMALL, programs=(str(made),))
    report, _ = conduct(options, tmp_path, track=True)
    again, _ = conduct(options, tmp_path, track=True)
    assert report.run_id is not None
    assert report.run_id == again.run_id
    assert set(statuses(mlruns).values()) == {"FINISHED"}
    assert ("paper towers",) in rows(mlruns, "select name from experiments")
    names = {f"roboscribe tower-4 seed 2 on {task}, {c} contact" for task in TASKS for c in ("stable", "paper")}
    assert set(statuses(mlruns)) == {"paper towers", *names}
    for task, rate in zip(TASKS, (1.0, 0.0), strict=True):
        assert (f"roboscribe tower-4 seed 2 on {task}, paper contact", 0, rate) in points(mlruns, "success")
    assert {path.name for path in (mlruns / "artifacts").rglob("towers.*")} == NAMES - {"manifest.json"}


def test_an_unreachable_store_is_filled_later(made: Path, tmp_path: Path) -> None:
    (tmp_path / "mlruns").write_text("not a directory")
    report, _ = conduct(replace(SMALL, programs=(str(made),)), tmp_path, track=True)
    assert report.run_id is None
    assert len(read(tmp_path)) == 4
    (tmp_path / "mlruns").unlink()
    empty_store(tmp_path / "mlruns")
    synchronise(tmp_path / "data" / "runs", tmp_path / "mlruns")
    assert statuses(tmp_path / "mlruns")["paper towers"] == "FINISHED"


def test_with_prefect_every_measurement_is_a_task_run(made: Path, tmp_path: Path) -> None:
    conduct(replace(SMALL, programs=(str(made),)), tmp_path / "local")
    paths = {"PYTHONPATH": os.pathsep.join(sys.path), "PREFECT_HOME": str(tmp_path / "prefect")}
    command = [sys.executable, "-c", SCRIPT, str(made), str(tmp_path / "flow"), str(tmp_path / "flow" / "report")]
    ended = subprocess.run(command, env={**os.environ, **paths}, capture_output=True, text=True, timeout=240)
    assert ended.returncode == 0, ended.stderr
    assert contents(tmp_path / "flow" / "report") == contents(tmp_path / "local" / "report")
    with sqlite3.connect(tmp_path / "prefect" / "prefect.db") as database:
        tasks = database.execute("select name, state_type from task_run order by expected_start_time").fetchall()
        flows = database.execute("select name, state_type from flow_run").fetchall()
    cells = [f"tower-4 seed 2 on {task}, {contact} contact" for contact in ("stable", "paper") for task in TASKS]
    assert tasks == [(cell, "COMPLETED") for cell in cells]
    assert flows == [("paper towers", "COMPLETED")]


def test_towers_from_the_command_line(
    command: Command, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty_store(tmp_path / "home" / "mlruns")
    options = [
        "--task",
        TASKS[0],
        "--episodes",
        3,
        "--contact",
        "paper",
        "--contact",
        "paper",
        "--engine",
        "local",
        "--out",
        tmp_path / "r",
    ]
    assert command("paper", "towers", "--program", made, *options) == 0
    said = capsys.readouterr().out
    assert "tower-4 seed 2 on point-pick-place-1, paper contact: 100.0 %" in said
    assert "| tower-4 | roboscribe | point-pick-place-1 | 100.0 | - | - |" in said
    assert set(contents(tmp_path / "r")) == NAMES


def test_failures_have_exit_code_3(
    command: Command, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cells, "planned", lambda trial, given=None: scripted(limits=Limits(refinements=0)))
    given = ["--trained", 4, "--seeds", 1, "--engine", "local"]
    assert command("paper", "towers", *given) == 3
    assert capsys.readouterr().out.count("FAIL: roboscribe tower-4 seed 0: ") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--contact", "soft"], "unknown contact model 'soft'"),
        (["--trained", "1"], "tower-1: 1 blocks, expected 2 to 10"),
        (["--trained", "0"], "unknown task 'tower-0'"),
        (["--program", "nowhere"], "program nowhere: does not exist"),
        (["--seeds", "0"], "--seeds"),
        (["--out", "/proc/nowhere/towers"], "/proc/nowhere/towers"),
    ],
)
def test_bad_input_is_one_line(
    command: Command, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert command("paper", "towers", "--engine", "local", *arguments) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: ")
    assert said in message
    assert message.count("\n") == 1


def test_programs_for_something_else_are_refused(made: Path, tmp_path: Path) -> None:
    saved = load_program(made)
    for task in ("pick-place-4", "multitower-5", "point-tower-3"):
        save_program(tmp_path / "other", replace(saved, manifest={**saved.manifest, "task": task}))
        with pytest.raises(ArtifactError, match=rf"was made for task {task}, expected a single tower"):
            conduct(replace(SMALL, programs=(str(tmp_path / "other"),)), tmp_path)


def test_programs_that_look_alike_are_refused(made: Path, tmp_path: Path) -> None:
    save_program(tmp_path / "copy", load_program(made))
    with pytest.raises(ArtifactError, match="two of the programs are tower-4 seed 2"):
        conduct(replace(SMALL, programs=(str(made), str(tmp_path / "copy"))), tmp_path)


def test_an_unknown_task_is_noticed_before_anything_is_trained(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="unknown task 'spire-4'"):
        conduct(replace(SMALL, tasks=("spire-4",)), tmp_path)
    assert not (tmp_path / "data").exists()
