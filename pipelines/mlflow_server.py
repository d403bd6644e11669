"""MLflow's interface on the loopback address."""

from __future__ import annotations

import os
import socket
import sys
from importlib.metadata import entry_points

from roboscribe.errors import RoboScribeError
from roboscribe.io.tracked import THEIRS, database_uri
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.tracking.mlflow_store import ARTIFACTS, synchronise

APP = "roboscribe"
"""Name of `mlflow_app` among MLflow's apps."""


def serve(workspace: Workspace, port: int) -> None:
    """Bring the store up to date and become MLflow's server; foreign hosts and origins are refused.

    Raises:
        RoboScribeError: the port is taken, or the user has a server of their own.
    """
    _check_free(port)
    synchronise(workspace.data / "runs", workspace.mlruns)
    theirs = os.environ.get(THEIRS)
    if theirs:
        msg = f"{THEIRS} names {theirs}, which is up to date now; expected no store but {workspace.mlruns} to show"
        raise RoboScribeError(msg)
    os.environ["MLFLOW_SERVER_ENABLE_JOB_EXECUTION"] = "false"  # workers for what is not used here
    own = [f"127.0.0.1:{port}", f"localhost:{port}"]
    command = [sys.executable, "-m", "mlflow", "ui", "--host", "127.0.0.1", "--port", str(port)]
    command += ["--backend-store-uri", database_uri(workspace.mlruns), "--workers", "1"]
    command += ["--default-artifact-root", (workspace.mlruns / ARTIFACTS).resolve().as_uri()]
    if entry_points(group="mlflow.app", name=APP):  # else the package was installed before it had this
        command += ["--app-name", APP]
    command += ["--allowed-hosts", ",".join(own)]
    command += ["--cors-allowed-origins", ",".join(f"http://{host}" for host in own)]
    os.execv(sys.executable, command)


def _check_free(port: int) -> None:
    """Refuse a port on which someone listens: MLflow would try for ever.

    Raises:
        RoboScribeError: it is taken.
    """
    try:
        socket.create_server(("127.0.0.1", port)).close()
    except OSError as error:
        msg = f"port {port}: cannot be listened on ({error.strerror}), expected a free one; --port N names another"
        raise RoboScribeError(msg) from error
