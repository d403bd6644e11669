"""Collect noisy scripted demonstrations into a Parquet file."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.defaults import N_DEMONSTRATIONS
from roboscribe.envs.demonstrator import demonstrate
from roboscribe.envs.styles import DEFAULT
from roboscribe.io.demonstrations import write_demonstrations
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.progress import Progress, ProgressCallback, ignore_progress
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import DEMONSTRATIONS, TaskConfig


@dataclass(frozen=True)
class Config:
    """What to collect.

    Args:
        task: what is shown.
        n_demonstrations: how many.
        seed: decides everything.
        style: name of the style in which they are given.
        failing: share of them that end without success.
    """

    task: TaskConfig
    n_demonstrations: int = N_DEMONSTRATIONS
    seed: int = 0
    style: str = DEFAULT
    failing: float = 0.0


def collect(config: Config, path: Path, report: ProgressCallback = ignore_progress) -> str:
    """Write demonstrations to a file; returns its SHA-256."""
    task = config.task.make()
    report(Progress("demonstrations", 0, config.n_demonstrations, "episodes"))
    shown = demonstrate(task, config.n_demonstrations, config.seed, config.style, config.failing)
    report(Progress("demonstrations", len(shown), config.n_demonstrations, "episodes"))
    generator = f"roboscribe demonstrator of {task.name}, contact {config.task.contact}, timing {config.task.timing}"
    generator += f", style {config.style}" * (config.style != DEFAULT)
    generator += f", {config.failing:g} failing" * (config.failing > 0)
    return write_demonstrations(
        path, task.name, task.layout, task.frequency, shown, generator=generator, seed=config.seed
    )


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `demonstrations.parquet`; there are no inputs."""
    collect(config, out / DEMONSTRATIONS, report)


STAGE = Stage("collect", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
