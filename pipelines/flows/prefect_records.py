"""Waiting until Prefect has recorded what happened: it handles events of task runs asynchronously."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from uuid import UUID

from roboscribe.pipelines.flows.prefect_server import PrefectServer

PATIENCE = 60.0
"""Seconds to wait for records; they are for the eye only, so that a run does not fail without them."""
HASTE = 0.5
"""The same where someone waits for the run to end."""


def wait_for_records(flow_run: UUID, tasks: int) -> bool:
    """Wait until Prefect has recorded the end of every task run of a flow run; False when patience ends first."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId, TaskRunFilter, TaskRunFilterState
    from prefect.client.schemas.filters import TaskRunFilterStateType as StateTypes
    from prefect.client.schemas.objects import TERMINAL_STATES

    mine = FlowRunFilter(id=FlowRunFilterId(any_=[flow_run]))
    ended = TaskRunFilter(state=TaskRunFilterState(type=StateTypes(any_=list(TERMINAL_STATES))))
    deadline = time.monotonic() + PATIENCE
    with get_client(sync_client=True) as client:
        while time.monotonic() < deadline:
            found = 0
            while page := client.read_task_runs(flow_run_filter=mine, task_run_filter=ended, limit=200, offset=found):
                found += len(page)
            if found >= tasks:
                return True
            time.sleep(0.2)
    return False


@contextmanager
def recording_to(server: PrefectServer) -> Iterator[None]:
    """Connect the flows within to a server once it answers; wait until everything is recorded when they are over.

    Raises:
        KeyboardInterrupt: the process was asked to end, in whatever words Prefect says so.
        RoboScribeError: the server did not start.
    """
    from prefect.events.worker import EventsWorker
    from prefect.exceptions import TerminationSignal
    from prefect.settings import PREFECT_API_URL, PREFECT_FLOWS_HEARTBEAT_FREQUENCY, temporary_settings

    server.wait()
    patience = PATIENCE
    # our own server ends with the flow and watches over nothing; the thread of heartbeats ends up to a second late
    calm = {} if server.process is None else {PREFECT_FLOWS_HEARTBEAT_FREQUENCY: None}
    with temporary_settings({PREFECT_API_URL: server.url, **calm}):
        try:
            yield
        except (TerminationSignal, KeyboardInterrupt) as signal:
            patience = HASTE
            raise KeyboardInterrupt from signal
        finally:  # at the end of the process Prefect would look for a server that is gone
            EventsWorker.drain_all(timeout=patience)
