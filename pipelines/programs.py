"""Using saved programs: finding one, evaluating it, filming it."""

from __future__ import annotations

import logging
import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from roboscribe.errors import ArtifactError
from roboscribe.io import saved_program
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import MANIFEST, PROGRAM, load_program
from stages import evaluate
from stages.grounded import Grounded, failures
from stages.progress import Report, silent
from stages.saved import open_saved
from stages.world import TaskConfig

TRAINED = Path(saved_program.__file__).resolve().parent.parent / "trained"
"""Where the programs lie that are shipped with the package, each in a directory of its task's name."""
log = logging.getLogger(__name__)
_RUN_ID = re.compile(r"[0-9a-f]{32}")


def shipped_names() -> tuple[str, ...]:
    """List the shipped programs."""
    return tuple(sorted(path.parent.name for path in TRAINED.glob(f"*/{MANIFEST}")))


@dataclass(frozen=True)
class Shipped:
    """What is known about a shipped program.

    Args:
        name: by which commands find it.
        manifest: what its manifest says about the run.
        size: bytes of its files.
    """

    name: str
    manifest: Mapping[str, Any]
    size: int


def shipped_programs() -> tuple[Shipped, ...]:
    """Read what the shipped programs say about themselves.

    Raises:
        ArtifactError: the files of one are damaged.
    """
    return tuple(_shipped(name) for name in shipped_names())


def _shipped(name: str) -> Shipped:
    directory = TRAINED / name
    return Shipped(name, load_program(directory).manifest, sum(path.stat().st_size for path in directory.iterdir()))


def spell_success(figures: Mapping[str, Any]) -> str:
    """Spell a success rate with its interval, in per cent."""
    success, low, high = (100 * float(figures[name]) for name in ("success", "ci_low", "ci_high"))
    return f"{success:.1f} % ({low:.1f} to {high:.1f})"


@contextmanager
def program_directory(name: str, mlruns: Path) -> Iterator[Path]:
    """Find a program: a directory, an MLflow run, whose program is copied for the time being, or a shipped program.

    Args:
        name: a path, an MLflow run id, or the name of a shipped program; they are tried in this order.
        mlruns: directory of the tracking store.

    Raises:
        ArtifactError: it is none of them.
    """
    if Path(name).exists():
        yield Path(name)
    elif _RUN_ID.fullmatch(name):
        with _tracked(name, mlruns) as found:
            yield found
    elif name in shipped_names():
        yield TRAINED / name
    else:
        shipped = f"a shipped program ({', '.join(shipped_names()) or 'there are none'})"
        msg = f"program {name}: does not exist; expected a program's directory, an MLflow run id or {shipped}"
        raise ArtifactError(msg)


@contextmanager
def _tracked(run_id: str, mlruns: Path) -> Iterator[Path]:
    """Copy the program of an MLflow run for the time being.

    Raises:
        ArtifactError: there is no such run, or it has no program.
    """
    from mlflow.exceptions import MlflowException

    from stages.mlflow_store import DATABASE, download_program

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


def open_program(directory: Path, task: str | None, contact: str, timing: str) -> tuple[Grounded, TaskConfig]:
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


def evaluation(program: Grounded, config: evaluate.Config, report: Report = silent) -> dict[str, Json]:
    """Evaluate a program; returns what `roboscribe evaluate --json` writes."""
    start = perf_counter()
    figures, table = evaluate.measure(program, config.task.make(), config.seed, config.episodes, report)
    shown = {name: figures[name] for name in ("success", "episodes", "ci_low", "ci_high")}
    seconds = round(perf_counter() - start, 3)
    failing: Json = [episode for episode, *_ in failures(table)]
    steps = figures["control_steps"]
    return {"task": config.task.name, **shown, "failing": failing, "env_steps": steps, "wall_seconds": seconds}
