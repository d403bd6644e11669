"""One run of a method: how long, from which seed, where it would go on, and whom it tells."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from roboscribe.rl.checkpoint import Arrays, read_checkpoint, write_checkpoint

Log: TypeAlias = Callable[[Mapping[str, float], int], None]
"""Receives metrics by name, and the steps done so far."""


def silent(metrics: Mapping[str, float], step: int) -> None:
    """Log nothing."""


@dataclass(frozen=True)
class Course:
    """What every method is told.

    Args:
        steps: gradient steps of clones, control steps of the others.
        seed: decides everything.
        checkpoint: file that a killed run goes on from; None keeps nothing.
        log: receives metrics whenever there are some.
    """

    steps: int
    seed: int = 0
    checkpoint: Path | None = None
    log: Log = silent

    def keep(self, arrays: Arrays, notes: Mapping[str, object]) -> None:
        """Write a checkpoint."""
        if self.checkpoint is not None:
            write_checkpoint(self.checkpoint, arrays, {**notes, **self._identity})

    def kept(self) -> tuple[Arrays, dict[str, object]] | None:
        """Read the checkpoint; None where there is none.

        Raises:
            ArtifactError: it is damaged or another run's.
        """
        if self.checkpoint is None or not self.checkpoint.exists():
            return None
        return read_checkpoint(self.checkpoint, self._identity)

    @property
    def _identity(self) -> dict[str, object]:
        return {"steps": self.steps, "seed": self.seed}
