"""Using saved programs: finding one, evaluating it, filming it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import load_program
from roboscribe.world.protocols import Task
from stages import evaluate
from stages.grounded import Grounded, grounded
from stages.progress import Report, silent

_RUN_ID = re.compile(r"[0-9a-f]{32}")


@contextmanager
def program_directory(name: str, mlruns: Path) -> Iterator[Path]:
    """Find a program: a directory, or the id of an MLflow run, whose program is copied for the time being.

    Raises:
        ArtifactError: it is neither.
    """
    if Path(name).exists() or not _RUN_ID.fullmatch(name):
        yield Path(name)
        return
    from mlflow.exceptions import MlflowException

    from stages.mlflow_store import DATABASE, download_program

    if not (mlruns / DATABASE).exists():
        msg = f"program {name}: looks like an MLflow run id, but there is no tracking store {mlruns / DATABASE}"
        raise ArtifactError(msg)
    with tempfile.TemporaryDirectory() as scratch:
        try:
            found = download_program(name, mlruns, Path(scratch))
        except (MlflowException, OSError) as error:
            msg = f"program {name}: the tracking store {mlruns} has no program of this run ({error})"
            raise ArtifactError(msg.splitlines()[0]) from error
        yield found


def open_program(directory: Path, task: Task) -> Grounded:
    """Load a program and check that it can run on a task.

    Raises:
        ArtifactError: damaged files, or controllers that do not fit the task.
        ProgramError: its text is no program.
    """
    return grounded(load_program(directory), task, str(directory))


def evaluation(program: Grounded, config: evaluate.Config, report: Report = silent) -> dict[str, Json]:
    """Evaluate a program; returns what `roboscribe evaluate --json` writes."""
    start = perf_counter()
    figures, _ = evaluate.measure(program, config.task.make(), config.seed, config.episodes, report)
    shown = {name: figures[name] for name in ("success", "episodes", "ci_low", "ci_high")}
    seconds = round(perf_counter() - start, 3)
    return {"task": config.task.name, **shown, "env_steps": figures["control_steps"], "wall_seconds": seconds}
