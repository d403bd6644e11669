"""The paper's experiments on tasks in the plane: what is computed once, interrupted anywhere, and told in the end."""

from __future__ import annotations

import io
import multiprocessing
import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from roboscribe.abstraction_refinement import Limits
from roboscribe.errors import TaskError
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.paper import cells
from roboscribe.pipelines.paper.cell_runner import Runner, no_callbacks
from roboscribe.pipelines.paper.cells import CellContext, SynthesisCell
from roboscribe.pipelines.paper.confined import Confinement, measure_confined
from roboscribe.pipelines.paper.curves import draw_curves, make_table1, trials_of
from roboscribe.pipelines.paper.demos import draw_demos, ways_of
from roboscribe.pipelines.paper.experiment import ExperimentContext, ExperimentResult, Options
from roboscribe.pipelines.paper.methods import budget_of
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.paper.rows import OURS, Trial, read_record
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from tests.pipelines.runs import Command, contents, scripted

ONE, TOWER = "point-pick-place-1", "point-tower-3"
SMALL = Options((ONE,), (OURS,), ("scripted",), seeds=2, evaluation_episodes=10)


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every synthesis one of seconds; seed 7 finds no program."""

    def plan(trial: Trial, given: Path | None = None) -> SynthesisPlan:
        limits = Limits(refinements=0 if trial.seed == 7 else 12)
        own = scripted(trial.seed, trial.task.name, limits=limits, evaluation_episodes=trial.evaluation_episodes)
        return replace(own, demonstrations=given, n_demonstrations=min(trial.n_demonstrations, own.n_demonstrations))

    monkeypatch.setattr(cells, "planned", plan)


def context(home: Path, out: str = "report") -> ExperimentContext:
    """Work without Prefect and without tracking."""
    return ExperimentContext(Workspace(home), Runner("local"), home / out, track=False)


def conduct(
    act: Callable[[Options, ExperimentContext, Console], ExperimentResult],
    options: Options,
    home: Path,
    out: str = "report",
) -> ExperimentResult:
    """Do an experiment silently."""
    return act(options, context(home, out), Console(file=io.StringIO()))


def table(home: Path, name: str, out: str = "report") -> pd.DataFrame:
    """Read a report's table, without what differs from run to run."""
    return pd.read_csv(home / out / f"{name}.csv").drop(columns="wall_seconds")


def trained(home: Path) -> int:
    """Count the trainings in the store."""
    return len(list((home / "data" / "stages" / "train").iterdir()))


def test_every_program_for_the_task_is_measured(tmp_path: Path) -> None:
    out = SynthesisCell(Trial(TaskConfig(ONE), profile="scripted", evaluation_episodes=10, rollout_episodes=5)).run(
        CellContext(Workspace(tmp_path), track=False), no_callbacks()
    )
    record = read_record(out)
    first, *_, last = record.points
    assert (first.control_steps, first.successes, first.episodes, first.final) == (0, 0, 5, False)
    assert (last.successes, last.episodes, last.final) == (10, 10, True)
    steps = [point.control_steps for point in record.points]
    assert steps == sorted(steps)
    assert [point.successes for point in record.points[:-1]] == [0] * (len(steps) - 2) + [5]
    assert (record.refinements, record.ended, len(record.demonstrations)) == (2, "", 64)
    assert (out / "program" / "program.txt").read_text().startswith("def PointPickPlace1")


def test_a_cell_without_a_program_says_so(tmp_path: Path) -> None:
    trial = Trial(TaskConfig(ONE), profile="scripted", seed=7, evaluation_episodes=10)
    record = read_record(SynthesisCell(trial).run(CellContext(Workspace(tmp_path), track=False), no_callbacks()))
    assert record.ended == "no program"
    assert record.refinements is None
    assert record.points[-1].successes == 0
    assert "refinements were not enough" in record.reason


def test_table_1_takes_the_syntheses_of_the_curves(tmp_path: Path) -> None:
    conduct(draw_curves, SMALL, tmp_path)
    count = trained(tmp_path)
    before = contents(tmp_path / "data" / "stages")
    done = conduct(make_table1, SMALL, tmp_path, "second")
    assert (trained(tmp_path), contents(tmp_path / "data" / "stages")) == (count, before)
    assert table(tmp_path, "table1", "second").equals(table(tmp_path, "curves"))
    assert f"| {ONE} | roboscribe, scripted | 0, 1 | 2.0 | 2, 2 | - |  |" in done.summary
    assert set(contents(tmp_path / "second")) == {
        "table1.csv", "table1.md", "table1.png", "table1.svg", "manifest.json"
    }  # fmt: skip


