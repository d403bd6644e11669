"""What is written down about a run tells it again, once, and stands alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.errors import ArtifactError
from roboscribe.stages.runtime.events import (
    Abandoned,
    Evaluated,
    Event,
    Failed,
    Loosened,
    Refined,
    Removed,
    Retrained,
    RolledOut,
)
from roboscribe.stages.tracking.event_log import CHRONICLE, EventLogWriter, read_event_log
from tests.pipelines.runs import run, scripted


def written(home: Path) -> Path:
    return next(home.glob(f"data/runs/*/{CHRONICLE}"))


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Event]]:
    """Return the home of a run and what was heard of it."""
    home, heard = tmp_path_factory.mktemp("home"), list[Event]()
    run(scripted(), home, on_event=heard.append)
    return home, heard


def test_a_run_is_told_as_it_was_heard(told: tuple[Path, list[Event]]) -> None:
    home, heard = told
    account = read_event_log(written(home))
    assert [each.event for each in account.entries] == heard
    assert account.about["title"] == "point-pick-place-1 seed 0"
    assert account.about["plan"]["task"]["name"] == "point-pick-place-1"
    assert account.result["success"] == 1.0
    assert account.began <= min(each.time for each in account.entries) <= account.ended


def test_failing_episodes_and_strips_are_in_it(told: tuple[Path, list[Event]]) -> None:
    account = read_event_log(written(told[0]))
    tried = [each for each in account.entries if isinstance(each.event, RolledOut)]
    for each in tried:
        assert isinstance(each.event, RolledOut)
        lost = each.event.counts["episodes"] - each.event.counts["successes"]
        assert len(each.more["failing"]) == lost
    assert any(each.more["failing"] for each in tried), "the first program fails"
    final = [each.more["failing"] for each in account.entries if isinstance(each.event, Evaluated)]
    assert final == [[]]
    strips = [each.event.strips for each in account.entries if isinstance(each.event, Refined)]
    assert [len(each.rows) for each in strips] == [12, 12], "one row per demonstration"


def test_it_stands_alone(told: tuple[Path, list[Event]], tmp_path: Path) -> None:
    shutil.copy(written(told[0]), tmp_path / "elsewhere.jsonl")
    assert [each.event for each in read_event_log(tmp_path / "elsewhere.jsonl").entries] == told[1]


def test_a_run_that_goes_on_tells_nothing_twice(told: tuple[Path, list[Event]]) -> None:
    home, heard = told
    path = written(home)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:5]) + lines[5][:40])
    assert not read_event_log(path).result
    run(scripted(), home)
    assert path.read_bytes().splitlines(keepends=True)[:5] == lines[:5], "what was told keeps its time"
    assert [each.event for each in read_event_log(path).entries] == heard
    before = path.read_bytes()
    run(scripted(), home)
    assert path.read_bytes() == before


LOOSENED = Loosened("hold", parse_predicate("‖μ↓xyz − b1↓xyz‖ < 0.02"), 0.95, helps=True)


def test_what_ends_without_a_program_says_why(tmp_path: Path) -> None:
    path = tmp_path / CHRONICLE
    ends = (Abandoned("too slow"), Retrained(0.5), LOOSENED, Removed("hold", 0.5), Failed("nothing separates"))
    event_log = EventLogWriter(path, {"title": "t"})
    for event in ends:
        event_log.on_event(event)
    event_log.end({"reason": "nothing separates"})
    found = read_event_log(path)
    assert tuple(each.event for each in found.entries) == ends
    assert found.result == {"reason": "nothing separates"}


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{}\n",
        b'{"number":0,"kind":"ended","time":1,"value":{}}\n',
        b'{"number":0,"kind":"began","time":1,"value":{}}\n{"number":1,"kind":"Danced","time":2,"value":{}}\n',
        b'{"number":0,"kind":"began","time":1,"value":{}}\n{"number":1,"kind":"Failed","time":2,"value":{}}\n',
        b'{"number":0,"kind":"began","time":1,"value":{}}\n{"number":1,"kind":"Failed","time":2,"value":[]}\n',
    ],
)
def test_another_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / CHRONICLE
    path.write_bytes(content)
    with pytest.raises(ArtifactError, match=CHRONICLE):
        assert read_event_log(path).entries


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="no such file"):
        read_event_log(tmp_path / CHRONICLE)
