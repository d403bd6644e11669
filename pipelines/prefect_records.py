"""Prefect learns of task runs by events that it handles in its own time; its server must not end before."""

from __future__ import annotations

import time
from uuid import UUID

PATIENCE = 60.0
"""Seconds to wait for records; they are for the eye only, so that a run does not fail without them."""


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
