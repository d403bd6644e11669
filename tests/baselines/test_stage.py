"""Baselines as a stage and as a command: found in the store, evaluated and filmed as programs are."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from roboscribe.baselines.config import METHODS, RECIPES, Method, method_named
from roboscribe.envs.catalogue import make_task
from roboscribe.errors import ArtifactError, TaskError
from roboscribe.evaluation import measure
from roboscribe.io.demonstrations import write_demonstrations
from roboscribe.io.saved_program import load_program, save_program
from roboscribe.pipelines.baseline_run import BaselinePlan, BaselineRun
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.console import training_line
from roboscribe.pipelines.programs import load_with_task
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages import baseline
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.runtime.events import Event, Trained
from roboscribe.stages.runtime.files import OUTCOME, read_json
from roboscribe.stages.runtime.journal import read_records
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.store import Store
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.mlflow_store import JOURNAL
from tests.baselines.examples import TINY
from tests.pipelines.conftest import command as command  # a fixture is found by its name
from tests.pipelines.runs import Command

TASK = TaskConfig("point-tower-3")


@pytest.fixture(scope="module")
def demonstrations(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a few demonstrations."""
    path, task = tmp_path_factory.mktemp("shown") / "d.parquet", make_task(TASK.name)
    shown = task.demonstrate(4, 0)
    write_demonstrations(path, task.name, task.layout, task.frequency, shown, generator="test", seed=0)
    return path


def config(method: Method, steps: int = 40) -> baseline.Config:
    return baseline.Config(TASK, method, seed=1, steps=steps, rollout_episodes=2, settings=TINY)


def trained(method: Method, shown: Path, root: Path, steps: int = 40) -> Path:
    """Run the stage; returns its outputs."""
    inputs = {"demonstrations": shown} if RECIPES[method].states else {}
    return Store(root).run(baseline.STAGE, config(method, steps), inputs)


@pytest.mark.parametrize("method", METHODS)
def test_what_a_method_saves_runs_on_other_towers(method: Method, demonstrations: Path, tmp_path: Path) -> None:
    """Trained on three blocks, it is loaded for five."""
    out = trained(method, demonstrations, tmp_path)
    manifest = load_program(out / DIRECTORY).manifest
    assert (manifest["kind"], manifest["method"], manifest["profile"]) == ("baseline", method, RECIPES[method].profile)
    assert (manifest["gradient_steps"], manifest["control_steps"]) == ((0, 40) if RECIPES[method].rollouts else (40, 0))
    program, where = load_with_task(out / DIRECTORY, "point-tower-5", "stable", "fast")
    figures = measure(program, where.make(), 0, 2).figures
    assert figures["episodes"] == 2
    assert {path.suffix for path in out.rglob("*") if path.is_file()} <= {".json", ".jsonl", ".txt", ".safetensors"}


