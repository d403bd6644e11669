"""What a journal says about files, copied into MLflow: artifacts, tables, pictures, data sets and models."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from roboscribe.errors import RoboScribeError
from roboscribe.stages.runtime.journal import Record

if TYPE_CHECKING:
    from mlflow import MlflowClient

KINDS = ("artifact", "artifacts", "table", "picture", "dataset", "model")
"""Kinds of records that name a file or a directory."""
log = logging.getLogger(__name__)


def copy_file(client: MlflowClient, run_id: str, record: Record) -> None:
    """Copy what a record names; copying it twice changes nothing.

    Args:
        client: open on the store.
        run_id: where it belongs.
        record: of the journal; one that names no file is passed over.
    """
    path, kind = Path(str(record["value"])), record["kind"]
    if kind in KINDS and not path.exists():
        log.warning("%s is gone; it is not copied", path)
        return
    match kind:
        case "artifact":
            client.log_artifact(run_id, str(path), str(record.get("folder") or "") or None)
        case "artifacts":
            client.log_artifacts(run_id, str(path), str(record["key"]))
        case "table":
            _table(client, run_id, path)
        case "picture":
            _picture(client, run_id, path)
        case "dataset":
            _dataset(client, run_id, path)
        case "input":
            _digest(client, run_id, str(record["value"]))
        case "model":
            _model(client, run_id, path)
        case _:  # figures, parameters and states, which name no file
            return


def _table(client: MlflowClient, run_id: str, path: Path) -> None:
    """Copy a table so that MLflow's interface shows it as one."""
    tag = "mlflow.loggedArtifacts"
    client.log_artifact(run_id, str(path))
    listed = client.get_run(run_id).data.tags.get(tag, "[]")
    entry = f'{{"path": "{path.name}", "type": "table"}}'
    if entry not in listed:
        client.set_tag(run_id, tag, f"{listed[:-1]}{', ' if len(listed) > 2 else ''}{entry}]")


def _picture(client: MlflowClient, run_id: str, path: Path) -> None:
    """Draw a tree."""
    from roboscribe.stages.runtime.serialization import read_tree
    from roboscribe.stages.tracking.tree_picture import draw_tree

    with tempfile.TemporaryDirectory() as scratch:
        picture = Path(scratch) / "tree.png"
        draw_tree(read_tree(path), picture)
        client.log_artifact(run_id, str(picture))


def _digest(client: MlflowClient, run_id: str, digest: str) -> None:
    """Note what was learned from where only its SHA-256 is known."""
    from mlflow.entities import Dataset, DatasetInput, InputTag

    dataset = Dataset(name="demonstrations", digest=digest[:36], source_type="local", source=digest)
    client.log_inputs(run_id, [DatasetInput(dataset, [InputTag("mlflow.data.context", "training")])])


def _dataset(client: MlflowClient, run_id: str, path: Path) -> None:
    """Note what was learned from, where it lies and what it holds."""
    from roboscribe.stages.tracking.mlflow_dataset import dataset_input

    client.log_inputs(run_id, [dataset_input(path)])


def _model(client: MlflowClient, run_id: str, path: Path) -> None:
    """Keep a program as a model; one whose task cannot be built here is kept as files only."""
    from roboscribe.stages.tracking.mlflow_model import log_program

    try:
        log_program(client, run_id, path)
    except RoboScribeError as error:
        log.warning("%s becomes no model: %s", path, error)
