"""Using saved programs: finding one, evaluating it, filming it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.printer import text
from roboscribe.dsl.rewrite import controllers
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import load_program
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.protocols import Task, World
from roboscribe.world.trajectory import Trajectory
from stages import evaluate
from stages.package import grounded
from stages.progress import Report, silent
from stages.roll_out import Grounded
from stages.skills import as_controllers
from stages.world import TaskConfig, episode_seeds

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


def film(program: Grounded, config: TaskConfig, seed: int, out: Path) -> tuple[Path, bool]:
    """Write a video of one episode with the line of the program that acts.

    Returns:
        The file written, and whether the task was solved in it.
    """
    from roboscribe.envs.render import render_rollout

    recording = _Recording(config.make())
    seeds = episode_seeds(seed, "evaluate", 1)
    library = as_controllers(program.library)
    rollouts = execute(
        program.program, library, recording, seeds, limits=program.limits, batch=1, confirm=program.confirm
    )
    runs = [text(run) for run in controllers(program.program)]
    lines = [runs[line] if line >= 0 else "" for line in rollouts.lines[0]] or [""]
    states = rollouts.trajectories[0].states
    path = render_rollout(recording.task, states, np.stack(recording.snapshots), lines, out)
    return path, bool(rollouts.success[0])


class _Recording:
    """A task whose only world keeps a snapshot of every state that it shows."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.name: str = task.name
        self.layout: Layout = task.layout
        self.action_size: int = task.action_size
        self.horizon: int = task.horizon
        self.frequency: float = task.frequency
        self.snapshots: list[FloatArray] = []

    def solved(self, states: FloatArray) -> BoolArray:
        return self.task.solved(states)

    def world(self, batch: int) -> World:
        return _RecordingWorld(self.task.world(batch), self.snapshots)

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        return self.task.demonstrate(episodes, seed)


@dataclass
class _RecordingWorld:
    """A world of one row that notes a snapshot after every reset and step."""

    inner: World
    snapshots: list[FloatArray]

    def __post_init__(self) -> None:
        self.batch: int = self.inner.batch
        self.control_steps: int = 0

    def reset(self, rows: IntArray, seeds: IntArray) -> FloatArray:
        states = self.inner.reset(rows, seeds)
        self._note(rows)
        return states

    def step(self, rows: IntArray, actions: FloatArray) -> FloatArray:
        states = self.inner.step(rows, actions)
        self.control_steps = self.inner.control_steps
        self._note(rows)
        return states

    def observe(self, rows: IntArray) -> FloatArray:
        return self.inner.observe(rows)

    def diverged(self, rows: IntArray) -> BoolArray:
        return self.inner.diverged(rows)

    def save(self, rows: IntArray) -> FloatArray:
        return self.inner.save(rows)

    def load(self, rows: IntArray, snapshots: FloatArray) -> FloatArray:
        return self.inner.load(rows, snapshots)

    def _note(self, rows: IntArray) -> None:
        self.snapshots.append(self.inner.save(rows)[0])