@pytest.mark.parametrize("method", ["bc", "goalgail"])
def test_a_killed_stage_goes_on(method: Method, demonstrations: Path, tmp_path: Path) -> None:
    """The same files as without the kill; nothing that was done before is done again."""
    steps, told = 480 if method == "goalgail" else 40, []

    def kill(progress: Progress) -> None:
        told.append(progress.done)
        if len(told) == 2:
            raise KeyboardInterrupt

    whole = trained(method, demonstrations, tmp_path / "whole", steps)
    store, inputs = Store(tmp_path / "killed"), {"demonstrations": demonstrations}
    with pytest.raises(KeyboardInterrupt):
        store.run(baseline.STAGE, config(method, steps), inputs, kill)
    (left,) = (tmp_path / "killed").glob("*/*/progress/*")
    assert left.suffix == ".safetensors"
    out = store.run(baseline.STAGE, config(method, steps), inputs, kill)
    for name in (OUTCOME, f"{DIRECTORY}/controllers.safetensors", f"{DIRECTORY}/manifest.json"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()
    assert told[2] > told[0]
    assert not (out / "progress").exists()


def test_a_baseline_does_not_fit_other_actions(demonstrations: Path, tmp_path: Path) -> None:
    out = trained("bc", demonstrations, tmp_path)
    with pytest.raises(ArtifactError, match="gives 3 numbers, actions of point-push-1 have 2"):
        load_with_task(out / DIRECTORY, "point-push-1", "stable", "fast")
    with pytest.raises(ArtifactError, match="the policy"):
        load_with_task(out / DIRECTORY, "point-drawer-3", "stable", "fast")


def test_a_damaged_network_is_refused(demonstrations: Path, tmp_path: Path) -> None:
    saved = load_program(trained("bc", demonstrations, tmp_path) / DIRECTORY)
    weights = {name: array for name, array in saved.weights.items() if name != "bc.head.bias"}
    save_program(tmp_path / "cut", replace(saved, weights=weights))
    with pytest.raises(ArtifactError, match="do not fit"):
        load_with_task(tmp_path / "cut", None, "stable", "fast")


def test_the_command(command: Command, demonstrations: Path, tmp_path: Path) -> None:
    out, told, again = tmp_path / "policy", tmp_path / "told.json", tmp_path / "again.json"
    asked = ["--steps", 3, "--demos", demonstrations, "--engine", "local", "--episodes", 4, "--out", out]
    assert command("baseline", "bc", TASK.name, *asked, "--json", told) == 0
    result = json.loads(told.read_text())
    assert (result["method"], result["gradient_steps"], result["env_steps"]) == ("bc", 3, 0)
    assert set(path.name for path in out.iterdir()) == {
        "controllers.safetensors", "manifest.json", "program.txt", "tree.json",
    }  # fmt: skip
    figures = load_program(out).manifest["figures"]
    assert isinstance(figures, dict)
    assert figures["success"] == result["success"]
    assert command("evaluate", out, "--episodes", 4, "--json", again) == 0
    measured = json.loads(again.read_text())
    assert (measured["task"], measured["success"]) == (TASK.name, result["success"])
    assert command("render", out, "--task", "point-pick-place-1", "--out", tmp_path / "film.gif") == 0
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF89a")


def test_how_a_learner_does_is_said_on_the_way(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    """After every evaluation, and nothing else, where nobody watches a bar."""
    assert command("baseline", "deepset", TASK.name, "--steps", 128, "--engine", "local", "--episodes", 2) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("128 of 128 control steps: success ")
    assert lines[1].startswith("success ")


def test_bad_input_is_one_line(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("baseline", "telepathy", TASK.name) == 2
    assert "unknown baseline 'telepathy': expected one of bc, chunked-bc" in capsys.readouterr().err
    assert command("baseline", "bc", TASK.name, "--engine", "magic") == 2
    assert "unknown engine 'magic'" in capsys.readouterr().err


def test_what_is_tracked(tmp_path: Path, demonstrations: Path) -> None:
    """The curve, the figures and the policy stand in the journal, once, also after a second look."""
    plan = BaselinePlan("deepset", TASK, steps=320, evaluation_episodes=3, settings=TINY)
    for _ in range(2):
        run = BaselineRun(plan, Workspace(tmp_path), "local", tmp_path / "out", track=False)
        run.run(Callbacks(lambda label: None, lambda event: None, lambda progress: None))
    (journal,) = (tmp_path / "data" / "runs").glob(f"*/{JOURNAL}")
    records = [record for _, record in read_records(journal)]
    curve = [(r["step"], r["value"]) for r in records if r["key"] == "curve/success"]
    assert [step for step, _ in curve] == [160, 320]
    kinds = {r["value"] for r in records if r["key"] == "kind" and r["run"] == ""}
    assert kinds == {"baseline"}
    assert any(r["kind"] == "artifacts" and r["key"] == "program" for r in records)
    assert read_json(next((tmp_path / "data" / "stages" / "baseline").glob("*")) / OUTCOME)["control_steps"] == 320


def test_unknown_methods_are_refused() -> None:
    with pytest.raises(TaskError, match="unknown baseline"):
        method_named("dagger")


def test_how_a_baseline_was_trained_is_said_in_its_own_words(demonstrations: Path, tmp_path: Path) -> None:
    """Nothing of start states, which it has none of."""
    said: list[str] = []

    def listen(event: Event) -> None:
        if isinstance(event, Trained):
            said.extend(training_line(report) for report in event.reports)

    plan = BaselinePlan("deepset", TASK, steps=320, evaluation_episodes=3, settings=TINY)
    run = BaselineRun(plan, Workspace(tmp_path), "local", tmp_path / "out", track=False)
    run.run(Callbacks(lambda label: None, listen, lambda progress: None))
    assert said == ["π_deepset: trained, 320 control steps"]
