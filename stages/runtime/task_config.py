"""Which world a stage works in, and the demonstrations as the algorithms see them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from roboscribe.defaults import CONTACT, TIMING
from roboscribe.envs.catalogue import make_task, origin_of
from roboscribe.evidence import Evidence
from roboscribe.io.atomic import sha256_of
from roboscribe.io.demonstrations import Demonstrations, read_demonstrations
from roboscribe.stages.runtime.code_version import task_version
from roboscribe.world.task import Task

DEMONSTRATIONS = "demonstrations.parquet"


@dataclass(frozen=True)
class TaskConfig:
    """A task of the catalogue.

    Args:
        name: its name.
        contact: contact model.
        timing: simulator steps per control step.
        light: in its lighter simulator, where it has one, see `Task.light`.
        horizon: control steps of an episode; None is the task's own.
    """

    name: str
    contact: str = CONTACT
    timing: str = TIMING
    light: bool = False
    horizon: int | None = None

    def make(self) -> Task:
        """Build the task.

        Raises:
            TaskError: there is no such task or option.
        """
        task = make_task(self.name, contact=self.contact, timing=self.timing)
        task = task.light if self.light else task
        return task if self.horizon is None else task.lasting(self.horizon)

    def code(self) -> str:
        """Return the version of the task's code, wherever it lies: results of a task that was changed are stale."""
        return _code(self)


@lru_cache(maxsize=64)
def _code(config: TaskConfig) -> str:
    """Hash the sources of a task once: what was imported does not change any more."""
    return task_version(config.make(), origin_of(config.name))


def load_evidence(path: Path, config: TaskConfig) -> Evidence:
    """Read demonstrations and name their entities; a file that was just read is not read again.

    Raises:
        DemonstrationError: the file is damaged or shows another task.
    """
    return _evidence(path, sha256_of(path), config)


@lru_cache(maxsize=2)
def _evidence(path: Path, _digest: str, config: TaskConfig) -> Evidence:
    task = config.make()
    return Evidence.of(read_demonstrations(path, task).trajectories, task.solved)


def load_demonstrations(path: Path, config: TaskConfig) -> Demonstrations:
    """Read demonstrations as they are."""
    return read_demonstrations(path, config.make())
