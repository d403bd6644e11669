"""Success against the strength of disturbances: what is measured, shown, drawn, refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from roboscribe.envs.catalogue import make_task
from roboscribe.errors import TaskError
from roboscribe.pipelines.disturbing import Measured, draw, lines, possible, sweep
from roboscribe.policy import load
from tests.pipelines.runs import Command


def test_a_task_has_the_kinds_that_it_can_have() -> None:
    assert possible(make_task("point-pick-place-1"), ()) == ("noise", "delay")
    assert "knock" not in possible(make_task("pick-place-1"), ())
    assert possible(make_task("tower-2"), ("knock",)) == ("knock",)
    with pytest.raises(TaskError, match="cannot be disturbed by knock"):
        possible(make_task("pick-place-1"), ("noise", "knock"))


def test_success_falls_with_noise() -> None:
    policy = load("pick-place-1")
    found = sweep(policy.runnable, policy.task, ("noise",), 0, 8)
    assert [each.strength for each in found] == [0.0, 0.0025, 0.005, 0.01, 0.02]
    assert found[0].success == 1.0
    assert found[-1].success < found[1].success


def test_a_strength_is_spelled_with_its_unit() -> None:
    found = [Measured(kind, 0.5, 4, 0.5, 0.1, 0.9) for kind in ("noise", "friction", "push", "knock")]
    assert [line[1] for line in lines(found)] == ["500 mm", "x 0.5", "0.5 m/s", "0.5"]


def test_the_figure_is_the_same_each_time() -> None:
    found = [Measured("noise", s, 4, 0.5, 0.1, 0.9) for s in (0.0, 1.0)]
    found += [Measured("mass", s, 4, 1.0, 0.5, 1.0) for s in (0.5, 1.0)]
    assert draw({"a": found, "b": found[:2]}) == draw({"a": found, "b": found[:2]})


def test_the_command_writes_table_figure_and_json(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, told = tmp_path / "a.png", tmp_path / "a.json"
    asked = ("disturb", "pick-place-1", "--kind", "delay", "--episodes", "2", "--out", str(out), "--json", str(told))
    assert command(*asked) == 0
    assert "2 control steps" in capsys.readouterr().out
    assert out.read_bytes().startswith(b"\x89PNG")
    assert len(json.loads(told.read_text())["programs"]["pick-place-1"]) == 4
    assert command("disturb", "pick-place-1", "--out", str(tmp_path / "a.txt")) == 2
