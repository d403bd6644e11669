"""Journals: nothing is lost, nothing told twice, torn lines are cut off."""

from __future__ import annotations

from pathlib import Path

from roboscribe.stages.runtime.journal import Journal, read_records


def journal(path: Path) -> Journal:
    return Journal(path, ("name", "step"))


def values(path: Path) -> list[object]:
    return [record["value"] for _, record in read_records(path)]


def test_a_record_told_again_keeps_its_first_value_and_time(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    first = journal(path).append({"name": "a", "step": 1, "value": 1.0})
    again = journal(path).append({"name": "a", "step": 1, "value": 2.0})
    journal(path).append({"name": "a", "step": 2, "value": 3.0})
    assert again == first
    assert values(path) == [1.0, 3.0]


def test_a_torn_last_line_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    for step in range(3):
        journal(path).append({"name": "a", "step": step, "value": step})
    whole = path.read_bytes()
    last = whole.rindex(b"{")
    for length in range(last, len(whole)):
        path.write_bytes(whole[:length])
        journal(path).append({"name": "b", "step": 0, "value": "after"})
        assert values(path) == [0, 1, "after"]


def test_reading_goes_on_from_an_end(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    assert list(read_records(path)) == []
    own = journal(path)
    own.append({"name": "a", "step": 0, "value": "early"})
    end, _ = next(read_records(path))
    own.append({"name": "a", "step": 1, "value": "late"})
    assert [record["value"] for _, record in read_records(path, end)] == ["late"]


def test_a_given_time_is_kept(tmp_path: Path) -> None:
    told = journal(tmp_path / "journal.jsonl").append({"name": "a", "step": 0, "value": 0, "time": 123})
    assert told["time"] == 123
