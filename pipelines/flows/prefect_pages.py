"""What a user reads on Prefect's page of a run: lines of its log, the program, the refinements, where MLflow has it."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from io import StringIO
from typing import Any
from uuid import UUID

from rich.console import Console

from roboscribe.dsl.printer import pretty, text
from roboscribe.errors import Fail
from roboscribe.evaluation import format_success
from roboscribe.io.tracked import THEIRS
from roboscribe.pipelines.console import SynthesisConsole
from roboscribe.pipelines.synthesis_pipeline import SynthesisResult
from roboscribe.stages.runtime.events import Event

INFO = 20
"""Level of a line, as in `logging`."""
WIDTH = 160
LOGGER = "prefect.flow_runs"
"""Under which Prefect's page shows lines."""
USUAL = "http://127.0.0.1:5000"
"""Where `roboscribe ui` is, unless another port is asked for."""


class FlowLog:
    """Collects what the console tells, line by line."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._said = StringIO()
        self._console = SynthesisConsole(Console(file=self._said, width=WIDTH))
        self._lines: list[tuple[datetime, str]] = []

    def on_event(self, event: Event) -> None:
        """Tell an event."""
        self._console.on_event(event)
        now = datetime.now(UTC)
        self._lines += [(now, line) for line in self._said.getvalue().splitlines() if line.strip()]
        self._said.seek(0)
        self._said.truncate()

    def send(self, flow_run: UUID) -> None:
        """Send the lines to the page of a flow run."""
        from prefect.client.orchestration import get_client
        from prefect.client.schemas.actions import LogCreate

        about = {"name": LOGGER, "level": INFO, "flow_run_id": flow_run}
        logs = [LogCreate.model_validate({**about, "message": line, "timestamp": when}) for when, line in self._lines]
        with get_client(sync_client=True) as client:
            client.create_logs(logs)


def publish(title: str, found: SynthesisResult | Fail, run_id: str | None) -> None:
    """Leave artifacts on the page of the flow run within which this is called.

    Args:
        title: of the run.
        found: what came out.
        run_id: MLflow's; None where it has none yet.
    """
    from prefect.artifacts import create_link_artifact, create_markdown_artifact, create_table_artifact

    if run_id is not None:
        create_link_artifact(link=link_to(run_id), link_text=f"{title} in MLflow (roboscribe ui)", key="mlflow")
    if isinstance(found, Fail):
        create_markdown_artifact(f"**no program**: {found.reason}", key="program", description=title)
        return
    create_markdown_artifact(described(found), key="program", description=title)
    create_table_artifact(refinements(found), key="refinements", description=title)


def link_to(run_id: str) -> str:
    """Return the address of MLflow's page of a run."""
    theirs = os.environ.get(THEIRS, "")
    server = theirs.rstrip("/") if theirs.startswith("http") else USUAL
    return f"{server}/#/runs/{run_id}"


def described(found: SynthesisResult) -> str:
    """Describe a program in Markdown."""
    figures = found.figures
    head = f"**success {format_success(figures)}** of {figures['episodes']} episodes, 95 % interval"
    return "\n".join([head, "", "```", pretty(found.solution.program).rstrip(), "```"])


def refinements(found: SynthesisResult) -> list[dict[str, Any]]:
    """List the refinements as rows of a table."""
    return [
        {"goal": each.psi, "subgoal": each.node.name, "predicate": text(each.node.predicate)}
        for each in found.solution.refinements
    ]
