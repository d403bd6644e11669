"""The command line: options, JSON fields, exit codes, and one clear line for bad input."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.envs.styles import style_names
from roboscribe.io.demonstrations import write_demonstrations
from roboscribe.pipelines.cli import STYLE_HELP
from roboscribe.world.trajectory import Trajectory
from tests.pipelines.runs import Command, contents, run, scripted

TASK = "point-pick-place-1"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a saved program."""
    home = tmp_path_factory.mktemp("home")
    run(scripted(), home)
    return home / "program"


def write(path: Path, shown: list[Trajectory], task: str = TASK) -> Path:
    """Write demonstrations of a point task."""
    known = POINT_TASKS[task]
    write_demonstrations(path, task, known.layout, known.frequency, shown, generator="test", seed=None)
    return path


def failing(shown: Trajectory) -> Trajectory:
    """Cut a demonstration off before anything is reached."""
    return Trajectory(shown.layout, shown.states[:6], shown.actions[:5] if shown.actions is not None else None)


def test_tasks_lists_every_task(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("tasks") == 0
    listed = capsys.readouterr().out
    assert "pick-place-1" in listed
    assert "g(block): position" in listed
    assert "100 steps, 25 Hz" in listed


def test_demos_names_every_style() -> None:
    assert all(name in STYLE_HELP for name in style_names())


def test_synthesize_from_a_file(command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    demos, out, report = tmp_path / "new" / "d.parquet", tmp_path / "p", tmp_path / "r.json"
    out.mkdir()
    (out / "notes.md").write_text("mine")
    assert command("demos", TASK, "--episodes", 12, "--seed", 3, "--out", demos) == 0
    given = ["--demos", demos, "--profile", "scripted", "--engine", "local", "--episodes", 50, "--out", out]
    assert command("synthesize", TASK, *given, "--json", report) == 0
    result = json.loads(report.read_text())
    assert set(result) == {
        "task", "seed", "profile", "horizon", "success", "episodes", "ci_low", "ci_high", "refinements", "env_steps",
        "evaluation_steps", "wall_seconds", "program", "tree", "program_dir", "mlflow_run_id",
    }  # fmt: skip
    assert (result["task"], result["seed"], result["profile"]) == (TASK, 0, "scripted")
    assert (result["success"], result["episodes"], result["refinements"]) == (1.0, 50, 2)
    assert result["program"] == (out / "program.txt").read_text()
    assert result["program_dir"] == str(out)
    assert set(contents(out)) == {"controllers.safetensors", "manifest.json", "notes.md", "program.txt", "tree.json"}
    story = capsys.readouterr().out
    for told in (
        "12 of 12 demonstrations",
        ": hold ≡ ‖μ↓xz − b1↓xz‖",
        "π_hold π_at reached ψ_R in 100 of 100 episodes",
    ):
        assert told in story
    assert result["program"].rstrip() in story
    assert "success 100.0 % (92.9 to 100.0) of 50 episodes, 95 % interval" in story


def test_evaluate_repeats_the_figures_of_the_synthesis(command: Command, program: Path, tmp_path: Path) -> None:
    report = tmp_path / "e.json"
    assert command("evaluate", program, "--task", TASK, "--episodes", 40, "--seed", 0, "--json", report) == 0
    result = json.loads(report.read_text())
    assert set(result) == {
        "task", "success", "episodes", "ci_low", "ci_high", "failing", "env_steps", "wall_seconds",
    }  # fmt: skip
    figures = json.loads((program / "manifest.json").read_text())["figures"]
    assert (result["success"], result["env_steps"]) == (figures["success"], figures["control_steps"])


def test_an_edited_program_runs(command: Command, program: Path, tmp_path: Path) -> None:
    """Another threshold and another variable's name: block v is placed anywhere within 20 cm, so it is not solved."""
    edited = tmp_path / "edited"
    shutil.copytree(program, edited)
    text = (edited / "program.txt").read_text()
    before, at = text.split("  at(b)")
    assert "‖b↓xz − g(b)↓xz‖" in at
    (edited / "program.txt").write_text(
        before.replace("λb:block", "λv:block").replace("b :=", "v :=").replace("(μ, b", "(μ, v").replace("g(b)", "g(v)")
        .replace("at(b)", "at(v)").replace("− b↓", "− v↓") + "  at(v) ≡ ‖v↓xz − g(v)↓xz‖ < 0.02\n"
    )  # fmt: skip
    report = tmp_path / "e.json"
    assert command("evaluate", edited, "--task", TASK, "--episodes", 20, "--json", report) == 0
    assert json.loads(report.read_text())["success"] == 1.0


def test_render_writes_a_video(command: Command, program: Path, tmp_path: Path) -> None:
    assert command("render", program, "--task", TASK, "--out", tmp_path / "v.gif") == 0
    assert (tmp_path / "v.gif").read_bytes().startswith(b"GIF89a")


def test_failing_episodes_are_named_and_filmed(
    command: Command, program: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A program that never takes hold of anything fails in every episode."""
    edited = tmp_path / "edited"
    shutil.copytree(program, edited)
    text = (edited / "program.txt").read_text()
    head, hold = text.split("  hold(")
    (edited / "program.txt").write_text(f"{head}  hold({hold.split('<')[0]}< 0.000001\n  at(b){hold.split('at(b)')[1]}")
    report = tmp_path / "e.json"
    assert command("evaluate", edited, "--episodes", 2, "--json", report) == 0
    assert json.loads(report.read_text())["failing"] == [0, 1]
    assert "failing episodes: 0, 1" in capsys.readouterr().out
    assert command("render", edited, "--failing", "--episode", 2, "--out", tmp_path / "v.gif") == 0
    assert "v.gif: episode 2, 0 solved" in capsys.readouterr().out


def test_row_12_fail_has_exit_code_3(command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Row 12: demonstrations that never reach the goal."""
    shown = [failing(each) for each in POINT_TASKS[TASK].demonstrate(4, 0)]
    demos = write(tmp_path / "d.parquet", shown)
    assert command("synthesize", TASK, "--demos", demos, "--engine", "local") == 3
    assert "FAIL: none of the 4 demonstrations" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["synthesize", "nowhere"], "unknown task 'nowhere'"),
        (["synthesize", "pick-place-1", "--contact", "soft"], "unknown contact model 'soft'"),
        (["synthesize", TASK, "--profile", "all"], "'all'"),
        (["synthesize", TASK, "--demos", "/nowhere.parquet"], "/nowhere.parquet: cannot be read"),
        (["synthesize", TASK, "--seed", "-1"], "--seed"),
        (
            ["synthesize", "pick-place-1", "--profile", "scripted", "--engine", "local"],
            "pick-place-1 brings no controllers",
        ),
        (["synthesize"], "TASK"),
        (["evaluate", "/nowhere", "--task", TASK], "/nowhere: does not exist"),
        (["evaluate", "0" * 32, "--task", TASK], "there is no tracking store"),
        (["render", "/nowhere", "--out", "v.avi"], "v.avi: found suffix '.avi', expected .mp4 or .gif"),
        (["render", "/nowhere", "--grid", "9"], "grid '9': expected columns x rows"),
        (["diff", "/nowhere", "tower-5"], "run /nowhere: there is nothing of this name"),
        (["demos", TASK, "--out", "/proc/nowhere/d.parquet"], "/proc/nowhere/d.parquet"),
        (["demos", "pick-place-1", "--style", "quick", "--out", "d.parquet"], "unknown style 'quick'"),
        (["demos", TASK, "--style", "slow", "--out", "d.parquet"], f"{TASK} has its own demonstrator"),
        (["demos", TASK, "--failing", "0.7", "--out", "d.parquet"], "--failing"),
        (["nonsense"], "nonsense"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    command: Command, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert command(*arguments) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: ")
    assert said in message
    assert message.count("\n") == 1


def test_actions_cannot_be_learned_from_states(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = [Trajectory(each.layout, each.states) for each in POINT_TASKS[TASK].demonstrate(4, 0)]
    demos = write(tmp_path / "d.parquet", shown)
    assert command("synthesize", TASK, "--demos", demos, "--profile", "actions", "--engine", "local") == 2
    assert "found no actions, expected them for profile actions" in capsys.readouterr().err


def test_a_broken_program_is_shown_where_it_breaks(
    command: Command, program: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edited = tmp_path / "edited"
    shutil.copytree(program, edited)
    (edited / "program.txt").write_text("def P(μ : EE): __import__('os')\n")
    assert command("evaluate", edited, "--task", TASK) == 2
    assert "line 1" in capsys.readouterr().err


def test_row_20_names_in_reports_are_no_markup(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    """Row 20: what a user types is printed as it is."""
    assert command("evaluate", "[bold red]x[/]\x1b]0;title\x07", "--task", TASK) == 2
    assert "[bold red]x[/]" in capsys.readouterr().err
