"""Running cells one after the other, by Prefect, or side by side on a Dask cluster; the store keeps what they find."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.console import SynthesisConsole
from roboscribe.pipelines.flows.prefect_server import prefect_server
from roboscribe.pipelines.flows.prefect_settings import configure_prefect
from roboscribe.pipelines.paper.cells import Cell, CellContext
from roboscribe.pipelines.synthesis_run import Engine

DASK = "dask"


@dataclass(frozen=True)
class Runner:
    """What runs cells.

    Args:
        engine: "prefect" or "local".
        workers: processes of a Dask cluster of this machine; 0 is no cluster.
        address: of a Dask scheduler whose workers see the same home; "" is none.
    """

    engine: Engine = "prefect"
    workers: int = 0
    address: str = ""

    @property
    def parallel(self) -> bool:
        """Whether cells are computed side by side."""
        return self.workers > 0 or bool(self.address)


def run_cells(
    title: str,
    cells: Sequence[Cell],
    context: CellContext,
    runner: Runner,
    console: Console,
    say: Callable[[int, Path], str] = lambda number, out: "",
) -> list[Path]:
    """Compute every cell, or find it; returns where each one lies, in order.

    Side by side, the cells are computed first and then found, so that the result is the same whatever runs them.

    Args:
        title: of the experiment.
        cells: what is computed.
        context: where.
        runner: what runs them.
        console: where the story is told.
        say: what is said after a cell; "" is nothing.
    """
    if not cells:
        return []
    if runner.parallel:
        configure_prefect(context.workspace.data / "prefect")
        from roboscribe.pipelines.paper.cluster import compute_with_dask

        compute_with_dask(title, cells, context, runner.workers, runner.address)
    found: dict[int, Path] = {}
    with SynthesisConsole(console) as story:

        def compute(number: int) -> None:
            story.say(str(cells[number]), "bold")
            found[number] = cells[number].run(context, story.callbacks())
            line = say(number, found[number])
            if line:
                story.say(f"{cells[number]}: {line}")

        if runner.engine == "local" or runner.parallel:
            for number in range(len(cells)):
                compute(number)
        else:
            with prefect_server(context.workspace.data / "prefect") as server:
                from roboscribe.pipelines.flows.measurement import measure_with_prefect

                measure_with_prefect(title, [str(cell) for cell in cells], compute, server)
    return [found[number] for number in range(len(cells))]


def no_callbacks() -> Callbacks:
    """Return callbacks that do nothing, for cells that are computed in other processes."""
    return Callbacks(lambda label: None, lambda event: None, lambda progress: None)
