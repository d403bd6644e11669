"""Using saved programs: finding one, evaluating it, filming it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from roboscribe.defaults import CONTACT, TIMING
from roboscribe.evaluation import failures, measure
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import PROGRAM, load_program
from roboscribe.runnable import Runnable
from roboscribe.saved import open_saved
from roboscribe.stages import evaluate
from roboscribe.stages.runtime.progress import ProgressCallback, episode_progress, ignore_progress
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.subtask_tree import ROOT

log = logging.getLogger(__name__)


def load_with_task(
    directory: Path,
    task: str | None,
    contact: str | None = None,
    timing: str | None = None,
    horizon: int | None = None,
) -> tuple[Runnable, TaskConfig]:
    """Load a program and check that it can run on a task.

    Args:
        directory: of the program.
        task: where it shall run; None is the task for which it was made.
        contact: contact model; None is the one under which the program was made, in another task the usual one.
        timing: simulator steps per control step; None likewise.
        horizon: control steps of an episode; None is as many as when the program was made, in another task its own.

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
    if task is None:
        task, horizon = str(saved.manifest["task"]), horizon or saved.horizon
        contact, timing = contact or saved.contact, timing or saved.timing
    where = TaskConfig(task, contact or CONTACT, timing or TIMING, horizon=horizon)
    return open_saved(saved, where.make(), str(directory)), where


def evaluation(
    program: Runnable,
    config: evaluate.Config,
    report: ProgressCallback = ignore_progress,
    disturb: Sequence[str] = (),
) -> dict[str, Json]:
    """Evaluate a program; returns what `roboscribe evaluate --json` writes.

    Args:
        program: what is evaluated.
        config: where, on which episodes.
        report: told how far it is.
        disturb: disturbances such as "noise=0.005".

    Raises:
        TaskError: a disturbance that there is not, or that the task cannot have.
    """
    from roboscribe.envs.disturbed import disturbed

    start = perf_counter()
    on_progress = episode_progress(f"roll out {ROOT}", config.evaluation_episodes, report)
    task = disturbed(config.task.make(), disturb)
    found = measure(program, task, config.seed, config.evaluation_episodes, on_progress)
    figures = found.figures
    shown = {name: figures[name] for name in ("success", "episodes", "ci_low", "ci_high")}
    seconds = round(perf_counter() - start, 3)
    failing: Json = [episode for episode, *_ in failures(found.table)]
    steps = figures["control_steps"]
    disturbances: dict[str, Json] = {"disturb": list(disturb)} if disturb else {}
    named = {"task": config.task.name, **disturbances}
    return {**named, **shown, "failing": failing, "env_steps": steps, "wall_seconds": seconds}
