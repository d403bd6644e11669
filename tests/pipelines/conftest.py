"""What tests of the command line share."""

from __future__ import annotations

from pathlib import Path

import pytest

from roboscribe.pipelines import cli
from tests.pipelines.runs import Command


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Command:
    """Run a command in an empty home without tracking; returns its exit code."""
    monkeypatch.setenv("ROBOSCRIBE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("roboscribe.stages.tracking.tracker.Tracker.start", lambda tracker: None)

    def call(*arguments: object) -> int:
        monkeypatch.setattr("sys.argv", ["roboscribe", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0)

    return call
