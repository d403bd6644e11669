"""The process that copies a run's journal into MLflow while the run is at work, and does not disturb it.

`python -m roboscribe.stages.tracking.mlflow_process RUN_DIRECTORY MLRUNS` follows one journal until its standard input
ends, which is when the run ends, however it ends.
"""

from __future__ import annotations

import logging
import os
import select
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from roboscribe.stages.tracking.mlflow_store import MlflowSync, open_sync, store_identity, unreachable

PERIOD = 1.0
"""Seconds between looks at the journal: what is copied meanwhile nobody waits for at the end."""
PATIENCE = 45.0
"""Seconds for which a store that cannot be reached is tried again after the run's end."""
log = logging.getLogger(__name__)


def follow(directory: Path, mlruns: Path) -> int:
    """Copy a journal until standard input ends, then once more; returns an exit code, 0 when all is copied."""
    ended_at: float | None = None
    copier: MlflowSync | None = None
    identity: list[int] = []
    while True:
        last = ended_at is not None
        if identity and store_identity(mlruns) != identity:
            os.execv(
                sys.executable,
                [sys.executable, "-m", "roboscribe.stages.tracking.mlflow_process", str(directory), str(mlruns)],
            )
        try:
            if copier is None:
                import matplotlib.figure  # noqa: F401 - takes a second, better now than at the run's end

                copier = open_sync(directory, mlruns)
                identity = store_identity(mlruns)
            copier.copy()
            if last:
                copier.mark_killed()
                return 0
        except unreachable() as error:
            log.warning("the tracking store cannot be reached: %s", str(error).splitlines()[0])
            copier = None  # what it knows of the store may be over: an experiment that was deleted, for instance
            if ended_at is not None and time.monotonic() - ended_at > PATIENCE:
                return 1
        if ended_at is None and _ended(PERIOD):
            ended_at = time.monotonic()
        elif last:
            time.sleep(1.0)


def _ended(seconds: float) -> bool:
    """Wait; True when standard input has ended."""
    ready, _, _ = select.select([sys.stdin], [], [], seconds)
    return bool(ready) and not os.read(sys.stdin.fileno(), 1)


def main(arguments: Sequence[str]) -> int:
    """Follow the journal of `arguments[0]` for the store in `arguments[1]`."""
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(message)s")
    return follow(Path(arguments[0]), Path(arguments[1]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
