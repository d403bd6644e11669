"""Programs that MLflow keeps, found by the id of the run that made them. MLflow is imported only where it is asked."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from roboscribe.errors import ArtifactError

RUN_ID = re.compile(r"[0-9a-f]{32}")
THEIRS = "MLFLOW_TRACKING_URI"
"""Variable by which a user names a store of their own."""
HOME = "ROBOSCRIBE_HOME"
"""Variable that says where `mlruns/` lies; the working directory where it says nothing."""
DATABASE = "mlflow.db"
PROGRAM = "program"
"""Under which a run keeps its program."""
QUIET = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "DO_NOT_TRACK": "true",
    "MLFLOW_ALLOW_PICKLE_DESERIALIZATION": "false",
}
USUAL = {
    "GIT_PYTHON_REFRESH": "quiet",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_LOGGING_LEVEL": "WARNING",
}
"""Settings of MLflow that a user may have made otherwise."""


def quiet_mlflow() -> None:
    """Keep MLflow from telling strangers, from pickles, and from talking; before it is imported."""
    os.environ.update(QUIET)
    for name, value in USUAL.items():
        os.environ.setdefault(name, value)


def is_run_id(name: str | Path) -> bool:
    """Whether a name looks like the id of a run, and nothing lies under it."""
    return bool(RUN_ID.fullmatch(str(name))) and not Path(name).exists()


def usual_mlruns() -> Path:
    """Return the directory of the store that commands use."""
    return Path(os.environ.get(HOME, "")) / "mlruns"


def database_uri(mlruns: Path) -> str:
    """Return the address of the store in a directory."""
    return f"sqlite:///{(mlruns / DATABASE).resolve()}"


def tracking_uri(mlruns: Path) -> str:
    """Return the address of the store: a tracking server that the user names, else the database in a directory."""
    return os.environ.get(THEIRS) or database_uri(mlruns)


def has_store(mlruns: Path) -> bool:
    """Whether there is a store to ask."""
    return bool(os.environ.get(THEIRS)) or (mlruns / DATABASE).exists()


@contextmanager
def tracked_program(run_id: str, mlruns: Path) -> Iterator[Path]:
    """Copy the program of a run out of the store, for the time being.

    Args:
        run_id: MLflow's.
        mlruns: directory of the store, unless the user names another one.

    Raises:
        ArtifactError: there is no store, no such run, or it has no program.
    """
    if not has_store(mlruns):
        msg = f"program {run_id}: looks like an MLflow run id, but there is no tracking store {mlruns / DATABASE}"
        raise ArtifactError(msg)
    quiet_mlflow()
    from mlflow import MlflowClient
    from mlflow.exceptions import MlflowException

    uri = tracking_uri(mlruns)
    with tempfile.TemporaryDirectory() as scratch:
        try:
            found = Path(MlflowClient(uri).download_artifacts(run_id, PROGRAM, scratch))
        except (MlflowException, OSError) as error:
            msg = f"program {run_id}: the tracking store {uri} has no program of this run ({error})"
            raise ArtifactError(msg.splitlines()[0]) from error
        yield found
