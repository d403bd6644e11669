"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roboscribe.pipelines.commands.output import STANDARD_OUTPUT, console

PROGRAM_HELP = "a program's directory, an MLflow run id, or a name that `roboscribe programs` lists"
RUN_HELP = "a program's directory, a run that `roboscribe runs` lists, an MLflow run id, or a shipped program's name"
HomeDir = Annotated[Path, typer.Option("--home", envvar="ROBOSCRIBE_HOME", help="where data/ and mlruns/ are kept")]


def _to_standard_output(path: Path | None) -> Path | None:
    """Leave standard output to the result where it goes there."""
    console.stderr = path == STANDARD_OUTPUT
    return path


def _hush(quiet: bool) -> bool:
    """Print results and errors only."""
    console.quiet = quiet
    return quiet


JsonFile = Annotated[
    Path | None,
    typer.Option("--json", callback=_to_standard_output, help="write the result as JSON to this file; - is stdout"),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", callback=_hush, help="print nothing but errors")]
