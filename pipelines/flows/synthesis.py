"""The synthesis as a Prefect flow: every stage is a task run under a name that says what it is for."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated
from uuid import UUID

from pydantic import Field

from roboscribe.errors import Fail
from roboscribe.pipelines.flows.prefect_pages import FlowLog, publish
from roboscribe.pipelines.flows.prefect_records import recording_to, wait_for_records
from roboscribe.pipelines.flows.prefect_server import PrefectServer
from roboscribe.pipelines.flows.stage_tasks import StageTasks
from roboscribe.pipelines.synthesis_pipeline import SynthesisResult, run_pipeline
from roboscribe.stages.runtime.events import Event, EventCallback
from roboscribe.stages.runtime.store import AnyStage, Inputs
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.steps import RunStage, StoreValue


def synthesize_with_prefect(
    title: str,
    plan: SynthesisPlan,
    call: RunStage,
    put: StoreValue,
    tell: EventCallback,
    server: PrefectServer,
    mlflow_run: Callable[[], str | None],
) -> SynthesisResult | Fail:
    """Run `run_pipeline` as a flow whose stages are named task runs; results do not pass through Prefect.

    While the server starts, stages run already; the flow finds them done.

    Args:
        title: what the flow run is called.
        plan: what is asked for.
        call: runs a stage.
        put: stores a small value.
        tell: hears what happens.
        server: hears of the flow.
        mlflow_run: returns the id of the run in MLflow, for a link; None where it has none yet.

    Raises:
        KeyboardInterrupt: the process was asked to end while the flow was running.
    """
    from prefect import flow
    from prefect.runtime import flow_run

    tasks, log = StageTasks(call), FlowLog(tell)
    told = run_ahead(plan, call, put, log.on_event, server)

    @flow(name="synthesis", flow_run_name=title, retries=0, persist_result=False)
    def synthesis(task_name: str, seed: Annotated[int, Field(ge=0)]) -> SynthesisResult | Fail:
        found, run = run_pipeline(plan, tasks.run, put, after(told, log.on_event)), UUID(flow_run.get_id())
        log.send(run)
        publish(title, found, mlflow_run())
        wait_for_records(run, tasks.count)
        return found

    with recording_to(server):
        return synthesis(plan.task.name, plan.seed)


class _ServerIsThere(Exception):  # noqa: N818 - nothing is wrong
    """The flow may begin."""


def run_ahead(plan: SynthesisPlan, call: RunStage, put: StoreValue, tell: EventCallback, server: PrefectServer) -> int:
    """Run the stages of a pipeline for as long as the server is starting; a stage that was begun is finished.

    A stage that fails ends this, too: the flow runs it again, so that Prefect records why, or tries once more.

    Returns:
        How many events were told.
    """
    told = 0

    def count(event: Event) -> None:
        nonlocal told
        tell(event)
        told += 1

    def call_meanwhile(label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
        if not server.is_starting():
            raise _ServerIsThere
        return call(label, stage, config, inputs)

    with suppress(Exception):
        run_pipeline(plan, call_meanwhile, put, count)
    return told


def after(count: int, tell: EventCallback) -> EventCallback:
    """Pass on all events but the first ones, which a pipeline that begins anew tells again."""
    waiting = count

    def on_event(event: Event) -> None:
        nonlocal waiting
        if waiting:
            waiting -= 1
        else:
            tell(event)

    return on_event
