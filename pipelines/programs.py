"""Using saved programs: finding one, evaluating it, filming it."""

from __future__ import annotations

import logging
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from roboscribe.errors import ArtifactError
from roboscribe.evaluation import failures, measure
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import PROGRAM, load_program
from roboscribe.programs import find_program
from roboscribe.runnable import Runnable
from roboscribe.saved import open_saved
from roboscribe.stages import evaluate
from roboscribe.stages.runtime.progress import Report, episode_watch, silent
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.subtask_tree import ROOT

log = logging.getLogger(__name__)
_RUN_ID = re.compile(r"[0-9a-f]{32}")


@contextmanager
def program_directory(name: str, mlruns: Path) -> Iterator[Path]:
    """Find a program: a directory, an MLflow run, whose program is copied for the time being, or a shipped program.

    Args:
        name: a path, an MLflow run id, or the name of a shipped program; they are tried in this order.
        mlruns: directory of the tracking store.

    Raises:
        ArtifactError: it is none of them.
    """
    if _RUN_ID.fullmatch(name) and not Path(name).exists():
        with _tracked(name, mlruns) as found:
            yield found
    else:
        yield find_program(name, "an MLflow run id")


@contextmanager
def _tracked(run_id: str, mlruns: Path) -> Iterator[Path]:
    """Copy the program of an MLflow run for the time being.

    Raises:
        ArtifactError: there is no such run, or it has no program.
    """
    from mlflow.exceptions import MlflowException

    from roboscribe.stages.tracking.mlflow_store import DATABASE, download_program

    if not (mlruns / DATABASE).exists():
        msg = f"program {run_id}: looks like an MLflow run id, but there is no tracking store {mlruns / DATABASE}"
        raise ArtifactError(msg)
    with tempfile.TemporaryDirectory() as scratch:
        try:
            found = download_program(run_id, mlruns, Path(scratch))
        except (MlflowException, OSError) as error:
            msg = f"program {run_id}: the tracking store {mlruns} has no program of this run ({error})"
            raise ArtifactError(msg.splitlines()[0]) from error
        yield found


def load_with_task(directory: Path, task: str | None, contact: str, timing: str) -> tuple[Runnable, TaskConfig]:
    """Load a program and check that it can run on a task.

    Args:
        directory: of the program.
        task: where it shall run; None is the task for which it was made.
        contact: contact model.
        timing: simulator steps per control step.

    Returns:
        The program, ready to run, and where.

    Raises:
        ArtifactError: damaged files, or controllers that do not fit the task.
        ProgramError: its text is no program.
        TaskError: there is no such task or option.
    """
    saved = load_program(directory)
    if saved.edited:
        log.warning("%s was edited since the program was saved", directory / PROGRAM)
    where = TaskConfig(str(saved.manifest["task"]) if task is None else task, contact, timing)
    return open_saved(saved, where.make(), str(directory)), where


def evaluation(program: Runnable, config: evaluate.Config, report: Report = silent) -> dict[str, Json]:
    """Evaluate a program; returns what `roboscribe evaluate --json` writes."""
    start = perf_counter()
    watch = episode_watch(f"roll out {ROOT}", config.episodes, report)
    found = measure(program, config.task.make(), config.seed, config.episodes, watch)
    figures = found.figures
    shown = {name: figures[name] for name in ("success", "episodes", "ci_low", "ci_high")}
    seconds = round(perf_counter() - start, 3)
    failing: Json = [episode for episode, *_ in failures(found.table)]
    steps = figures["control_steps"]
    return {"task": config.task.name, **shown, "failing": failing, "env_steps": steps, "wall_seconds": seconds}
