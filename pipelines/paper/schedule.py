"""Scheduled runs of the paper's experiments: what Prefect's server starts, and offering it to a server.

`pipelines/prefect.yaml` says the same to `prefect deploy --prefect-file`.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

from roboscribe.pipelines.flows.prefect_settings import configure_prefect

configure_prefect()  # before Prefect is imported, wherever this file is loaded from

from prefect import flow, serve  # noqa: E402 - its settings come first
from prefect.client.schemas.objects import ConcurrencyLimitConfig, ConcurrencyLimitStrategy  # noqa: E402
from prefect.settings import PREFECT_API_URL  # noqa: E402
from pydantic import Field  # noqa: E402
from rich.console import Console  # noqa: E402

from roboscribe.baselines.config import Method  # noqa: E402
from roboscribe.errors import TaskError  # noqa: E402
from roboscribe.pipelines.paper.experiment import ExperimentContext, Options  # noqa: E402
from roboscribe.pipelines.workspace import Workspace  # noqa: E402
from roboscribe.stages.paper.rows import OURS  # noqa: E402

EVERYTHING: Final = "all"
SCHEDULES: dict[str, tuple[str, dict[str, object]]] = {
    "nightly-quick": ("0 1 * * *", {"experiment": EVERYTHING, "quick": True}),
    "weekly-own-programs": ("0 2 * * 6", {"experiment": EVERYTHING, "methods": [OURS]}),
    "monthly-with-baselines": ("0 3 1 * *", {"experiment": "curves"}),
}
"""By name: when, as cron spells it, and with which parameters."""


Experiment: TypeAlias = Literal["all", "curves", "table1", "demos", "towers", "confined"]
MethodName: TypeAlias = Literal["roboscribe", Method]
Seeds: TypeAlias = Annotated[int, Field(ge=1, le=100)]


@flow(name="paper", log_prints=True, retries=1, retry_delay_seconds=60, persist_result=False)
def scheduled(
    experiment: Experiment = EVERYTHING,
    quick: bool = False,
    methods: list[MethodName] | None = None,
    seeds: Seeds = 5,
    home: str = ".",
) -> None:
    """Do an experiment, or all of them; on unchanged code everything is found in the store.

    Prefect's page offers what the annotations allow, and refuses the rest before anything runs. What failed is tried
    once more: it goes on from where it stopped.

    Args:
        experiment: "all", "curves", "table1", "demos", "towers" or "confined".
        quick: minutes instead of hours.
        methods: "roboscribe" and baselines; None is all.
        seeds: how many.
        home: where everything is kept.

    Raises:
        TaskError: no such experiment, or a synthesis found no program.
    """
    from roboscribe.pipelines.paper.everything import EXPERIMENTS, do_everything
    from roboscribe.pipelines.paper.methods import check_method

    if experiment not in (EVERYTHING, *EXPERIMENTS):
        msg = f"unknown experiment {experiment!r}: expected one of {', '.join((EVERYTHING, *EXPERIMENTS))}"
        raise TaskError(msg)
    chosen = tuple(check_method(name) for name in methods or ())
    options = Options(methods=chosen, seeds=seeds, quick=quick)
    context, console = ExperimentContext(Workspace(Path(home))), Console()
    if experiment == EVERYTHING:
        done = do_everything(options, context, console)
    else:
        done = {experiment: EXPERIMENTS[experiment][1](options, replace(context), console)}
    failures = [failure for each in done.values() for failure in each.failures]
    if failures:
        raise TaskError("; ".join(failures))


def serve_schedules(home: Path) -> None:
    """Offer the scheduled runs to the server that `PREFECT_API_URL` names, and do them one at a time.

    Raises:
        TaskError: no server is named.
    """
    if not (os.environ.get("PREFECT_API_URL") or PREFECT_API_URL.value()):
        msg = "PREFECT_API_URL is not set; expected the address of a Prefect server, see `prefect server start`"
        raise TaskError(msg)
    limit = ConcurrencyLimitConfig(limit=1, collision_strategy=ConcurrencyLimitStrategy.ENQUEUE)
    context = str(home.resolve())
    offered = [
        scheduled.to_deployment(name, cron=when, parameters={**parameters, "home": context}, concurrency_limit=limit)
        for name, (when, parameters) in SCHEDULES.items()
    ]
    serve(*offered, limit=1)  # type: ignore[arg-type]  # a coroutine only where called from one
