"""Callbacks of a synthesis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from roboscribe.stages.runtime.events import EventCallback
from roboscribe.stages.runtime.progress import ProgressCallback


@dataclass(frozen=True)
class Callbacks:
    """Called with the name of each stage that begins, with each event, and with progress messages."""

    on_stage: Callable[[str], None]
    on_event: EventCallback
    on_progress: ProgressCallback
