"""What MLflow keeps of a run besides figures: who, from what, and a model that acts."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import mlflow
import numpy as np
import pytest
from mlflow import MlflowClient
from mlflow.entities import Run

import roboscribe
from roboscribe.errors import ArtifactError
from roboscribe.io.tracked import database_uri
from roboscribe.stages.tracking.mlflow_model import register
from roboscribe.stages.tracking.mlflow_store import KIND, KIND_TAG
from tests.pipelines.runs import tracked
from tests.pipelines.stores import points

LOAD = """
import json, sys
import mlflow
mlflow.set_tracking_uri(sys.argv[1])
model = mlflow.pyfunc.load_model(f"models:/{sys.argv[2]}")
actions = model.predict(model.input_example)
print(json.dumps([list(actions.columns), actions.to_numpy().tolist(), model.metadata.signature.to_dict()]))
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a home with one run that is tracked."""
    return tracked(tmp_path_factory.mktemp("home"))


@pytest.fixture
def client(home: Path) -> MlflowClient:
    return MlflowClient(database_uri(home / "mlruns"))


def parent(client: MlflowClient) -> Run:
    (experiment,) = client.search_experiments(filter_string="name = 'point-pick-place-1'")
    (found,) = client.search_runs([experiment.experiment_id], "params.kind = 'synthesis'")
    return found


def test_experiments_open_as_training_and_say_what_figures_are(client: MlflowClient) -> None:
    experiment = client.get_experiment_by_name("point-pick-place-1")
    assert experiment is not None
    assert experiment.tags[KIND_TAG] == KIND
    assert "| `env_steps` | control steps" in experiment.tags["mlflow.note.content"]


def test_a_run_says_who_what_and_from_which_commit(client: MlflowClient) -> None:
    tags = parent(client).data.tags
    assert tags["mlflow.source.name"].startswith("roboscribe synthesize point-pick-place-1 --seed 0")
    assert tags["mlflow.source.type"] == "LOCAL"
    assert tags["mlflow.user"]
    assert len(tags["roboscribe.lock_sha256"]) == 64
    note = tags["mlflow.note.content"]
    assert note.startswith("**success 100.0 %")
    assert "def PointPickPlace1(μ : EE):" in note
    assert "| 1 | ψ_R | hold |" in note
    assert note.count("| `‖") == 2


def test_the_whole_configuration_is_there(client: MlflowClient) -> None:
    params = parent(client).data.params
    assert params["training.pool.starts"] == "400"
    assert params["rollout_episodes"] == "20"
    assert params["limits.success"] == "0.97"


def test_the_success_of_every_program_is_a_curve_over_control_steps(home: Path, client: MlflowClient) -> None:
    found = parent(client)
    own = [(step, value) for name, step, value in points(home / "mlruns", "success") if name == found.info.run_name]
    assert [value for _, value in own] == [0.0, 0.0, 1.0, 1.0]
    figures = found.data.metrics
    assert own[-1][0] == figures["env_steps"] + figures["evaluation_steps"]
    assert own[-2][0] == figures["env_steps"]


def test_the_demonstrations_are_a_dataset_that_can_be_found_again(client: MlflowClient) -> None:
    given = parent(client).inputs
    assert given is not None
    (entry,) = given.dataset_inputs
    source = mlflow.data.get_source(entry)
    assert Path(source.load()).name == "demonstrations.parquet"
    columns = {column["name"]: column for column in json.loads(str(entry.dataset.schema))["mlflow_colspec"]}
    assert columns["mu.position"]["items"] == {"type": "double"}
    assert columns["mu.opening"]["type"] == "double"
    assert json.loads(str(entry.dataset.profile))["num_rows"] > 100


def test_the_model_acts_in_a_fresh_process(home: Path, client: MlflowClient) -> None:
    outputs = parent(client).outputs
    assert outputs is not None
    (output,) = outputs.model_outputs
    words = [sys.executable, "-c", LOAD, database_uri(home / "mlruns"), output.model_id]
    ended = subprocess.run(words, cwd=home, capture_output=True, text=True, check=True)
    columns, actions, signature = json.loads(ended.stdout)
    assert columns == ["action[0]", "action[1]", "action[2]"]
    assert [column["name"] for column in json.loads(signature["inputs"])][:3] == [
        "mu.position.x",
        "mu.position.z",
        "mu.opening",
    ]
    policy = roboscribe.load(home / "program")
    zero = np.zeros(1, np.int64)
    expected = policy.act(policy.task.world(1).reset(zero, zero)[0])
    np.testing.assert_allclose(actions[0], expected, atol=1e-9)


def test_a_run_id_is_a_program(home: Path, client: MlflowClient, monkeypatch: pytest.MonkeyPatch) -> None:
    run_id = parent(client).info.run_id
    monkeypatch.setenv("ROBOSCRIBE_HOME", str(home))
    assert str(roboscribe.load(run_id)) == str(roboscribe.load(home / "program"))
    monkeypatch.setenv("ROBOSCRIBE_HOME", str(home / "elsewhere"))
    with pytest.raises(ArtifactError, match="there is no tracking store"):
        roboscribe.load(run_id)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", database_uri(home / "mlruns"))
    assert roboscribe.load(run_id).task.name == "point-pick-place-1"


def test_a_model_is_registered_once(client: MlflowClient) -> None:
    run_id = parent(client).info.run_id
    assert [register(client, run_id, "tower") for _ in range(2)] == ["1", "1"]
    (version,) = client.search_model_versions("name='tower'")
    assert version.run_id == run_id
