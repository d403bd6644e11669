"""Measurements as a Prefect flow: every one is a task run under a name that says what is measured where."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from uuid import UUID

from roboscribe.pipelines.flows.prefect_records import recording_to, wait_for_records
from roboscribe.pipelines.flows.prefect_server import PrefectServer


def measure_with_prefect(
    title: str, labels: Sequence[str], measure: Callable[[int], None], server: PrefectServer
) -> None:
    """Run `measure` for every label's number as a flow of named task runs; results do not pass through Prefect.

    Args:
        title: name of the flow.
        labels: names of the task runs.
        measure: does one measurement.
        server: hears of the flow.

    Raises:
        KeyboardInterrupt: the process was asked to end while the flow was running.
    """
    from prefect import flow, task
    from prefect.cache_policies import NO_CACHE
    from prefect.runtime import flow_run

    @task(name="measurement", task_run_name="{label}", retries=0, persist_result=False, cache_policy=NO_CACHE)
    def run_one(label: str, number: int) -> None:
        measure(number)

    @flow(name=title, flow_run_name=title, retries=0, persist_result=False)
    def measuring(count: int) -> None:
        for number, label in enumerate(labels):
            run_one(label, number)
        wait_for_records(UUID(flow_run.get_id()), count)

    with recording_to(server):
        measuring(len(labels))
