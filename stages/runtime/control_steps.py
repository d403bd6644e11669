"""How many control steps a synthesis took."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

from roboscribe.stages.runtime.events import (
    Decision,
    Evaluated,
    Event,
    Failed,
    Filmed,
    Ingested,
    Packaged,
    Programmed,
    RolledOut,
    Trained,
)


@dataclass
class ControlStepCounter:
    """Counts the control steps of a synthesis, those of cached stages included."""

    env_steps: int = 0

    def on_event(self, event: Event) -> None:
        """Count an event's control steps; the final evaluation is counted by itself."""
        match event:
            case Trained(_, reports, _):
                self.env_steps += sum(int(report["control_steps"]) for report in reports)
            case RolledOut(_, counts, _):
                self.env_steps += int(counts["control_steps"])
            case Ingested() | Programmed() | Decision() | Evaluated() | Packaged() | Filmed() | Failed():
                pass
            case _:
                assert_never(event)
