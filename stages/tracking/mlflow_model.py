"""Saved programs as models of MLflow: with a signature, an example, and the run that found them."""

from __future__ import annotations

import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roboscribe.io.columns import columns_of
from roboscribe.io.tracked import tracking_uri
from roboscribe.policy import load
from roboscribe.world.task import Task

if TYPE_CHECKING:
    import pandas as pd
    from mlflow import MlflowClient
    from mlflow.models import ModelSignature

CODE = Path(__file__).with_name("program_model.py")
NAME, FILES, RESET = "policy", "program", "reset"
"""Name of the model, which must not be that of an artifact of the run; of its program's directory; of a parameter."""
KIND = "robot program"


def model_of(client: MlflowClient, run_id: str) -> str | None:
    """Return the id of a run's model, None where it has none."""
    outputs = client.get_run(run_id).outputs
    found = [] if outputs is None else list(outputs.model_outputs)
    return str(found[-1].model_id) if found else None


def log_program(client: MlflowClient, run_id: str, directory: Path) -> str:
    """Log a saved program as the model of a run, once.

    Args:
        client: open on the store.
        run_id: of the run that found it.
        directory: of the program.

    Returns:
        The model's id.

    Raises:
        RoboScribeError: the program's task cannot be built here, so that nobody knows what it observes.
    """
    known = model_of(client, run_id)
    if known is not None:
        return known
    from mlflow.entities import LoggedModelOutput

    run = client.get_run(run_id).info
    with tempfile.TemporaryDirectory() as scratch:
        local = Path(scratch) / NAME
        save_model(directory, local)
        made = client.create_logged_model(run.experiment_id, NAME, run_id, model_type=KIND)
        client.log_model_artifacts(made.model_id, str(local))
    client.finalize_logged_model(made.model_id, "READY")
    client.log_outputs(run_id, [LoggedModelOutput(made.model_id, 0)])
    return str(made.model_id)


def save_model(directory: Path, target: Path) -> None:
    """Save a program as a model of MLflow, weights as safetensors, code as text.

    Raises:
        RoboScribeError: the program's task cannot be built here.
    """
    from mlflow.pyfunc import save_model as save

    task = load(directory).task
    save(
        str(target),
        python_model=str(CODE),
        artifacts={FILES: str(directory)},
        signature=_signature(task),
        input_example=_example(task),
        pip_requirements=[_requirement()],
    )


def register_run(mlruns: Path, run_id: str, name: str) -> str | None:
    """Make the model of a run of a store a version of a registered model; see `register`."""
    from mlflow import MlflowClient

    return register(MlflowClient(tracking_uri(mlruns)), run_id, name)


def register(client: MlflowClient, run_id: str, name: str) -> str | None:
    """Make a run's model a version of a registered model, once.

    Args:
        client: open on the store.
        run_id: of the run.
        name: of the registered model, which is made where there is none.

    Returns:
        The version; None where the run has no model.
    """
    from mlflow.exceptions import MlflowException

    model = model_of(client, run_id)
    if model is None:
        return None
    try:
        client.create_registered_model(name)
    except MlflowException as error:
        if error.error_code != "RESOURCE_ALREADY_EXISTS":
            raise
    known = [found for found in client.search_model_versions(f"name='{name}'") if found.run_id == run_id]
    if known:
        return str(known[0].version)
    place = client.get_logged_model(model).artifact_location  # "models:/…" would be looked up in another store
    return str(client.create_model_version(name, place, run_id).version)


def _signature(task: Task) -> ModelSignature:
    """Say what goes in and comes out: the columns of a state, and actions from -1 to 1."""
    from mlflow.models import ModelSignature
    from mlflow.types.schema import ColSpec, DataType, ParamSchema, ParamSpec, Schema

    observed = Schema([ColSpec(DataType.double, name) for name in _columns(task)])
    chosen = Schema([ColSpec(DataType.double, f"action[{number}]") for number in range(task.action_size)])
    return ModelSignature(observed, chosen, ParamSchema([ParamSpec(RESET, DataType.boolean, default=True)]))


def _columns(task: Task) -> list[str]:
    """Name every number of a state, "mu.position.x" for instance."""
    return [column.component(i) for column in columns_of(task.layout) for i in range(column.attribute.width)]


def _example(task: Task) -> pd.DataFrame:
    """Return the first observation of an episode."""
    import pandas as pd

    state = task.world(1).reset(np.zeros(1, np.int64), np.zeros(1, np.int64))
    return pd.DataFrame(state, columns=_columns(task))


def _requirement() -> str:
    """Name this package as pip knows it."""
    try:
        return f"roboscribe=={version('roboscribe')}"
    except PackageNotFoundError:
        return "roboscribe"
