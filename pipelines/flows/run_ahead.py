"""Stages run while Prefect's server starts; the flow then finds them done, and tells nothing twice."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from roboscribe.pipelines.flows.prefect_server import PrefectServer
from roboscribe.pipelines.synthesis_pipeline import run_pipeline
from roboscribe.stages.runtime.events import Event, EventCallback
from roboscribe.stages.runtime.store import AnyStage, Inputs
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.steps import RunStage, StoreValue


class _ServerIsThere(Exception):  # noqa: N818 - nothing is wrong
    """The flow may begin."""


def run_ahead(
    plan: SynthesisPlan, call: RunStage, put: StoreValue, tell: EventCallback, server: PrefectServer
) -> EventCallback:
    """Run the stages of a pipeline for as long as the server is starting; a stage that was begun is finished.

    A stage that fails ends this, too: the flow runs it again, so that Prefect records why, or tries once more.

    Returns:
        Whom the flow, which begins anew, tells what happens: it passes on what was not told yet.
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
    return _after(told, tell)


def _after(count: int, tell: EventCallback) -> EventCallback:
    """Pass on all events but the first ones, which a pipeline that begins anew tells again."""
    waiting = count

    def on_event(event: Event) -> None:
        nonlocal waiting
        if waiting:
            waiting -= 1
        else:
            tell(event)

    return on_event
