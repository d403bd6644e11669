"""Row 22: MLflow's interface listens on the loopback address only and refuses foreign hosts and origins."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from roboscribe.errors import RoboScribeError
from roboscribe.io.tracked import database_uri
from roboscribe.pipelines.mlflow_server import serve
from roboscribe.pipelines.workspace import Workspace
from tests.pipelines.runs import run, scripted
from tests.pipelines.stores import empty_store, rows


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


def test_a_port_that_is_taken_is_refused_at_once(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
        with pytest.raises(RoboScribeError, match=f"port {port}: cannot be listened on .* --port N"):
            serve(Workspace(tmp_path), port)


def test_a_server_of_the_users_own_is_brought_up_to_date_and_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = database_uri(empty_store(tmp_path / "theirs"))
    monkeypatch.setenv("MLFLOW_TRACKING_URI", theirs)
    run(scripted(), tmp_path)
    with pytest.raises(RoboScribeError, match="up to date"):
        serve(Workspace(tmp_path), 5078)
    assert ("point-pick-place-1 seed 0", "FINISHED") in rows(tmp_path / "theirs", "select name, status from runs")
    assert not (tmp_path / "mlruns" / "mlflow.db").exists()
