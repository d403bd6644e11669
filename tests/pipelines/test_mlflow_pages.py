"""MLflow's pages, looked at in a real browser: what a user sees of a run."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPException
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
from mlflow import MlflowClient

from roboscribe.io.tracked import database_uri
from roboscribe.pipelines.mlflow_app import HEAD, SCRIPT, edited
from roboscribe.pipelines.mlflow_server import APP
from tests.pipelines.runs import tracked

BROWSER = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), "")
SECONDS = 90.0
needs_browser = pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine (Debian package: chromium)")
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
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
    words = [sys.executable, "-m", "roboscribe.pipelines.cli", "ui", "--port", str(port), "--home", str(home)]
    with (home / "ui.log").open("wb") as log:
        server = subprocess.Popen(words, stdout=log, stderr=log, start_new_session=True)
    try:
        deadline = time.monotonic() + SECONDS
        while not answers(port):
            assert server.poll() is None, (home / "ui.log").read_text()
            assert time.monotonic() < deadline, (home / "ui.log").read_text()
            time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        os.killpg(server.pid, 15)
        server.wait(20)


def answers(port: int) -> bool:
    """Whether MLflow is there."""
    connection = HTTPConnection("127.0.0.1", port, timeout=1.0)
    try:
        connection.request("GET", "/health")
        return connection.getresponse().status == 200
    except (HTTPException, OSError):
        return False
    finally:
        connection.close()


def seen(page: str, profile: Path) -> str:
    """Return the text of a page in a browser that was never here before."""
    words = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
    words += ["--window-size=1500,1000", "--virtual-time-budget=30000", "--dump-dom", page]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS)
    return re.sub(r"<(script|style).*?</\1>|<[^>]+>", " ", ended.stdout, flags=re.DOTALL)


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
