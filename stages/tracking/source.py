"""Who ran what: tags by which MLflow shows user, source and commit of a run."""

from __future__ import annotations

import getpass
import os

from roboscribe.io.atomic import sha256_of
from roboscribe.stages.runtime.code_version import ROOT

LOCK = "requirements.lock"


def source_tags(command: str, commit: str) -> dict[str, str]:
    """Return the tags.

    Args:
        command: the command line that makes the run.
        commit: of the checkout, "-dirty" behind it where its files differ; "" where there is none.
    """
    tags = {"mlflow.user": _user(), "mlflow.source.name": command, "mlflow.source.type": "LOCAL"}
    if commit:
        tags |= {"mlflow.source.git.commit": commit.removesuffix("-dirty"), "roboscribe.commit": commit}
    lock = ROOT / LOCK
    return {**tags, "roboscribe.lock_sha256": sha256_of(lock)} if lock.is_file() else tags


def _user() -> str:
    """Return who is at work; a container may know no name."""
    try:
        return os.environ.get("MLFLOW_TRACKING_USERNAME") or getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())
