"""Several seeds at once: one table, one run of MLflow above them, and nothing done twice."""

from __future__ import annotations

from pathlib import Path

import pytest
from mlflow import MlflowClient

from roboscribe.io.tracked import database_uri
from roboscribe.pipelines.seed_sweep import SeedSweep, summary
from roboscribe.pipelines.workspace import Workspace
from tests.pipelines.runs import scripted
from tests.pipelines.stores import empty_store


def test_two_seeds_and_a_task_that_has_no_program(tmp_path: Path) -> None:
    empty_store(tmp_path / "mlruns")
    sweep = SeedSweep(scripted(), (0, 1), 2, "local", Workspace(tmp_path), tmp_path / "out")
    told: list[str] = []
    outcomes = sweep.run(told.append)
    assert [outcome.code for outcome in outcomes] == [0, 0], outcomes
    assert sorted(line.split(":")[0] for line in told[1:]) == ["seed 0", "seed 1"]
    assert (tmp_path / "out" / "seed-1" / "program.txt").is_file()
    assert len(summary(outcomes)) == 4
    run_id = sweep.track(outcomes)
    client = MlflowClient(database_uri(tmp_path / "mlruns"))
    assert run_id is not None
    assert client.get_run(run_id).data.metrics["success"] == 1.0
    below = [client.get_run(str(outcome.result["mlflow_run_id"])) for outcome in outcomes]
    assert [run.data.tags["mlflow.parentRunId"] for run in below] == [run_id, run_id]
    failing = SeedSweep(scripted(task="no-such-task"), (0,), 1, "local", Workspace(tmp_path))
    (outcome,) = failing.run(told.append)
    assert outcome.code == 2
    assert "unknown task" in str(outcome.result["reason"])


def test_a_seed_that_was_killed_is_no_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that a signal ended has a negative code; a sweep ends with what a shell would have told."""
    monkeypatch.setattr(SeedSweep, "_words", lambda *_: ["sh", "-c", "kill -9 $$"])
    (outcome,) = SeedSweep(scripted(), (0,), 1, "local", Workspace(tmp_path)).run(lambda _: None)
    assert outcome.code == 128 + 9