def test_tasks_that_do_not_exist_are_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("roboscribe.pipelines.paper.curves.REPORTED", {"spire-9": None, ONE: None})
    done = conduct(make_table1, replace(SMALL, tasks=(), seeds=1), tmp_path)
    assert done.missing == ("spire-9",)
    assert "| spire-9 | roboscribe | - | - | not built yet | - |  |" in done.summary
    with pytest.raises(TaskError, match="unknown task 'spire-8'"):
        conduct(make_table1, replace(SMALL, tasks=("spire-8",)), tmp_path)


def test_demonstrations_of_every_size(tmp_path: Path) -> None:
    done = conduct(draw_demos, replace(SMALL, seeds=1), tmp_path)
    found = table(tmp_path, "demos")
    final = found[found["kind"] == "final"]
    assert list(zip(final["n_demonstrations"], final["style"], final["failing"], strict=True)) == list(
        ways_of(ONE, quick=False)
    )
    assert len(set(final["demonstrations"])) > 1
    assert done.directory == tmp_path / "report"


def test_demonstrations_of_another_style_are_collected_first(tmp_path: Path) -> None:
    usual, context = (
        Trial(TaskConfig("pick-place-1"), n_demonstrations=2),
        CellContext(Workspace(tmp_path), track=False),
    )
    slow = cells.demonstrations(replace(usual, style="slow"), context, no_callbacks())
    failing = cells.demonstrations(replace(usual, failing=0.5), context, no_callbacks())
    assert cells.demonstrations(usual, context, no_callbacks()) is None
    assert slow is not None
    assert failing is not None
    assert slow.read_bytes() != failing.read_bytes()
    assert str(replace(usual, style="slow", failing=0.5)) == (
        "roboscribe pick-place-1 2 demonstrations slow 50% failing seed 0"
    )


