"""Runs of a workspace: listing them, and finding one by any name a user has for it."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roboscribe.errors import ArtifactError, did_you_mean
from roboscribe.io.atomic import sha256_of
from roboscribe.io.lock import is_held
from roboscribe.io.saved_program import CONTROLLERS, MANIFEST, TREE, SavedProgram, load_program
from roboscribe.io.tracked import DATABASE, has_store
from roboscribe.pipelines.workspace import Workspace
from roboscribe.programs import program_directory, shipped_names
from roboscribe.stages.runtime.events import Packaged
from roboscribe.stages.runtime.journal import read_records
from roboscribe.stages.tracking.event_log import CHRONICLE, EventLog, read_event_log
from roboscribe.stages.tracking.mlflow_store import ENDED, JOURNAL, PARENT, download, run_id_of

KEY = re.compile(r"[0-9a-f]{4,32}")
"""What keys of runs, and MLflow's run ids, look like, and how they begin."""
SHOWN = 8
"""Characters of a run's key that are shown; any beginning that is one run's only will do."""


@dataclass(frozen=True)
class RunRecord:
    """A run of a workspace.

    Args:
        directory: where it is kept.
        status: RUNNING, FINISHED, FAILED or KILLED.
        account: what was written down about it.
    """

    directory: Path
    status: str
    account: EventLog

    @property
    def key(self) -> str:
        """Its key: the name of its directory."""
        return self.directory.name

    @property
    def program(self) -> Path | None:
        """Directory of the program that it found, None where there is none any more."""
        packaged = [told.event.directory for told in self.account.entries if isinstance(told.event, Packaged)]
        published = [Path(str(self.account.result[name])) for name in ("program_dir",) if name in self.account.result]
        return next((path for path in (*packaged, *published) if (path / MANIFEST).is_file()), None)


@dataclass(frozen=True)
class LoadedRun:
    """What there is under a name that a user gave.

    Args:
        name: the name, or how the run's key begins.
        directory: of the program; None where there is none.
        program: the program, loaded.
        account: what was written down about the run that found it; None where nobody knows any more.
        status: how the run ended; "" where nobody knows.
    """

    name: str
    directory: Path | None
    program: SavedProgram | None
    account: EventLog | None
    status: str = ""

    @property
    def manifest(self) -> Mapping[str, Any]:
        """The program's manifest."""
        return {} if self.program is None else self.program.manifest


def list_runs(workspace: Workspace) -> tuple[RunRecord, ...]:
    """List the runs of a workspace, the latest first; those that were killed before their first record are left out.

    Raises:
        ArtifactError: what was written down about one is damaged.
    """
    found = (
        _open_directory(path.parent)
        for path in workspace.data.glob(f"runs/*/{CHRONICLE}")
        if next(read_records(path), None)
    )
    return tuple(sorted(found, key=lambda run: -run.account.began))


@contextmanager
def open_run(name: str, workspace: Workspace) -> Iterator[LoadedRun]:
    """Find a run or program.

    Args:
        name: a program's directory, a run's directory or key (or how it begins), an MLflow run id, or the name of a
            shipped program.
        workspace: where runs are kept.

    Raises:
        ArtifactError: there is nothing of this name, or it is damaged.
    """
    run = _find_run(name, workspace)
    if run is not None:
        program = run.program
        loaded = None if program is None else load_program(program)
        yield LoadedRun(run.key[:SHOWN], program, loaded, run.account, run.status)
    elif KEY.fullmatch(name) and len(name) == 32 and not Path(name).exists():
        with _from_mlflow(name, workspace.mlruns) as found:
            yield found
    elif not Path(name).exists() and name not in shipped_names():
        expected = "a program's directory, a run that `roboscribe runs` lists, an MLflow run id, or a shipped program"
        hint = did_you_mean(name, shipped_names())
        msg = f"run {name}: there is nothing of this name; {hint}expected {expected} ({', '.join(shipped_names())})"
        raise ArtifactError(msg)
    else:
        with program_directory(name, workspace.mlruns) as directory:
            run = _run_that_made(directory, workspace)
            about = (None, "") if run is None else (run.account, run.status)
            yield LoadedRun(name, directory, load_program(directory), *about)


def _open_directory(directory: Path) -> RunRecord:
    return RunRecord(directory, _status(directory), read_event_log(directory / CHRONICLE))


def _status(directory: Path) -> str:
    """Return a run's status; one that claims to be running although no process holds it was killed."""
    own = (record for _, record in read_records(directory / JOURNAL) if record["run"] == PARENT)
    said = [str(record["value"]) for record in own if record["kind"] == "status"]
    last = said[-1] if said else "KILLED"
    return last if last in ENDED or is_held(directory) else "KILLED"


def _find_run(name: str, workspace: Workspace) -> RunRecord | None:
    """Find a run by its directory, its key, how that begins, or its MLflow id.

    Raises:
        ArtifactError: several runs begin so.
    """
    if (Path(name) / CHRONICLE).is_file():
        return _open_directory(Path(name))
    if not KEY.fullmatch(name) or Path(name).exists():
        return None
    directories = [path.parent for path in workspace.data.glob(f"runs/*/{CHRONICLE}")]
    found = [path for path in directories if path.name.startswith(name) or run_id_of(path) == name]
    if len(found) > 1:
        names = ", ".join(sorted(path.name[: len(name) + 4] for path in found))
        msg = f"run {name}: {len(found)} runs begin so ({names}); expected more characters"
        raise ArtifactError(msg)
    return _open_directory(found[0]) if found else None


def _run_that_made(directory: Path, workspace: Workspace) -> RunRecord | None:
    """Find the latest run that made a program, by the digests of tree and controllers; its text may be edited."""
    if not all((directory / name).is_file() for name in (TREE, CONTROLLERS)):
        return None
    digests = {name: sha256_of(directory / name) for name in (TREE, CONTROLLERS)}
    return next((run for run in list_runs(workspace) if _digests(run.account) == digests), None)


def _digests(account: EventLog) -> Mapping[str, Any]:
    """Read which program a run made."""
    made: list[Any] = [record["value"] for record in account.records if record["kind"] == Packaged.__name__]
    return dict(made[-1]["digests"]) if made else {}


@contextmanager
def _from_mlflow(run_id: str, mlruns: Path) -> Iterator[LoadedRun]:
    """Copy a run's program and event log out of MLflow into a temporary directory.

    Raises:
        ArtifactError: the store has no such run, or the run has neither.
    """
    from mlflow.exceptions import MlflowException

    if not has_store(mlruns):
        msg = f"run {run_id}: looks like an MLflow run id, but there is no tracking store {mlruns / DATABASE}"
        raise ArtifactError(msg)
    with tempfile.TemporaryDirectory() as scratch:
        places: dict[str, Path] = {}
        for name in ("program", CHRONICLE):
            try:
                places[name] = download(run_id, name, mlruns, Path(scratch))
            except (MlflowException, OSError) as error:
                reason = str(error).splitlines()[0]
        if not places:
            msg = f"run {run_id}: the tracking store {mlruns} has neither a program nor a chronicle of it ({reason})"
            raise ArtifactError(msg)
        program, account = places.get("program"), places.get(CHRONICLE)
        loaded = None if program is None else load_program(program)
        yield LoadedRun(run_id, program, loaded, None if account is None else read_event_log(account))
