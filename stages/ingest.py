"""Check a demonstration file and keep the demonstrations that can be learned from."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.errors import Fail
from roboscribe.io.demonstrations import write_demonstrations
from roboscribe.io.validation import screen
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.files import write_fail, write_json
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.stages.runtime.task_config import DEMONSTRATIONS, TaskConfig, load_demonstrations
from roboscribe.world.episode_length import episode_length

REPORT = "report.json"


@dataclass(frozen=True)
class Config:
    """What the file must hold.

    Args:
        task: what it must show.
        least: count of usable demonstrations that must be left.
    """

    task: TaskConfig
    least: int = 2


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write the kept demonstrations and `report.json`, or why nothing can be learned from them.

    Inputs:
        demonstrations: a Parquet file.
    """
    task = config.task.make()
    found = load_demonstrations(inputs["demonstrations"], config.task)
    screened = screen(task, found.trajectories, least=config.least)
    if isinstance(screened, Fail):
        write_fail(out, screened)
        return
    kept = screened.kept
    horizon, slow = episode_length(task, kept) if config.task.horizon is None else (config.task.horizon, "")
    origin = f"kept of {found.digest}"
    write_demonstrations(
        out / DEMONSTRATIONS, task.name, task.layout, task.frequency, kept, generator=origin, seed=None
    )
    write_json(
        out / REPORT,
        {
            "digest": found.digest,
            "episodes": len(found.trajectories),
            "kept": len(kept),
            "frames": sum(len(trajectory) for trajectory in kept),
            "horizon": horizon,
            "actions": all(trajectory.actions is not None for trajectory in kept),
            "report": [*found.report, *screened.report, *([slow] if slow else ())],
        },
    )


STAGE = Stage("ingest", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
