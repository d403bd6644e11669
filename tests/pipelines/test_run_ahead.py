"""While Prefect's server starts, stages run already; the flow finds them done, and tells nothing twice."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from roboscribe.errors import ArtifactError
from roboscribe.pipelines.flows.prefect_server import PrefectServer
from roboscribe.pipelines.flows.run_ahead import run_ahead
from roboscribe.pipelines.synthesis_pipeline import run_pipeline
from roboscribe.stages.runtime.events import Event
from roboscribe.stages.runtime.store import AnyStage, Inputs, Store
from tests.pipelines.runs import scripted


@dataclass(frozen=True)
class Starting(PrefectServer):
    """A server that is asked some times before it answers."""

    url: str = ""
    asked: list[None] = field(default_factory=list)
    times: int = 3

    def is_starting(self) -> bool:
        self.asked.append(None)
        return len(self.asked) <= self.times


@dataclass
class Stages:
    """Runs stages and notes which; from the `broken`-th on they fail."""

    store: Store
    labels: list[str] = field(default_factory=list)
    broken: int = 1000

    def call(self, label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
        self.labels.append(label)
        if len(self.labels) >= self.broken:
            msg = "could not be written"
            raise ArtifactError(msg)
        return self.store.run(stage, config, inputs)


@pytest.mark.parametrize(("times", "broken"), [(0, 1000), (3, 1000), (5, 4), (1000, 1000)])
def test_events_are_told_once_and_in_order(times: int, broken: int, tmp_path: Path) -> None:
    """However early the server answers, and also where a stage fails meanwhile."""
    plan, whole = scripted(), list[Event]()
    store = Store(tmp_path / "once")
    run_pipeline(plan, Stages(store).call, store.put, whole.append)
    store = Store(tmp_path / "ahead")
    stages, told = Stages(store, broken=broken), list[Event]()
    rest = run_ahead(plan, stages.call, store.put, told.append, Starting(times=times))
    count = len(told)
    assert times == 1000 or len(stages.labels) == min(times, broken)
    run_pipeline(plan, Stages(store).call, store.put, rest)
    assert [type(event) for event in told] == [type(event) for event in whole]
    assert count == len(whole) if times == 1000 else count < len(whole)


def test_a_server_that_has_ended_is_not_waited_for() -> None:
    assert not PrefectServer("http://127.0.0.1:1/api").is_starting()
