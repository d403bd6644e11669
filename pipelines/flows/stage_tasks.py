"""Stages as task runs of Prefect, which know of each other who made whose inputs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from roboscribe.io.atomic import Json
from roboscribe.pipelines.flows.retries import DELAYS, worth_another_try
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.store import AnyStage, Inputs
from roboscribe.stages.steps import RunStage


class StageTasks:
    """Runs stages as named task runs of the flow within which it is used.

    Prefect would tell by where a result lies in memory which task run it came from, and draw edges between task runs
    that have nothing to do with each other. So task runs return nothing, and each is told which others it waited for:
    those in whose outputs its inputs lie.

    Args:
        call: runs a stage.
    """

    def __init__(self, call: RunStage) -> None:
        """Declare the task."""
        from prefect import task
        from prefect.cache_policies import NO_CACHE

        self._call = call
        self._states: dict[Path, Any] = {}
        self._work: tuple[AnyStage, object, Inputs] | None = None
        self._out = Path()
        declare = task(
            name="stage",
            task_run_name="{label}",
            retries=len(DELAYS),
            retry_delay_seconds=DELAYS,
            retry_condition_fn=worth_another_try,
            persist_result=False,
            cache_policy=NO_CACHE,
        )
        self._task = declare(self._stage)
        self.count = 0

    def run(self, label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
        """Run a stage; returns the directory of its outputs."""
        self.count += 1
        self._work = stage, config, inputs
        makers = {id(state): state for path in inputs.values() for state in self._makers(path)}
        shown: dict[str, Json] = {name: str(path) for name, path in inputs.items()}
        state = self._task(label, stage.name, encode(config), shown, wait_for=[*makers.values()], return_state=True)
        state.result()  # raises what the stage raised
        self._states[self._out] = state
        return self._out

    def _stage(self, label: str, stage: str, config: Json, inputs: dict[str, Json]) -> None:
        """Run a stage; what is passed is for the eye of a reader."""
        assert self._work is not None
        self._out = self._call(label, *self._work)

    def _makers(self, path: Path) -> list[Any]:
        """Return the task run that made a file, if any did."""
        return [self._states[above] for above in path.parents if above in self._states]
