"""Tasks in the plane, in which the whole pipeline can be tried in seconds."""

from __future__ import annotations

from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.point_world import POINT_TASKS, PointTask


@register(*POINT_TASKS)
def point_task(request: Request) -> PointTask:
    """Look up a task of the plane."""
    return POINT_TASKS[request.name]
