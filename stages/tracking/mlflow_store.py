"""Tracking, the copying side: brings an MLflow store up to date with the journals of runs.

Copying is idempotent: runs are found again by a tag, and a metric with the same time stamp is the same metric.
"""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

from roboscribe.io.atomic import Json, canonical_json, indented_json, parse_json, write_file
from roboscribe.io.lock import held
from roboscribe.io.tracked import DATABASE, THEIRS, has_store, quiet_mlflow, tracking_uri
from roboscribe.stages.runtime.journal import Record, read_records
from roboscribe.stages.tracking.description import experiment_description
from roboscribe.stages.tracking.mlflow_files import copy_file

if TYPE_CHECKING:
    from mlflow import MlflowClient

quiet_mlflow()

JOURNAL, STATE = "journal.jsonl", "tracking.json"
"""In a run's directory: what is to be copied, and how far it is copied under which ids."""
PARENT = ""
"""Name of the run that is the whole synthesis."""
ARTIFACTS = "artifacts"
ID_TAG = "roboscribe.id"
"""Tag by which a run is found again when its id was not written down."""
KIND_TAG, KIND = "mlflow.experimentKind", "custom_model_development"
"""Tag by which MLflow opens an experiment as one of training, not of language models."""
NOTE_TAG, PARENT_TAG = "mlflow.note.content", "mlflow.parentRunId"
ENDED = ("FINISHED", "FAILED", "KILLED")
ACTIVE = "active"
"""What MLflow says of runs and experiments that were not deleted."""
BATCH = 1000
_NEW = ".new-"
"""How directories begin in which a database is being created."""
log = logging.getLogger(__name__)


def ensure_store(mlruns: Path) -> None:
    """Create the database, once, whoever comes first; it appears whole or not at all. A user's own is left alone."""
    mlruns.mkdir(parents=True, exist_ok=True)
    with _locked(mlruns):
        if has_store(mlruns):
            return
        from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

        for left in mlruns.glob(f"{_NEW}*"):
            shutil.rmtree(left)
        with tempfile.TemporaryDirectory(dir=mlruns, prefix=_NEW) as scratch:
            fresh = Path(scratch) / DATABASE
            root = (mlruns / ARTIFACTS).resolve()
            store: Any = SqlAlchemyStore  # not typed
            store(f"sqlite:///{fresh.resolve()}", root.as_uri()).engine.dispose()
            root.mkdir(exist_ok=True)
            os.replace(fresh, mlruns / DATABASE)


def store_identity(mlruns: Path) -> list[int]:
    """Tell one database file from another at the same place, and one server from another; empty where there is none."""
    theirs = os.environ.get(THEIRS)
    if theirs:
        return [crc32(theirs.encode())]
    try:
        status = (mlruns / DATABASE).stat()
    except FileNotFoundError:
        return []
    return [status.st_dev, status.st_ino]


