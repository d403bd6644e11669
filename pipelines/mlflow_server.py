"""MLflow's interface on the loopback address."""

from __future__ import annotations

import os
import sys

from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.tracking.mlflow_store import ARTIFACTS, database_uri, synchronise


def serve(home: Workspace, port: int) -> None:
    """Bring the store up to date and become MLflow's server; foreign hosts and origins are refused."""
    synchronise(home.data / "runs", home.mlruns)
    os.environ["MLFLOW_SERVER_ENABLE_JOB_EXECUTION"] = "false"  # workers for what is not used here
    own = [f"127.0.0.1:{port}", f"localhost:{port}"]
    command = [sys.executable, "-m", "mlflow", "ui", "--host", "127.0.0.1", "--port", str(port)]
    command += ["--backend-store-uri", database_uri(home.mlruns), "--workers", "1"]
    command += ["--default-artifact-root", (home.mlruns / ARTIFACTS).resolve().as_uri()]
    command += ["--allowed-hosts", ",".join(own)]
    command += ["--cors-allowed-origins", ",".join(f"http://{host}" for host in own)]
    os.execv(sys.executable, command)
