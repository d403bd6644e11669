"""robosuite without what it does on being imported: choosing an OpenGL backend for all, and warnings of its own."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType


@contextmanager
def _quietly() -> Iterator[None]:
    """Keep warnings to itself, and the environment variable that says how MuJoCo draws as it is."""
    before, level = os.environ.get("MUJOCO_GL"), logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(level)
        os.environ.pop("MUJOCO_GL", None)
        if before is not None:
            os.environ["MUJOCO_GL"] = before


@cache
def robosuite() -> ModuleType:
    """Import robosuite (seconds, the first time), quietly, with our own environments registered."""
    with _quietly():
        import mujoco  # noqa: F401 - before robosuite sets MUJOCO_GL
        import robosuite as suite

        from roboscribe.envs.drawer import suite_env  # noqa: F401 - registers itself
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)
    module: ModuleType = suite
    return module
