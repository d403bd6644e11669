"""Everything in one command, and the runs that are scheduled."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest
import yaml
from prefect.exceptions import ParameterTypeError
from rich.console import Console

from roboscribe.errors import TaskError
from roboscribe.pipelines.paper import everything
from roboscribe.pipelines.paper.experiment import ExperimentContext, ExperimentResult, Options
from roboscribe.pipelines.paper.methods import every_method
from roboscribe.pipelines.paper.schedule import EVERYTHING, SCHEDULES, Experiment, scheduled, serve_schedules
from roboscribe.pipelines.workspace import Workspace
from tests.pipelines.runs import Command

FILE = Path(everything.__file__).resolve().parent.parent / "prefect.yaml"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Options, ExperimentContext]]:
    """Note what would be done instead of doing it; one synthesis finds no program."""
    seen: list[tuple[str, Options, ExperimentContext]] = []

    def noted(name: str) -> everything.Conduct:
        def conduct(options: Options, context: ExperimentContext, console: Console) -> ExperimentResult:
            seen.append((name, options, context))
            failures = ("tower-5 seed 0: nothing separates",) if name == "demos" else ()
            return ExperimentResult("", failures, ("table-top",) if name == "curves" else (), context.out)

        return conduct

    fakes = {name: (hours, noted(name)) for name, (hours, _) in everything.EXPERIMENTS.items()}
    monkeypatch.setattr(everything, "EXPERIMENTS", fakes)
    return seen


def test_all_does_everything_and_says_what_is_missing(
    command: Command,
    asked: list[tuple[str, Options, ExperimentContext]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    given = ["--task", "tower-5", "--method", "roboscribe", "--seeds", 2, "--out", tmp_path / "out"]
    assert command("paper", "all", *given) == 3
    said = capsys.readouterr().out
    assert [name for name, _, _ in asked] == ["table1", "demos", "confined", "towers", "curves"]
    assert [options.tasks for _, options, _ in asked] == [("tower-5",), ("tower-5",), (), (), ("tower-5",)]
    assert all(context.out == tmp_path / "out" / name for name, _, context in asked)
    assert "core-hours where nothing is in the store yet" in said.splitlines()[0]
    assert "  table-top not built yet" in said
    assert "  FAIL: tower-5 seed 0: nothing separates" in said


def test_quick_takes_minutes() -> None:
    assert everything.expectation(Options(quick=True)).endswith("about 9 minutes where nothing is in the store yet")


def test_the_file_says_what_the_command_offers() -> None:
    found = yaml.safe_load(FILE.read_text())["deployments"]
    assert {each["name"]: (each["schedules"][0]["cron"], each["parameters"]) for each in found} == SCHEDULES
    for each in found:
        assert each["entrypoint"] == "pipelines/paper/schedule.py:scheduled"
        assert each["concurrency_limit"] == {"limit": 1, "collision_strategy": "ENQUEUE"}


def test_a_scheduled_run_does_an_experiment(
    asked: list[tuple[str, Options, ExperimentContext]], tmp_path: Path
) -> None:
    scheduled.fn("curves", quick=True, methods=["roboscribe", "bc"], home=str(tmp_path))
    ((name, options, context),) = asked
    assert (name, options) == ("curves", Options(methods=("roboscribe", "bc"), quick=True))
    assert context.workspace == Workspace(tmp_path)
    with pytest.raises(TaskError, match="nothing separates"):
        scheduled.fn("all", home=str(tmp_path))
    with pytest.raises(TaskError, match="unknown experiment 'tables'"):
        scheduled.fn("tables")  # type: ignore[arg-type]  # that is the point


def test_the_form_of_the_page_offers_what_there_is() -> None:
    """Prefect makes its form from this, and refuses the rest before a run begins."""
    fields = scheduled.parameters.model_dump()["properties"]
    assert fields["experiment"]["enum"] == list(get_args(Experiment))
    assert set(get_args(Experiment)) == {EVERYTHING, *everything.EXPERIMENTS}
    offered = [choice for way in fields["methods"]["anyOf"] for choice in way.get("items", {}).get("enum", ())]
    assert set(offered) == set(every_method())
    assert (fields["seeds"]["minimum"], fields["seeds"]["maximum"]) == (1, 100)
    assert "all" in fields["experiment"]["description"]
    for wrong in ({"experiment": "tables"}, {"seeds": 0}, {"methods": ["ppo"]}):
        with pytest.raises(ParameterTypeError):
            scheduled.validate_parameters(wrong)


def test_without_a_server_nothing_is_offered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("PREFECT_API_URL", raising=False)
    with pytest.raises(TaskError, match="PREFECT_API_URL is not set"):
        serve_schedules(tmp_path)
