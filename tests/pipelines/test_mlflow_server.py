"""Row 22: MLflow's interface listens on the loopback address only and refuses foreign hosts and origins."""

from __future__ import annotations

from pathlib import Path

import pytest

from roboscribe.pipelines.mlflow_server import serve
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.tracking.mlflow_store import database_uri
from tests.pipelines.stores import empty_store


def test_row_22_the_interface_is_local(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[list[str]] = []
    monkeypatch.setattr("os.execv", lambda path, command: started.append(command))
    empty_store(tmp_path / "mlruns")
    serve(Workspace(tmp_path), 5077)
    (command,) = started
    options = dict(zip(command[4::2], command[5::2], strict=True))
    assert command[1:4] == ["-m", "mlflow", "ui"]
    assert options["--host"] == "127.0.0.1"
    assert options["--allowed-hosts"] == "127.0.0.1:5077,localhost:5077"
    assert options["--cors-allowed-origins"] == "http://127.0.0.1:5077,http://localhost:5077"
    assert options["--backend-store-uri"] == database_uri(tmp_path / "mlruns")
