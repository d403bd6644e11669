"""Saved programs and policies that experiments are given instead of making their own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roboscribe.io.saved_program import load_program
from roboscribe.pipelines.workspace import Workspace
from roboscribe.programs import program_directory
from roboscribe.stages.paper.rows import OURS


@dataclass(frozen=True)
class GivenProgram:
    """A saved program or baseline.

    Args:
        task: for which it was made.
        method: that made it.
        profile: what it was learned from.
        seed: that decided it.
        directory: where it lies.
    """

    task: str
    method: str
    profile: str
    seed: int
    directory: Path


@contextmanager
def given_program(name: str, workspace: Workspace) -> Iterator[GivenProgram]:
    """Find a program by its directory, MLflow run id or shipped name.

    Raises:
        ArtifactError: there is none, or its files are damaged.
    """
    with program_directory(name, workspace.mlruns) as directory:
        manifest: Mapping[str, Any] = load_program(directory).manifest
        method = str(manifest.get("method", OURS))
        yield GivenProgram(manifest["task"], method, manifest["profile"], manifest["seed"], directory)
