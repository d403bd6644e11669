"""Who watches a synthesis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from roboscribe.stages.runtime.events import Listener
from roboscribe.stages.runtime.progress import Report


@dataclass(frozen=True)
class Callbacks:
    """Who watches: told which stage begins, what happens, and how far the work is."""

    begin: Callable[[str], None]
    listen: Listener
    watch: Report
