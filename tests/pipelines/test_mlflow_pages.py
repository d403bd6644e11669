"""MLflow's pages, looked at in a real browser: what a user sees of a run."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
from mlflow import MlflowClient

from roboscribe.io.tracked import database_uri
from roboscribe.pipelines.mlflow_app import HEAD, SCRIPT, edited
from roboscribe.pipelines.mlflow_server import APP
from tests.pipelines.browser import needs_browser, seen, serving
from tests.pipelines.runs import tracked

needs_app = pytest.mark.skipif(
    not entry_points(group="mlflow.app", name=APP),
    reason="the package was installed before it had MLflow's entry point: pip install --editable .",
)


def test_the_line_stands_first_in_the_page() -> None:
    start = {"type": "http.response.start", "status": 200, "headers": [(b"Content-Length", b"7")]}
    parts: list[dict[str, Any]] = [{"body": b"<html><he", "more_body": True}, {"body": b"ad></head></html>"}]
    first, second = edited([start, *parts])
    assert second["body"] == b"<html>" + HEAD + SCRIPT + b"</head></html>"
    assert first["headers"] == [(b"content-length", str(len(second["body"])).encode())]


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a home with one run that is tracked."""
    return tracked(tmp_path_factory.mktemp("home"))


@pytest.fixture(scope="module")
def address(home: Path) -> Iterator[str]:
    """Serve a home as `roboscribe ui` does."""
    words = [sys.executable, "-m", "roboscribe.pipelines.cli", "ui", "--home", str(home)]
    with serving(lambda port: [*words, "--port", str(port)], "/health", home / "ui.log") as address:
        yield address


@needs_browser
@needs_app
def test_an_experiment_opens_in_the_view_for_training(address: str, home: Path, tmp_path: Path) -> None:
    experiment = MlflowClient(database_uri(home / "mlruns")).get_experiment_by_name("point-pick-place-1")
    assert experiment is not None
    text = seen(f"{address}/#/experiments/{experiment.experiment_id}", tmp_path)
    assert "Model registry" in text
    assert "Programs learned for" in text
    assert "demonstrations (" in text
    for word in ("Evaluation runs", "Agent versions", "Prompts"):
        assert word not in text


@needs_browser
@needs_app
def test_a_run_shows_its_program_and_who_made_it(address: str, home: Path, tmp_path: Path) -> None:
    client = MlflowClient(database_uri(home / "mlruns"))
    experiment = client.get_experiment_by_name("point-pick-place-1")
    assert experiment is not None
    (found,) = client.search_runs([experiment.experiment_id], "params.kind = 'synthesis'")
    text = seen(f"{address}/#/experiments/{experiment.experiment_id}/runs/{found.info.run_id}", tmp_path)
    assert "success 100.0 %" in text
    assert "def PointPickPlace1(μ : EE):" in text
    assert found.data.tags["mlflow.user"] in text
    assert "roboscribe synthesize point-pick-place-1" in text
    assert "policy" in text, "the model"
    assert "Evaluation runs" not in text
