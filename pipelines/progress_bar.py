"""One progress bar for long work."""

from __future__ import annotations

from types import TracebackType
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as RichProgress
from rich.text import Text

from roboscribe.stages.runtime.progress import Progress

Self = TypeVar("Self", bound="ProgressBar")


class ProgressBar:
    """Shows what is being worked on and how far it is. Nothing it prints is read as markup."""

    def __init__(self, console: Console) -> None:
        """Prepare the bar; it moves only where the console is a terminal."""
        self.console = console
        self._bar = RichProgress(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[figures]}", markup=False),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("starting", total=None, figures="")

    def __enter__(self: Self) -> Self:
        """Show the bar."""
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the bar."""
        self._bar.stop()

    def on_stage(self, label: str) -> None:
        """Name the work that begins."""
        self._bar.reset(self._task, description=label, total=None, figures="")

    def on_progress(self, progress: Progress) -> None:
        """Move the bar."""
        figures = "  ".join(f"{name} {value:.3g}" for name, value in list(progress.metrics.items())[:3])
        self._bar.update(
            self._task, description=progress.what, completed=progress.done, total=progress.total, figures=figures
        )

    def say(self, line: str, style: str = "") -> None:
        """Print text as it is."""
        self.console.print(Text(line, style=style), soft_wrap=True)
