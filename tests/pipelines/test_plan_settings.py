"""Settings on the command line and in files: every field by its name, errors in one line, and back again."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from roboscribe.errors import ArtifactError, TaskError
from roboscribe.io.atomic import Json
from roboscribe.pipelines.seed_sweep import Outcome, parse_seeds, summary
from roboscribe.pipelines.synthesis_pipeline import command
from roboscribe.rl.config import SacConfig, TrainConfig
from roboscribe.stages.runtime.configuration import encode, flattened
from roboscribe.stages.runtime.plan_file import read_settings, to_plan, to_toml, with_setting
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.steps import Limits
from tests.pipelines.runs import Command, scripted

TASK = "point-pick-place-1"
PLANS = [
    SynthesisPlan(TaskConfig(TASK)),
    SynthesisPlan(TaskConfig('odd "name" μ'), 3, "states", Path("my demos.parquet"), limits=Limits(success=0.5)),
    SynthesisPlan(TaskConfig(TASK), training=TrainConfig(learner=SacConfig(hidden=(8, 8)), budget=7), video=False),
    scripted(),
]


@pytest.mark.parametrize("plan", PLANS)
def test_a_plan_survives_its_file(plan: SynthesisPlan, tmp_path: Path) -> None:
    (tmp_path / "config.toml").write_text(to_toml(plan))
    assert to_plan(read_settings(tmp_path / "config.toml")) == plan


@pytest.mark.parametrize("name", [n for n, v in flattened(encode(PLANS[0])).items() if type(v) in (int, float)])
def test_every_number_can_be_set(name: str) -> None:
    """And is then what a run reports, under the same name."""
    settings = with_setting({"task": {"name": TASK}}, f"{name}=1")
    assert flattened(encode(to_plan(settings)))[name] == 1


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("training.bugdet=3", "settings.training: found 'bugdet', expected .*; did you mean budget?"),
        ("training.budget=many", "settings.training.budget: found 'many', expected int"),
        ("training.learner.worlds=1.5", "settings.training.learner.worlds: found 1.5, expected int"),
        ("profile=all", "settings.profile: found 'all', expected 'actions' or 'states'"),
        ("budget", "--set budget: found no assignment"),
        ("a b=3", "found no assignment"),
    ],
)
def test_a_setting_that_is_none_is_refused(assignment: str, message: str) -> None:
    with pytest.raises(ArtifactError, match=message.replace("?", r"\?")):
        to_plan(with_setting({"task": {"name": TASK}}, assignment))


def test_a_file_that_is_no_toml_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("seed = = 3")
    with pytest.raises(ArtifactError, match="cannot be read as settings"):
        read_settings(tmp_path / "bad.toml")


def test_the_command_line_of_a_run_says_all_that_differs() -> None:
    plan = replace(PLANS[0], rollout_episodes=7, training=TrainConfig(target=0.5), video=False)
    assert command(plan, "actions") == (
        f"roboscribe synthesize {TASK} --seed 0 --profile actions"
        " --set rollout_episodes=7 --set training.target=0.5 --set video=false"
    )


def test_options_go_before_the_file_and_settings_before_both(command: Command, tmp_path: Path) -> None:
    file, home = tmp_path / "plan.toml", tmp_path / "home"
    few = 'n_demonstrations = 12\nrollout_episodes = 20\nvideo = false\nprofile = "scripted"\nseed = 4\n'
    file.write_text(f'{few}evaluation_episodes = 9\n[task]\nname = "{TASK}"\n')
    words = ("--config", file, "--seed", 1, "--episodes", 8, "--set", "evaluation_episodes=7", "--engine", "local")
    assert command("synthesize", *words, "--json", tmp_path / "told.json", "--quiet") == 0
    told = json.loads((tmp_path / "told.json").read_text())
    assert (told["seed"], told["episodes"], told["profile"]) == (1, 7, "scripted")
    (kept,) = (home / "data" / "runs").glob("*/config.toml")
    written = tomllib.loads(kept.read_text())
    assert (written["seed"], written["rollout_episodes"], written["evaluation_episodes"]) == (1, 20, 7)


@pytest.mark.parametrize(
    ("text", "seeds"), [("0-4", (0, 1, 2, 3, 4)), ("3", (3,)), ("0,2,5", (0, 2, 5)), ("1-2,2,7", (1, 2, 7))]
)
def test_seeds(text: str, seeds: tuple[int, ...]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "4-1", "a", "1;2", "-1", "0-99999999"])
def test_what_is_no_seeds_is_refused(text: str) -> None:
    with pytest.raises(TaskError, match="expected 0-4, or 0,2,5"):
        parse_seeds(text)


def test_the_table_of_a_sweep() -> None:
    rates: dict[str, Json] = {"success": 0.9, "ci_low": 0.8, "ci_high": 1.0}
    solved: dict[str, Json] = {**rates, "refinements": 2, "env_steps": 5, "program_dir": "/p"}
    outcomes = [Outcome(0, 0, {"seed": 0, **solved, "wall_seconds": 1.6}), Outcome(1, 3, {"seed": 1, "reason": "no"})]
    title, first, second, mean = summary(outcomes)
    assert title.split() == ["seed", "success", "refinements", "steps", "seconds", "program"]
    assert first.split() == ["0", "90.0", "%", "(80.0", "to", "100.0)", "2", "5", "2", "/p"]
    assert second.split() == ["1", "no"]
    assert mean == "mean success 90.0 % over 1 programs, 1 seeds without"


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("rollout_episodes=0", "rollout_episodes: found 0, expected at least 1"),
        ("limits.programs=0", "programs: found 0, expected at least 1"),
        ("evaluation_episodes=0", "evaluation_episodes: found 0, expected at least 1"),
    ],
)
def test_settings_out_of_range_are_refused_in_one_line(
    setting: str, told: str, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("synthesize", TASK, "--set", setting, "--engine", "local") == 2
    assert told in capsys.readouterr().err
