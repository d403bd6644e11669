"""The directory in which everything is kept."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Workspace:
    """A directory: stages, runs and programs under `data`, tracking under `mlruns`."""

    path: Path

    @property
    def data(self) -> Path:
        """Directory of stages, runs and programs."""
        return self.path.resolve() / "data"

    @property
    def mlruns(self) -> Path:
        """Directory of the tracking store."""
        return self.path.resolve() / "mlruns"
