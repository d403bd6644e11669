"""Demonstrations as a dataset of MLflow: where they lie, what their columns are, how many there are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

from roboscribe.io.atomic import sha256_of

if TYPE_CHECKING:
    from mlflow.entities import DatasetInput

DIGEST = 36
"""Most characters of a digest that MLflow keeps."""


def dataset_input(path: Path) -> DatasetInput:
    """Describe a file of demonstrations as an input of a run.

    Raises:
        OSError, ArrowInvalid: it cannot be read.
    """
    from mlflow.entities import Dataset, DatasetInput, InputTag

    footer, columns = pq.read_metadata(path), pq.read_schema(path)
    dataset = Dataset(
        name="demonstrations",
        digest=sha256_of(path)[:DIGEST],
        source_type="local",
        source=json.dumps({"uri": str(path.resolve())}),
        schema=json.dumps({"mlflow_colspec": [_column(field) for field in columns]}),
        profile=json.dumps({"num_rows": footer.num_rows, "size_in_bytes": path.stat().st_size}),
    )
    return DatasetInput(dataset, [InputTag("mlflow.data.context", "training")])


def _column(field: pa.Field) -> dict[str, object]:
    """Describe a column as MLflow's schemas do; units stand in the file."""
    kind = {"type": "array", "items": {"type": "double"}} if not _scalar(field) else {"type": _name(field)}
    return {**kind, "name": field.name, "required": not field.nullable}


def _scalar(field: pa.Field) -> bool:
    return not (pa.types.is_list(field.type) or pa.types.is_large_list(field.type))


def _name(field: pa.Field) -> str:
    """Name the type of a scalar column."""
    return "long" if pa.types.is_integer(field.type) else "double"
