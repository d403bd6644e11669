"""A stage that fails of what may pass by itself is tried again; one whose input is wrong is not."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from roboscribe.errors import ArtifactError, TaskError
from roboscribe.pipelines.flows.retries import may_pass


def wrapped(error: OSError) -> ArtifactError:
    """Return an error of ours that came from one of the system."""
    ours = ArtifactError("could not be written")
    ours.__cause__ = error
    return ours


@pytest.mark.parametrize(
    ("error", "passes"),
    [
        (OSError(errno.ESTALE, "stale file handle"), True),
        (wrapped(OSError(errno.EIO, "input/output error")), True),
        (wrapped(OSError(errno.ENOSPC, "no space left")), False),
        (TaskError("unknown task"), False),
        (FileNotFoundError(errno.ENOENT, "no such file"), False),
    ],
    ids=str,
)
def test_which_errors_may_pass(error: Exception, passes: bool) -> None:
    assert may_pass(error) is passes


SCRIPT = """
import errno, sys
from pathlib import Path
from roboscribe.pipelines.flows import stage_tasks
from roboscribe.pipelines.flows.prefect_settings import configure_prefect
configure_prefect()
stage_tasks.DELAYS[:] = [0.0, 0.0]
from prefect import flow
from roboscribe.errors import TaskError
from roboscribe.stages import validate
from roboscribe.stages.runtime.task_config import TaskConfig

calls = []
def call(label, stage, config, inputs):
    calls.append(label)
    if label == "wrong":
        raise TaskError("wrong input")
    if len(calls) < 3:
        raise OSError(errno.ESTALE, "stale file handle")
    return Path("out")

@flow(retries=0)
def work():
    tasks, config = stage_tasks.StageTasks(call), validate.Config(TaskConfig("tower-5"))
    out = tasks.run("flaky", validate.STAGE, config, {})
    try:
        tasks.run("wrong", validate.STAGE, config, {})
    except TaskError as error:
        print(out, calls, error)

work()
"""


@pytest.mark.slow
def test_prefect_tries_again_what_may_pass(tmp_path: Path) -> None:
    paths = {"PYTHONPATH": os.pathsep.join(sys.path), "PREFECT_HOME": str(tmp_path)}
    ended = subprocess.run(
        [sys.executable, "-c", SCRIPT], env={**os.environ, **paths}, capture_output=True, text=True, timeout=300
    )
    assert ended.stdout.strip() == "out ['flaky', 'flaky', 'flaky', 'wrong'] wrong input", ended.stderr
