"""Every stage runs on its own, from the command line."""

from __future__ import annotations

import inspect
import json
import re
import shlex
import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from roboscribe.stages import classify, collect, ingest
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.configuration import decode
from roboscribe.stages.runtime.stage_help import example, input_names
from roboscribe.stages.runtime.store import Stage

NAMES = (
    "collect", "ingest", "generate", "train", "roll_out", "classify", "update_tree", "validate", "evaluate",
    "package", "film", "transfer",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    stage = import_module(f"roboscribe.stages.{name}").STAGE
    assert isinstance(stage, Stage)
    assert stage.name == name
    with pytest.raises(SystemExit) as ended:
        cli.main(stage, ["--help"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert f"python -m roboscribe.stages.{name}" in told
    source = inspect.getsource(sys.modules[stage.run.__module__])
    read = set(re.findall(r'inputs\["(\w+)"\]', source))
    assert read <= set(input_names(stage)), "an input that its documentation does not name"
    for each in input_names(stage):
        assert f"--input {each}=PATH" in told
    assert "task.contact = " in told or name == "update_tree"


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_the_help_gives_all_that_has_to_be_given(name: str) -> None:
    stage = import_module(f"roboscribe.stages.{name}").STAGE
    words = shlex.split(example(stage))
    given = words[words.index("--config") + 1] if "--config" in words else "{}"
    assert isinstance(decode(stage.config, json.loads(given)), stage.config)


def test_what_is_missing_in_an_input_is_not_called_a_missing_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(config: object, inputs: Mapping[str, Path], out: Path, report: object) -> None:
        """Look for something in an input.

        Inputs:
            tree: where.
        """
        assert {"at": inputs["tree"]}["hold"]

    stage = replace(classify.STAGE, run=run)
    words = ["--config", json.dumps({"task": {"name": "tower-5"}, "goal": "at"}), "--out", str(tmp_path)]
    assert cli.main(stage, words) == 2
    assert "needs --input tree=PATH" in capsys.readouterr().err
    assert cli.main(stage, [*words, "--input", "tree=x"]) == 2
    assert "found no 'hold' in what it was given" in capsys.readouterr().err


def test_two_stages_by_hand(tmp_path: Path) -> None:
    task = {"name": "point-pick-place-1"}
    config = json.dumps({"task": task, "n_demonstrations": 3, "seed": 1})
    assert cli.main(collect.STAGE, ["--config", config, "--out", str(tmp_path / "a")]) == 0
    given = f"demonstrations={tmp_path / 'a' / 'demonstrations.parquet'}"
    (tmp_path / "config.json").write_text(json.dumps({"task": task}))
    settings = ["--config", str(tmp_path / "config.json"), "--input", given, "--out", str(tmp_path / "b")]
    assert cli.main(ingest.STAGE, settings) == 0
    assert json.loads((tmp_path / "b" / "report.json").read_text())["kept"] == 3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--config", "{"], "Expecting property name"),
        (["--config", '{"task": {"name": "nowhere"}}', "--input", "demonstrations=x"], "unknown task 'nowhere'"),
        (["--config", '{"task": {"name": "point-pick-place-1"}}'], "needs --input demonstrations=PATH"),
        (["--config", '{"task": {"name": "point-pick-place-1"}}', "--input", "x"], "expected NAME=PATH"),
        (["--config", '{"task": "point-pick-place-1"}'], "expected an object with name, contact, timing"),
        (["--config", "/nowhere/config.json"], "No such file"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert cli.main(ingest.STAGE, [*arguments, "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1
