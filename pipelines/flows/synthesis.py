"""The synthesis as a Prefect flow: every stage is a task run under a name that says what it is for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from uuid import UUID

from roboscribe.errors import Fail
from roboscribe.io.atomic import Json
from roboscribe.pipelines.flows.prefect_records import recording_to, wait_for_records
from roboscribe.pipelines.flows.prefect_server import PrefectServer
from roboscribe.pipelines.synthesis_pipeline import SynthesisResult, run_pipeline
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.events import EventCallback
from roboscribe.stages.runtime.store import AnyStage, Inputs
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.steps import RunStage, StoreValue


def synthesize_with_prefect(
    title: str, plan: SynthesisPlan, call: RunStage, put: StoreValue, tell: EventCallback, server: PrefectServer
) -> SynthesisResult | Fail:
    """Run `run_pipeline` as a flow whose stages are named task runs; results do not pass through Prefect.

    Args:
        title: what the flow run is called.
        plan: what is asked for.
        call: runs a stage.
        put: stores a small value.
        tell: hears what happens.
        server: hears of the flow.

    Raises:
        KeyboardInterrupt: the process was asked to end while the flow was running.
    """
    from prefect import flow, task
    from prefect.cache_policies import NO_CACHE
    from prefect.runtime import flow_run

    called: list[tuple[AnyStage, Any, Inputs]] = []

    @task(name="stage", task_run_name="{label}", retries=0, persist_result=False, cache_policy=NO_CACHE)
    def run_stage(label: str, stage: str, config: Json, inputs: Mapping[str, str]) -> str:
        return str(call(label, *called[-1]))

    def named(label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
        called.append((stage, config, inputs))
        return Path(run_stage(label, stage.name, encode(config), {name: str(path) for name, path in inputs.items()}))

    @flow(name="synthesis", flow_run_name=title, retries=0, persist_result=False)
    def synthesis(task_name: str, seed: int) -> SynthesisResult | Fail:
        found = run_pipeline(plan, named, put, tell)
        wait_for_records(UUID(flow_run.get_id()), len(called))
        return found

    with recording_to(server):
        return synthesis(plan.task.name, plan.seed)
