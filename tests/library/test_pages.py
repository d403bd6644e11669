"""The pages of the documentation do what they say."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest

import roboscribe
from tests.library.pages import blocks, run_python
from tests.pipelines.conftest import command as command  # a fixture is found by its name
from tests.pipelines.runs import Command


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder whose modules can be imported."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "coins", raising=False)
    return tmp_path


def test_the_tutorial_leads_from_an_empty_folder_to_a_program(
    folder: Path, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    names = run_python("tutorial.md")
    found = names["found"]
    assert isinstance(found, roboscribe.Synthesis)
    assert "while (c := get(λc:coin. ¬at(c)))" in str(found)
    assert found.evaluation.success >= 0.9
    assert names["task"].solved(names["state"])
    capsys.readouterr()
    evaluate = blocks("tutorial.md", "console")[-1]
    assert command(*shlex.split(evaluate)[1:]) == 0
    assert "coins.py:Coins: success" in capsys.readouterr().out


@pytest.mark.slow
def test_the_command_of_the_tutorial_finds_a_program(folder: Path, command: Command) -> None:
    run_python("tutorial.md")
    synthesize = blocks("tutorial.md", "console")[0]
    assert command(*shlex.split(synthesize)[1:], "--engine", "local") == 0
    assert "while (c := get(λc:coin. ¬at(c)))" in (folder / "tidy-too" / "program.txt").read_text(encoding="utf-8")


def test_the_page_about_the_library_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = run_python("library.md")
    assert names["info"]["is_success"] == 1.0
    said = capsys.readouterr().out
    assert "π_at(μ, b, g(b)) until" in said
    assert "{'b': 'b1'}" in said
    assert said.count("pick-place-1: success") == 2
