"""Shipped programs are found by name, and every program says how it was made."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from roboscribe import programs
from roboscribe.errors import ArtifactError
from roboscribe.io.saved_program import SavedProgram, load_program, save_program
from roboscribe.pipelines import synthesis_pipeline
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.pipelines.synthesis_run import publish
from roboscribe.programs import program_directory, shipped_programs
from roboscribe.rl.config import TrainConfig
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from tests.pipelines.runs import Command, contents, run, scripted

FIGURES = {"success": 0.75, "ci_low": 0.41, "ci_high": 0.93, "episodes": 8}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a saved program of a point task."""
    home = tmp_path_factory.mktemp("home")
    run(scripted(), home)
    return home / "program"


@pytest.fixture
def shipped(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Ship one program for the time being; returns where shipped programs lie."""
    monkeypatch.setattr(programs, "TRAINED", tmp_path / "trained")
    shutil.copytree(made, tmp_path / "trained" / "carry")
    return tmp_path / "trained"


def test_a_shipped_program_is_evaluated_on_its_own_task(command: Command, shipped: Path, tmp_path: Path) -> None:
    report = tmp_path / "e.json"
    assert command("evaluate", "carry", "--episodes", 5, "--json", report) == 0
    result = json.loads(report.read_text())
    assert (result["task"], result["success"], result["episodes"]) == ("point-pick-place-1", 1.0, 5)


def test_a_shipped_program_is_filmed(command: Command, shipped: Path, tmp_path: Path) -> None:
    assert command("render", "carry", "--out", tmp_path / "v.gif") == 0
    assert (tmp_path / "v.gif").read_bytes().startswith(b"GIF89a")


def test_a_path_comes_before_a_shipped_name(shipped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with program_directory("carry", tmp_path) as found:
        assert found == shipped / "carry"
    (tmp_path / "here" / "carry").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "here")
    with program_directory("carry", tmp_path) as found:
        assert found == Path("carry")


def test_a_run_id_comes_before_a_shipped_name(shipped: Path, tmp_path: Path) -> None:
    (shipped / "carry").rename(shipped / ("0" * 32))
    with pytest.raises(ArtifactError, match="there is no tracking store"), program_directory("0" * 32, tmp_path):
        pass


def test_what_is_no_program_is_told_the_shipped_names(
    command: Command, shipped: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(shipped / "carry", shipped / "bring")
    (shipped / "unfinished").mkdir()
    assert command("evaluate", "fetch") == 2
    said = capsys.readouterr().err
    assert said.startswith("error: program fetch: does not exist; expected a program's directory, an MLflow run id or")
    assert said.endswith("a shipped program (bring, carry)\n")
    assert said.count("\n") == 1


def test_a_program_of_an_unknown_task_needs_another(
    command: Command, shipped: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = load_program(shipped / "carry")
    save_program(shipped / "carry", replace(saved, manifest={**saved.manifest, "task": "juggling"}))
    assert command("evaluate", "carry", "--episodes", 2) == 2
    assert "unknown task 'juggling'" in capsys.readouterr().err
    assert command("evaluate", "carry", "--task", "point-pick-place-1", "--episodes", 2) == 0


def test_programs_are_listed(command: Command, shipped: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved = load_program(shipped / "carry")
    save_program(shipped / "carry", replace(saved, manifest={**saved.manifest, "seed": 7, "figures": FIGURES}))
    size = sum(len(data) for data in contents(shipped / "carry").values())
    assert command("programs") == 0
    listed = capsys.readouterr().out.splitlines()[1].split("  ")
    cells = [cell.strip() for cell in listed if cell.strip()]
    assert cells == [
        "carry",
        "point-pick-place-1",
        "7",
        "scripted",
        "75.0 % (41.0 to 93.0)",
        f"{size / 1000:.0f} kB",
    ]


def test_a_damaged_shipped_program_is_refused(shipped: Path) -> None:
    (shipped / "carry" / "tree.json").write_text("{}")
    with pytest.raises(ArtifactError, match=r"tree\.json: was changed"):
        shipped_programs()


def test_what_ships_can_be_loaded() -> None:
    assert {each.name: each.manifest["task"] for each in shipped_programs()} == {n: n for n in programs.shipped_names()}


@pytest.mark.parametrize(
    ("plan", "spelled"),
    [
        (SynthesisPlan(TaskConfig("tower-5")), "roboscribe synthesize tower-5 --seed 0 --profile actions"),
        (
            SynthesisPlan(
                TaskConfig("tower-5", "paper", "faithful"),
                3,
                demonstrations=Path("my demos.parquet"),
                evaluation_episodes=9,
            ),
            "roboscribe synthesize tower-5 --seed 3 --profile actions --demos 'my demos.parquet' --episodes 9"
            " --contact paper --timing faithful",
        ),
        (
            SynthesisPlan(TaskConfig("tower-5"), training=TrainConfig(budget=7)),
            "roboscribe synthesize tower-5 --seed 0 --profile actions --budget 7",
        ),
    ],
)
def test_the_command_that_makes_a_program(plan: SynthesisPlan, spelled: str) -> None:
    assert synthesis_pipeline.command(plan, "actions") == spelled


def test_a_manifest_says_how_the_program_was_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("roboscribe.pipelines.synthesis_run.checkout_commit", lambda: "c0ffee")
    result = run(scripted(), tmp_path)
    assert isinstance(result, Mapping)
    manifest = load_program(tmp_path / "program").manifest
    asked = "roboscribe synthesize point-pick-place-1 --seed 0 --profile scripted --episodes 40"
    asked += " --set n_demonstrations=12 --set rollout_episodes=20 --set video=false"
    assert (manifest["command"], manifest["commit"]) == (asked, "c0ffee")
    assert manifest["env_steps"] == result["env_steps"]


def saved(directory: Path, **manifest: Any) -> Path:  # noqa: ANN401 - whatever JSON
    """Save a program without controllers."""
    about = {"task": "tower-2", "profile": "actions", "seed": 0, "figures": FIGURES, **manifest}
    save_program(directory, SavedProgram("def P(μ : EE):\n", {}, {}, {}, about))
    return directory


def test_a_published_program_keeps_its_commit(tmp_path: Path) -> None:
    """The same program found again, under a later commit, changes no file; another program does."""
    packaged, out = saved(tmp_path / "packaged"), tmp_path / "out"
    publish(packaged, out, {"env_steps": 5}, "first")
    before = contents(out)
    publish(packaged, out, {"env_steps": 5}, "second")
    assert contents(out) == before
    (out / "program.txt").write_text("edited")
    publish(packaged, out, {"env_steps": 5}, "third")
    assert (load_program(out).manifest["commit"], load_program(out).edited) == ("third", False)
    publish(saved(tmp_path / "other", seed=1), out, {"env_steps": 5}, "fourth")
    assert (load_program(out).manifest["commit"], load_program(out).manifest["seed"]) == ("fourth", 1)


def test_a_damaged_program_is_published_again(tmp_path: Path) -> None:
    packaged, out = saved(tmp_path / "packaged"), tmp_path / "out"
    publish(packaged, out, {}, "first")
    (out / "manifest.json").write_text("{")
    publish(packaged, out, {}, "second")
    assert load_program(out).manifest["commit"] == "second"


def git(directory: Path, *words: str) -> str:
    """Run git as nobody in particular."""
    who = ["-c", "user.name=x", "-c", "user.email=x", "-c", "commit.gpgsign=false"]
    return subprocess.run(["git", *who, *words], cwd=directory, check=True, capture_output=True, text=True).stdout


def test_the_commit_of_a_checkout(tmp_path: Path) -> None:
    assert checkout_commit(tmp_path) == ""
    git(tmp_path, "init", "-q")
    assert checkout_commit(tmp_path) == ""
    (tmp_path / "file").write_text("one")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "-q", "--no-verify", "-m", "one")
    commit = git(tmp_path, "rev-parse", "HEAD").strip()
    git(tmp_path, "tag", "-a", "-m", "one", "v1")
    assert checkout_commit(tmp_path) == commit
    (tmp_path / "file").write_text("two")
    assert checkout_commit(tmp_path) == f"{commit}-dirty"
    (tmp_path / "installed").mkdir()
    assert checkout_commit(tmp_path / "installed") == ""


def test_without_git_there_is_no_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ".git").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert checkout_commit(tmp_path) == ""
