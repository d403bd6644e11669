"""The synthesis as a Prefect flow: every stage is a task run under a name that says what it is for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated
from uuid import UUID

from pydantic import Field

from roboscribe.errors import Fail
from roboscribe.pipelines.flows.prefect_pages import FlowLog, publish
from roboscribe.pipelines.flows.prefect_records import recording_to, wait_for_records
from roboscribe.pipelines.flows.prefect_server import PrefectServer
from roboscribe.pipelines.flows.stage_tasks import StageTasks
from roboscribe.pipelines.synthesis_pipeline import SynthesisResult, run_pipeline
from roboscribe.stages.runtime.events import EventCallback
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

    @flow(name="synthesis", flow_run_name=title, retries=0, persist_result=False)
    def synthesis(task_name: str, seed: Annotated[int, Field(ge=0)]) -> SynthesisResult | Fail:
        found, run = run_pipeline(plan, tasks.run, put, log.on_event), UUID(flow_run.get_id())
        log.send(run)
        publish(title, found, mlflow_run())
        wait_for_records(run, tasks.count)
        return found

    with recording_to(server):
        return synthesis(plan.task.name, plan.seed)
