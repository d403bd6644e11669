"""Cells side by side on a Dask cluster, by Prefect's task runner."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

from roboscribe.errors import TaskError
from roboscribe.pipelines.flows.prefect_records import wait_for_records
from roboscribe.pipelines.flows.prefect_settings import configure_prefect
from roboscribe.pipelines.paper.cell_runner import no_callbacks
from roboscribe.pipelines.paper.cells import Cell, CellContext


def compute_with_dask(title: str, cells: Sequence[Cell], context: CellContext, workers: int, address: str) -> None:
    """Compute cells on a cluster; what they find lies in the store of `context`, which all workers have to see.

    Args:
        title: name of the flow.
        cells: what is computed.
        context: where.
        workers: processes of a cluster of this machine, one thread each.
        address: of a running scheduler instead.

    Raises:
        TaskError: prefect-dask is not installed.
        KeyboardInterrupt: the process was asked to end while the flow was running.
    """
    configure_prefect()
    try:
        from prefect_dask import DaskTaskRunner
    except ImportError as error:
        msg = f"--runner dask needs the package prefect-dask ({error}); pip install 'roboscribe[dask]'"
        raise TaskError(msg) from error
    from prefect import flow, task
    from prefect.cache_policies import NO_CACHE
    from prefect.exceptions import TerminationSignal
    from prefect.futures import wait
    from prefect.runtime import flow_run

    local = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    chosen = DaskTaskRunner(address=address) if address else DaskTaskRunner(cluster_kwargs=local)

    @task(name="cell", task_run_name="{label}", retries=0, persist_result=False, cache_policy=NO_CACHE)
    def compute(label: str, number: int) -> None:
        configure_prefect()
        cells[number].run(context, no_callbacks())

    @flow(name=title, flow_run_name=title, retries=0, persist_result=False, task_runner=chosen)
    def computing(count: int) -> None:
        futures = [compute.submit(str(cell), number) for number, cell in enumerate(cells)]
        wait(futures)
        for future in futures:
            future.result()
        wait_for_records(UUID(flow_run.get_id()), count)

    try:
        computing(len(cells))
    except TerminationSignal as signal:
        raise KeyboardInterrupt from signal
