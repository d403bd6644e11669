"""The event log of a synthesis: every event in a JSON Lines file of the run, from which it can be shown again.

Reports, `roboscribe show` and `roboscribe runs` read it. It stands alone: what a report shows is in it, not only where
it lies. A run that is resumed tells its events again; they are recognised by their number and keep their first time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, assert_never

from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.printer import pretty
from roboscribe.errors import ArtifactError, RoboScribeError
from roboscribe.evaluation import failures
from roboscribe.io.atomic import Json, sha256_of
from roboscribe.io.saved_program import CONTROLLERS, TREE
from roboscribe.stages.runtime.events import (
    Abandoned,
    Decision,
    Evaluated,
    Event,
    Failed,
    Filmed,
    Ingested,
    Loosened,
    Packaged,
    Programmed,
    Refined,
    Removed,
    Retrained,
    RolledOut,
    Trained,
)
from roboscribe.stages.runtime.files import read_json
from roboscribe.stages.runtime.journal import Journal, Record, read_records
from roboscribe.stages.runtime.serialization import refinement_from_json, refinement_to_json
from roboscribe.strips import Strip, Strips
from roboscribe.tree_json import tree_from_json, tree_to_json

CHRONICLE = "chronicle.jsonl"
BEGAN, ENDED = "began", "ended"


class EventLogWriter:
    """Writes the event log of one run.

    Args:
        path: the file.
        about: what is said about the run before anything happens.
    """

    def __init__(self, path: Path, about: Mapping[str, Json]) -> None:
        """Begin a log, or continue that of an interrupted run."""
        self.path = path
        self._journal = Journal(path, ("number",))
        self._count = 0
        self._append(BEGAN, about)

    def on_event(self, event: Event) -> None:
        """Append an event."""
        self._append(type(event).__name__, _encoded(event))

    def end(self, result: Mapping[str, Json]) -> None:
        """Append the result."""
        self._append(ENDED, result)

    def _append(self, kind: str, value: Mapping[str, Json]) -> None:
        self._journal.append({"number": self._count, "kind": kind, "value": dict(value)})
        self._count += 1


@dataclass(frozen=True)
class LoggedEvent:
    """One event of a log.

    Args:
        time: when, milliseconds since 1970.
        event: what.
        more: what a report shows besides, see `_encoded`.
    """

    time: int
    event: Event
    more: Mapping[str, Any]


@dataclass(frozen=True)
class EventLog:
    """The event log of one run, as it was read.

    Args:
        path: the file.
        records: its lines.
    """

    path: Path
    records: tuple[Record, ...]

    @property
    def about(self) -> Mapping[str, Any]:
        """The opening record: title, plan, commit and command."""
        return _mapping(self.records[0]["value"])

    @property
    def result(self) -> Mapping[str, Any]:
        """The result; empty where the run did not end by itself."""
        last = self.records[-1]
        return _mapping(last["value"]) if last["kind"] == ENDED else {}

    @property
    def began(self) -> int:
        """When it began, milliseconds since 1970."""
        return _time(self.records[0])

    @property
    def ended(self) -> int:
        """When the last record was written, milliseconds since 1970."""
        return _time(self.records[-1])

    @cached_property
    def entries(self) -> tuple[LoggedEvent, ...]:
        """The events in order.

        Raises:
            ArtifactError: an event cannot be read.
        """
        try:
            return tuple(_told(record, self.path) for record in self.records[1:] if record["kind"] != ENDED)
        except (KeyError, TypeError, ValueError, IndexError, RoboScribeError) as error:
            raise _refusal(self.path, error) from error


def read_event_log(path: Path) -> EventLog:
    """Read a run's event log.

    Raises:
        ArtifactError: there is no such file, or it holds something else.
    """
    if not path.is_file():
        msg = f"{path}: no such file, expected the chronicle of a run"
        raise ArtifactError(msg)
    account = EventLog(path, tuple(record for _, record in read_records(path)))
    kinds = [record.get("kind") for record in account.records]
    if kinds[:1] != [BEGAN] or not all({"number", "time", "kind", "value"} <= set(r) for r in account.records):
        msg = f"{path}: found no chronicle of a run, expected one whose first record says how it {BEGAN}"
        raise ArtifactError(msg)
    return account


def _refusal(path: Path, error: Exception) -> ArtifactError:
    return ArtifactError(f"{path}: found no chronicle of a run ({type(error).__name__}: {error})")


def _told(record: Record, path: Path) -> LoggedEvent:
    value = _mapping(record["value"])
    return LoggedEvent(_time(record), _decoded(str(record["kind"]), value, str(path)), value)


def _time(record: Record) -> int:
    return int(str(record["time"]))


def _mapping(value: Json) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        msg = f"found {type(value).__name__}, expected an object"
        raise TypeError(msg)
    return value


def _encoded(event: Event) -> dict[str, Json]:
    """Spell an event, with what its files say that a report shows."""
    match event:
        case Ingested(report, profile):
            return {"report": dict(report), "profile": profile}
        case Programmed(goal, program):
            return {"goal": goal, "program": pretty(program)}
        case Trained(goal, reports, metrics):
            return {
                "goal": goal,
                "reports": [dict(each) for each in reports],
                "metrics": str(metrics),
                "curves": _curves(metrics),
            }
        case RolledOut(goal, counts, table):
            return {"goal": goal, "counts": dict(counts), "table": str(table), "failing": _failing(table)}
        case Evaluated(figures, table):
            return {"figures": dict(figures), "table": str(table), "failing": _failing(table)}
        case Decision():
            return _decision(event)
        case Packaged() | Filmed() | Failed():
            return _ending(event)
        case _:
            assert_never(event)


def _decision(event: Refined | Abandoned | Retrained | Loosened | Removed) -> dict[str, Json]:
    match event:
        case Refined(refinement, table, tree, explained, demonstrations, strips):
            return {
                "refinement": refinement_to_json(refinement),
                "table": str(table),
                "tree": tree_to_json(tree),
                "explained": explained,
                "demonstrations": demonstrations,
                "strips": _strips_to_json(strips),
            }
        case Abandoned(reason):
            return {"reason": reason}
        case Retrained(success):
            return {"success": success}
        case Loosened(subgoal, predicate, success, helps):
            return {"subgoal": subgoal, "predicate": str(predicate), "success": success, "helps": helps}
        case Removed(subgoal, success):
            return {"subgoal": subgoal, "success": success}
        case _:
            assert_never(event)


def _ending(event: Packaged | Filmed | Failed) -> dict[str, Json]:
    match event:
        case Packaged(program, tree, directory):
            digests: Json = {name: sha256_of(directory / name) for name in (TREE, CONTROLLERS)}
            shown: Json = tree_to_json(tree)
            return {"program": pretty(program), "tree": shown, "directory": str(directory), "digests": digests}
        case Filmed(video):
            return {"video": str(video)}
        case Failed(reason):
            return {"reason": reason}
        case _:
            assert_never(event)


def _decoded(kind: str, value: Mapping[str, Any], where: str) -> Event:
    """Read what `_encoded` wrote."""
    match kind:
        case "Ingested":
            return Ingested(value["report"], value["profile"])
        case "Programmed":
            return Programmed(value["goal"], parse_program(value["program"]))
        case "Trained":
            return Trained(value["goal"], tuple(value["reports"]), Path(value["metrics"]))
        case "RolledOut":
            return RolledOut(value["goal"], value["counts"], Path(value["table"]))
        case "Evaluated":
            return Evaluated(value["figures"], Path(value["table"]))
        case "Refined":
            refinement, tree = refinement_from_json(value["refinement"], where), tree_from_json(value["tree"], where)
            known = value["explained"], value["demonstrations"], _strips_from_json(value["strips"])
            return Refined(refinement, Path(value["table"]), tree, *known)
        case _:
            return _decoded_ending(kind, value, where)


def _decoded_ending(kind: str, value: Mapping[str, Any], where: str) -> Event:
    match kind:
        case "Abandoned":
            return Abandoned(value["reason"])
        case "Retrained":
            return Retrained(value["success"])
        case "Loosened":
            predicate = parse_predicate(value["predicate"])
            return Loosened(value["subgoal"], predicate, value["success"], value["helps"])
        case "Removed":
            return Removed(value["subgoal"], value["success"])
        case "Packaged":
            tree = tree_from_json(value["tree"], where)
            return Packaged(parse_program(value["program"]), tree, Path(value["directory"]))
        case "Filmed":
            return Filmed(Path(value["video"]))
        case "Failed":
            return Failed(value["reason"])
        case _:
            msg = f"{where}: found an event {kind!r}, which this version does not know"
            raise ArtifactError(msg)


def _failing(table: Path) -> Json:
    """List the episodes of a table that failed."""
    return [list(row) for row in failures(read_json(table))]


def _curves(metrics: Path) -> Json:
    """Sort a training stage's figures: by controller and name the steps and values."""
    found: dict[str, dict[str, list[Json]]] = {}
    for _, row in read_records(metrics):
        for name, value in _mapping(row["metrics"]).items():
            found.setdefault(str(row["controller"]), {}).setdefault(name, []).append([row["step"], value])
    return {controller: {name: list(points) for name, points in own.items()} for controller, own in found.items()}


def _strips_to_json(strips: Strips) -> Json:
    rows: list[Json] = [[row.frames, [list(span) for span in row.spans], row.goal] for row in strips.rows]
    return {**asdict(strips), "rows": rows}


def _strips_from_json(value: Mapping[str, Any]) -> Strips:
    rows = (Strip(int(frames), tuple(_spans(spans)), int(goal)) for frames, spans, goal in value["rows"])
    return Strips(float(value["frequency"]), int(value["most"]), tuple(rows))


def _spans(spans: list[list[int]]) -> Iterator[tuple[int, int, int]]:
    for begin, end, count in spans:
        yield int(begin), int(end), int(count)
