"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

PROGRAM_HELP = "a program's directory, an MLflow run id, or a name that `roboscribe programs` lists"
RUN_HELP = "a program's directory, a run that `roboscribe runs` lists, an MLflow run id, or a shipped program's name"
HomeDir = Annotated[Path, typer.Option("--home", envvar="ROBOSCRIBE_HOME", help="where data/ and mlruns/ are kept")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="write the result as JSON to this file")]
