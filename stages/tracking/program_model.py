"""A saved program as a model of MLflow: this file is the model's code, copied into it; nothing is pickled.

`mlflow.pyfunc.load_model("models:/…")` needs nothing but this package. A program remembers where it stands, so rows are
consecutive observations of one robot; `params={"reset": False}` goes on with the episode of the call before.
"""

from __future__ import annotations

from typing import Any

import pandas as pd
from mlflow.models import set_model
from mlflow.pyfunc.model import PythonModel

import roboscribe

PROGRAM = "program"
"""Name under which the model keeps the program's directory."""
RESET = "reset"
"""Parameter of `predict`: whether an episode begins."""


class ProgramModel(PythonModel):
    """Chooses an action for every row."""

    def load_context(self, context: Any) -> None:  # noqa: ANN401 - MLflow does not type it
        """Load the program."""
        self.policy = roboscribe.load(context.artifacts[PROGRAM])

    def predict(self, context: Any, model_input: pd.DataFrame, params: dict[str, Any] | None = None) -> pd.DataFrame:  # noqa: ANN401 - as above
        """Return actions, one row per observation, one column per number of an action."""
        if (params or {}).get(RESET, True):
            self.policy.reset()
        actions = [self.policy.act(row) for row in model_input.to_numpy(dtype=float)]
        names = [f"action[{number}]" for number in range(self.policy.task.action_size)]
        return pd.DataFrame(actions, columns=names)


set_model(ProgramModel())