def test_only_the_guard_is_learned_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that places blocks in any order is shown 30 towers, and its loop takes the lowest goal first."""
    monkeypatch.setattr("roboscribe.pipelines.paper.confined.SHOWN", 30)
    experiment = Confinement("point-place-3", TOWER)
    options = replace(SMALL, tasks=(), seeds=1, evaluation_episodes=20)
    done = measure_confined(experiment, options, context(tmp_path), Console(file=io.StringIO()))
    found = table(tmp_path, "confined").set_index("way")
    assert done.failures == ()
    assert list(found.index) == ["old guard", "new guard"]
    assert found.loc["new guard", "successes"] == 20
    assert found.loc["new guard", "n_demonstrations"] == 30
    assert "∃b'" not in str(found.loc["old guard", "loop"])
    assert "g(b')↓z < g(b)↓z" in str(found.loc["new guard", "loop"])
    before = contents(tmp_path / "report")
    measure_confined(experiment, options, context(tmp_path), Console(file=io.StringIO()))
    assert contents(tmp_path / "report") == before


def killed(home: Path, label: str) -> None:
    """Do an experiment in a process that is killed when a stage begins for the second time under a label."""

    def work() -> None:
        seen: list[str] = []
        original = Callbacks.__init__

        def listening(self: Callbacks, told: Callable[[str], None], *others: object) -> None:
            def hear(stage: str) -> None:
                seen.append(stage)
                if stage == label:
                    os.kill(os.getpid(), signal.SIGKILL)
                told(stage)

            original(self, hear, *others)  # type: ignore[arg-type]  # the other two callbacks

        Callbacks.__init__ = listening  # type: ignore[method-assign,assignment]  # in this process only, which dies
        conduct(draw_curves, SMALL, home)

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL


@pytest.fixture
def uninterrupted(tmp_path: Path) -> pd.DataFrame:
    """Draw curves at once."""
    conduct(draw_curves, SMALL, tmp_path / "whole")
    return table(tmp_path / "whole", "curves")


def test_killed_in_three_cells_the_table_is_the_same(tmp_path: Path, uninterrupted: pd.DataFrame) -> None:
    for label in ("train hold", "evaluate program", "evaluate what was trained after 0 control steps"):
        killed(tmp_path / "torn", label)
        assert not (tmp_path / "torn" / "report" / "curves.csv").exists()
    conduct(draw_curves, SMALL, tmp_path / "torn")
    assert table(tmp_path / "torn", "curves").equals(uninterrupted)


def test_budgets() -> None:
    """Clones learn for their usual gradient steps; nobody gets fewer control steps than the others in silence."""
    usual, quick = Options(), Options(quick=True)
    paper, given = Options(budget="paper"), Options(budget="700000")
    assert [budget_of(method, "push-3", usual) for method in (OURS, "bc", "gail")] == [None] * 3
    assert [budget_of(method, "push-3", paper) for method in (OURS, "bc", "gail")] == [None, None, 8_000_000]
    assert [budget_of(method, "push-3", given) for method in (OURS, "bc", "gail")] == [700_000, None, 700_000]
    assert [budget_of(method, "push-3", quick) for method in (OURS, "bc", "gail")] == [100_000, 5_000, 100_000]
    with pytest.raises(TaskError, match="--budget some: expected default, paper or a number"):
        Options(budget="some")


def test_quick_runs_in_the_plane_take_the_controllers_of_the_task() -> None:
    both = ("pick-place-1", ONE)
    quick, usual = (trials_of(Options(seeds=1, quick=quick), both, (OURS, "bc")) for quick in (True, False))
    assert [(trial.task.name, trial.profile) for trial in quick] == [
        ("pick-place-1", "actions"), ("pick-place-1", ""), (ONE, "scripted"), (ONE, ""),
    ]  # fmt: skip
    assert [trial.profile for trial in usual] == ["actions", "states", ""] * 2
    asked = Options(seeds=1, quick=True, profiles=("states",))
    assert [trial.profile for trial in trials_of(asked, (ONE,), (OURS,))] == ["states"]


def test_quick_runs_say_that_they_are_no_result(tmp_path: Path) -> None:
    options = Options((ONE,), (OURS,), ("scripted",), quick=True)
    done = draw_curves(options, replace(context(tmp_path), out=None), Console(file=io.StringIO()))
    assert done.directory == tmp_path.resolve() / "data" / "paper" / "curves-quick"
    assert done.summary.startswith("# quick: not a result: paper curves\n")
    found = table(done.directory.parent, "curves", "curves-quick")
    assert found["quick"].all()
    assert set(found["seed"]) == {0}
    assert set(found[found["kind"] == "final"]["episodes"]) == {50}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["curves", "--task", "nowhere"], "unknown task 'nowhere'"),
        (["curves", "--method", "magic"], "unknown method 'magic': expected one of roboscribe, bc"),
        (["table1", "--profile", "magic"], "unknown profile 'magic'"),
        (["demos", "--budget", "much"], "--budget much"),
        (["confined", "--program", "tower-5"], "was made for task tower-5, expected push-3"),
        (["curves", "--out", "/proc/nowhere/curves"], "/proc/nowhere/curves"),
    ],
)
def test_bad_input_is_one_line(
    command: Command, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert command("paper", *arguments, "--engine", "local") == 2
    message = capsys.readouterr().err
    assert message.startswith("error: ")
    assert said in message
    assert message.count("\n") == 1


def test_a_synthesis_without_a_program_ends_with_3(
    command: Command, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cells, "planned", lambda trial, given=None: scripted(limits=Limits(refinements=0)))
    given = ["--task", ONE, "--profile", "scripted", "--seeds", 1, "--engine", "local"]
    assert command("paper", "table1", *given) == 3
    said = capsys.readouterr().out
    assert f"FAIL: roboscribe {ONE} scripted seed 0: " in said
    assert f"| {ONE} | roboscribe, scripted | 0 | - | no program | - |  |" in said


def test_refinements_are_counted_per_synthesis(tmp_path: Path) -> None:
    said = io.StringIO()
    draw_curves(SMALL, context(tmp_path), Console(file=said, width=200))
    assert said.getvalue().count("refinement 1:") == 2
    assert "refinement 3:" not in said.getvalue()
