"""What tests of the command line share."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from roboscribe.pipelines import cli
from tests.pipelines.runs import Command


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Command]:
    """Run a command in an empty home without tracking; returns its exit code. Signals are handled as before then."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.setenv("ROBOSCRIBE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("roboscribe.stages.tracking.tracker.Tracker.start", lambda tracker: None)

    def call(*arguments: object) -> int:
        monkeypatch.setattr("sys.argv", ["roboscribe", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0)

    yield call
    for number, handler in handlers.items():
        signal.signal(number, handler)
