"""Curves of small cells, one after the other or on a Dask cluster: `python -m tests.paper.side_by_side HOME N`."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console

from roboscribe.pipelines.paper.cell_runner import Runner
from roboscribe.pipelines.paper.curves import draw_curves
from roboscribe.pipelines.paper.experiment import ExperimentContext, Options
from roboscribe.pipelines.workspace import Workspace

SMALL = Options(("point-pick-place-1",), ("roboscribe",), ("scripted",), seeds=2, evaluation_episodes=10)


def main(home: Path, workers: int) -> None:
    """Compute the cells of two seeds with so many workers; 0 is none beside this process."""
    context = ExperimentContext(Workspace(home), Runner("local", workers), home / "report", track=False)
    draw_curves(SMALL, context, Console())


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