@dataclass
class MlflowSync:
    """Copies one journal into one store.

    Args:
        directory: of the run.
        mlruns: of the store.
        client: open on the store.
    """

    directory: Path
    mlruns: Path
    client: MlflowClient
    _runs: dict[str, str] = field(default_factory=dict)
    _experiment: str = ""
    _offset: int = 0

    def __post_init__(self) -> None:
        """Continue where the last copy stopped, or from the start where the store is another one."""
        state = _state(self.directory)
        if state.get("store") == store_identity(self.mlruns) and all(map(self._there, state["runs"].values())):
            self._runs, self._offset = dict(state["runs"]), int(state["offset"])

    def _there(self, run_id: str) -> bool:
        """Whether the store still has a run; deleted ones are restored, those that were purged are not there."""
        from mlflow.exceptions import MlflowException

        try:
            info = self.client.get_run(run_id).info
            if info.lifecycle_stage != ACTIVE:
                self._restored(info.experiment_id)
                self.client.restore_run(run_id)
        except MlflowException as error:
            if error.error_code == "RESOURCE_DOES_NOT_EXIST":
                return False
            raise
        return True

    def _restored(self, experiment_id: str) -> str:
        """Return an experiment; where it was deleted it is restored, for its name is taken for ever."""
        experiment = self.client.get_experiment(experiment_id)
        if experiment.lifecycle_stage != ACTIVE:
            self.client.restore_experiment(experiment_id)
            log.warning("experiment %s had been deleted in MLflow; it is restored", experiment.name)
        return experiment_id

    def copy(self) -> None:
        """Copy what is new.

        Raises:
            MlflowException, SQLAlchemyError, OSError: the store cannot be reached; nothing is lost.
        """
        found = list(read_records(self.directory / JOURNAL, self._offset))
        if found:
            self._experiment = self._experiment or self._find_experiment()
            self._apply([record for _, record in found])
            self._offset = found[-1][0]
            place: list[Json] = list(store_identity(self.mlruns))
            state: dict[str, Json] = {"store": place, "runs": dict(self._runs), "offset": self._offset}
            write_file(self.directory / STATE, indented_json({**state, "sum": _sum(state)}).encode())

    def mark_killed(self) -> None:
        """Mark the run as killed where its journal ends with status RUNNING."""
        own = (record for _, record in read_records(self.directory / JOURNAL) if record["run"] == PARENT)
        statuses = _of("status", own)
        if statuses and statuses[-1]["value"] not in ENDED and PARENT in self._runs:
            for run_id in self._runs.values():
                if self.client.get_run(run_id).info.status not in ENDED:
                    self.client.set_terminated(run_id, "KILLED")

    def _apply(self, records: Sequence[Record]) -> None:
        """Write records to the store; doing so twice changes nothing."""
        by_run: dict[str, list[Record]] = {}
        for record in records:
            by_run.setdefault(str(record["run"]), []).append(record)
        for name, own in by_run.items():
            run_id = self._run(name, own)
            self._scalars(run_id, own)
            for record in own:
                copy_file(self.client, run_id, record)
        for name, own in by_run.items():
            for record in (r for r in own if r["kind"] == "status"):
                self._status(name, str(record["value"]), _whole(record["time"]))

    def _run(self, name: str, own: Sequence[Record]) -> str:
        """Find or create the run of a name; children know their parent."""
        if name not in self._runs:
            identity = f"{self.directory.name}/{name}"
            query = f"tags.`{ID_TAG}` = '{identity}'"
            known = self.client.search_runs([self._experiment], query, max_results=1)
            self._runs[name] = known[0].info.run_id if known else self._create(name, identity, own)
        return self._runs[name]

    def _create(self, name: str, identity: str, own: Sequence[Record]) -> str:
        tags = {ID_TAG: identity}
        if name != PARENT:
            tags[PARENT_TAG] = self._run(PARENT, ())
        start = min((_whole(record["time"]) for record in own), default=None)
        title = name or self._opening("title")
        return str(self.client.create_run(self._experiment, start_time=start, tags=tags, run_name=title).info.run_id)

    def _scalars(self, run_id: str, own: Sequence[Record]) -> None:
        """Write metrics, parameters and tags in batches."""
        from mlflow.entities import Metric, Param, RunTag

        points = _of("metric", own)
        metrics = [Metric(_key(r), float(str(r["value"])), _whole(r["time"]), _whole(r["step"])) for r in points]
        params = [Param(_key(r), str(r["value"])) for r in _of("param", own)]
        tags = [RunTag(key, value) for key, value in {_key(r): str(r["value"]) for r in _of("tag", own)}.items()]
        for start in range(0, max(len(metrics), 1), BATCH):
            self.client.log_batch(run_id, metrics=metrics[start : start + BATCH])
        for start in range(0, len(params), 100):
            self.client.log_batch(run_id, params=params[start : start + 100])
        self.client.log_batch(run_id, tags=tags)

    def _status(self, name: str, value: str, when: int) -> None:
        """Set a run's status; the end of the parent ends its children."""
        if value not in ENDED:
            self.client.update_run(self._runs[name], status=value)
            return
        self.client.set_terminated(self._runs[name], value, end_time=when)
        for child, run_id in self._runs.items() if name == PARENT else ():
            if child != PARENT and self.client.get_run(run_id).info.status not in ENDED:
                self.client.set_terminated(run_id, value, end_time=when)

    def _find_experiment(self) -> str:
        """Find or create the experiment, whichever process comes first."""
        name = self._opening("experiment")
        with _locked(self.mlruns):
            found = self.client.get_experiment_by_name(name)
            known = self._created(name) if found is None else self._restored(str(found.experiment_id))
            for key, value in {KIND_TAG: KIND, NOTE_TAG: experiment_description(name)}.items():
                if found is None or key not in found.tags:
                    self.client.set_experiment_tag(known, key, value)
            return known

    def _created(self, name: str) -> str:
        """Create an experiment; a user's own server knows best where its artifacts go."""
        place = (self.mlruns / ARTIFACTS).resolve().as_uri()
        location = None if os.environ.get(THEIRS) else f"{place}/{_plain(name)}"
        return str(self.client.create_experiment(name, artifact_location=location))

    def _opening(self, key: str) -> str:
        """Read what the journal's opening records say about the run."""
        opening = (record for _, record in read_records(self.directory / JOURNAL) if record["kind"] == "run")
        return next(str(record["value"]) for record in opening if record["key"] == key)


def unreachable() -> tuple[type[Exception], ...]:
    """Return the exceptions of a store that is locked, damaged or missing."""
    from mlflow.exceptions import MlflowException
    from sqlalchemy.exc import SQLAlchemyError

    return (MlflowException, SQLAlchemyError, OSError)


def synchronise(runs: Path, mlruns: Path) -> None:
    """Bring the store up to date with every run that is not at work now; one that cannot be copied is named."""
    ensure_store(mlruns)
    for directory in sorted(path.parent for path in runs.glob(f"*/{JOURNAL}")):
        try:
            open_sync(directory, mlruns).copy()
        except unreachable() as error:
            log.warning("%s cannot be copied into MLflow: %s", directory, str(error).splitlines()[0])


def open_sync(directory: Path, mlruns: Path) -> MlflowSync:
    """Open the store, which is created where there is none."""
    from mlflow import MlflowClient

    ensure_store(mlruns)
    return MlflowSync(directory, mlruns, MlflowClient(tracking_uri(mlruns)))


def adopt(mlruns: Path, parent: str, children: Iterable[str]) -> None:
    """Put runs below another one, so that MLflow shows them there; best effort, for what is shown only."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri(mlruns))
    for child in children:
        try:
            client.set_tag(child, PARENT_TAG, parent)
        except unreachable() as error:
            log.warning("run %s cannot be put below %s: %s", child, parent, str(error).splitlines()[0])


def download(run_id: str, name: str, mlruns: Path, target: Path) -> Path:
    """Copy what a run kept under a name out of the store; returns where it lies.

    Raises:
        MlflowException: there is no such run, or it kept nothing of that name.
    """
    from mlflow import MlflowClient

    return Path(MlflowClient(tracking_uri(mlruns)).download_artifacts(run_id, name, str(target)))


def run_id_of(directory: Path) -> str | None:
    """Return MLflow's id of a run, None while it has none."""
    runs = _state(directory).get("runs")
    return runs.get(PARENT) if isinstance(runs, Mapping) else None


def _state(directory: Path) -> dict[str, Any]:
    """Read how far a journal is copied; nothing where that is not known, and copying again changes nothing."""
    try:
        state = parse_json((directory / STATE).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    told = {name: value for name, value in state.items() if name != "sum"} if isinstance(state, Mapping) else {}
    return told if isinstance(state, Mapping) and state.get("sum") == _sum(told) else {}


def _sum(state: Mapping[str, Json]) -> str:
    """Return a checksum."""
    return f"{crc32(canonical_json(state).encode()):08x}"


def _whole(value: Json) -> int:
    return int(str(value))


def _of(kind: str, records: Iterable[Record]) -> list[Record]:
    return [record for record in records if record["kind"] == kind]


def _key(record: Record) -> str:
    return _plain(str(record["key"]))


def _plain(name: str) -> str:
    """Replace what MLflow does not accept in a name."""
    return "".join(c if c.isascii() and (c.isalnum() or c in "_-. /") else "_" for c in name)


@contextmanager
def _locked(mlruns: Path) -> Iterator[None]:
    lock = mlruns / ".lock"
    lock.touch()
    with held(lock):
        yield
