"""Rows 14 and 15: tracking never stops a run, loses nothing, and tells nothing twice."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from time import monotonic, perf_counter, sleep

import pytest
from mlflow import MlflowClient

from roboscribe.abstraction_refinement import Limits
from roboscribe.errors import Fail
from roboscribe.io.atomic import Json
from roboscribe.io.tracked import DATABASE, database_uri
from roboscribe.stages.runtime.events import Event, Refined, Trained
from roboscribe.stages.runtime.journal import read_records
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.tracking.mlflow_store import (
    STATE,
    ensure_store,
    open_sync,
    run_id_of,
    synchronise,
)
from roboscribe.stages.tracking.tracker import Tracker, spent
from tests.pipelines.runs import run, scripted
from tests.pipelines.stores import empty_store, points, rows, statuses

CURVE = "curve/success"


def tracker(home: Path, title: str = "some run") -> Tracker:
    """Begin to track a run by hand."""
    return Tracker(home / "runs" / "abc", home / "mlruns", {"task": "t", "seed": "0"}, title, "t")


def tell(listening: Tracker, steps: range) -> None:
    """Tell a learner's figures."""
    for step in steps:
        listening.on_progress(Progress("hold", step, 100, "steps", {"success": step / 100}, time=1000 + step))


def copy(home: Path) -> None:
    """Copy the journal as it stands."""
    open_sync(home / "runs" / "abc", home / "mlruns").copy()


def expected(steps: range) -> list[tuple[object, ...]]:
    """Say what the store must hold."""
    return [("controller hold", step, step / 100) for step in steps]


def test_every_step_is_a_run_or_a_figure(tmp_path: Path) -> None:
    """A whole synthesis: parent, one child per refinement and training, evaluation; same parameters on each."""
    mlruns, trained, refined = empty_store(tmp_path / "mlruns"), list[str](), list[str]()

    def note(event: Event) -> None:
        match event:
            case Trained(_, reports, _):
                trained.extend(str(report["controller"]) for report in reports)
            case Refined(refinement, _):
                refined.append(refinement.node.name)
            case _:
                pass

    run(scripted(), tmp_path, on_event=note)
    synchronise(tmp_path / "data" / "runs", mlruns)
    assert {"R", "hold", "at"} == set(trained)
    assert {"hold", "at"} == set(refined)
    before = [trained[:i].count(name) for i, name in enumerate(trained)]
    repeated = [f"{name}, training {n + 1}" if n else name for name, n in zip(trained, before, strict=True)]
    children = [f"controller {name}" for name in repeated] + [f"refinement {i + 1}" for i in range(len(refined))]
    names = {"point-pick-place-1 seed 0", "evaluation", *children}
    assert statuses(mlruns) == dict.fromkeys(names, "FINISHED")
    shared = rows(
        mlruns, "select key, count(*) from params where key in ('task', 'seed', 'profile', 'kind') group by key"
    )
    assert dict(shared) == dict.fromkeys(("task", "seed", "profile", "kind"), len(names))  # type: ignore[arg-type]
    assert [value for name, _, value in points(mlruns, "success") if name == "evaluation"] == [1.0]
    assert [row[2] for row in points(mlruns, "refinements")] == [1.0, 2.0, 2.0]
    parents = rows(mlruns, "select count(*) from tags where key = 'mlflow.parentRunId'")
    assert parents == [(len(names) - 1,)]
    ((digest,),) = rows(mlruns, "select digest from datasets")
    assert len(str(digest)) == 36
    found = {path.name for path in (mlruns / "artifacts").rglob("*") if path.is_file()}
    assert found >= {"program.txt", "tree.json", "tree.png", "predicates.json", "episodes.json", "refinement.json"}


def test_copying_again_changes_nothing(tmp_path: Path) -> None:
    """Also where the copier died before it noted how far it was."""
    empty_store(tmp_path / "mlruns")
    tell(tracker(tmp_path), range(5))
    copy(tmp_path)
    before = rows(tmp_path / "mlruns", "select run_uuid, name from runs")
    (tmp_path / "runs" / "abc" / STATE).unlink()
    copy(tmp_path)
    assert points(tmp_path / "mlruns", CURVE) == expected(range(5))
    assert rows(tmp_path / "mlruns", "select run_uuid, name from runs") == before


def test_a_resumed_run_tells_no_point_twice(tmp_path: Path) -> None:
    empty_store(tmp_path / "mlruns")
    tell(tracker(tmp_path), range(5))
    copy(tmp_path)
    tell(tracker(tmp_path), range(2, 8))
    copy(tmp_path)
    assert points(tmp_path / "mlruns", CURVE) == expected(range(8))
    assert len(statuses(tmp_path / "mlruns")) == 2


def test_another_store_is_filled_from_the_start(tmp_path: Path) -> None:
    empty_store(tmp_path / "mlruns")
    listening = tracker(tmp_path)
    tell(listening, range(3))
    copy(tmp_path)
    tell(listening, range(3, 6))
    other = empty_store(tmp_path / "other")
    open_sync(tmp_path / "runs" / "abc", other).copy()
    assert points(other, CURVE) == expected(range(6))
    copy(tmp_path)
    assert points(tmp_path / "mlruns", CURVE) == expected(range(6))


@pytest.fixture
def following(tmp_path: Path) -> Iterator[Tracker]:
    """Track a run with the process that copies."""
    empty_store(tmp_path / "mlruns")
    listening = tracker(tmp_path)
    listening.start()
    yield listening
    listening.close(timeout=0.0)


def test_row_15_a_store_deleted_and_locked_during_a_run(tmp_path: Path, following: Tracker) -> None:
    """Telling never waits; after the end everything is there once."""
    tell(following, range(3))
    shutil.rmtree(tmp_path / "mlruns")
    tell(following, range(3, 6))
    empty_store(tmp_path / "mlruns")
    with sqlite3.connect(tmp_path / "mlruns" / DATABASE, isolation_level=None) as database:
        database.execute("begin exclusive")
        tell(following, range(6, 9))
        following.status("FINISHED")
        database.execute("rollback")
    assert following.close() == run_id_of(tmp_path / "runs" / "abc")
    assert points(tmp_path / "mlruns", CURVE) == expected(range(9))
    assert set(statuses(tmp_path / "mlruns").values()) == {"FINISHED"}


def test_row_15_an_unreachable_store_is_filled_later(tmp_path: Path) -> None:
    """Where the directory of the store should be lies a file: the run ends well, its figures come later."""
    (tmp_path / "mlruns").write_text("not a directory")
    listening = tracker(tmp_path)
    listening.start()
    tell(listening, range(4))
    listening.status("FINISHED")
    assert listening.close(timeout=0.5) is None
    (tmp_path / "mlruns").unlink()
    empty_store(tmp_path / "mlruns")
    synchronise(tmp_path / "runs", tmp_path / "mlruns")
    assert points(tmp_path / "mlruns", CURVE) == expected(range(4))
    assert set(statuses(tmp_path / "mlruns").values()) == {"FINISHED"}


def test_a_run_whose_process_died_is_marked(tmp_path: Path, following: Tracker) -> None:
    """Row 1: kill -9 leaves no word, but the copying process notices."""
    tell(following, range(2))
    following.close()
    assert set(statuses(tmp_path / "mlruns").values()) == {"KILLED"}


def test_row_14_four_processes_create_one_store(tmp_path: Path) -> None:
    import mlflow.store.tracking.sqlalchemy_store  # noqa: F401 - once, before the processes part

    processes = [get_context("fork").Process(target=ensure_store, args=(tmp_path / "mlruns",)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(120)
    assert [process.exitcode for process in processes] == [0] * 4
    assert rows(tmp_path / "mlruns", "select name from experiments") == [("Default",)]
    assert sorted(path.name for path in (tmp_path / "mlruns").iterdir()) == [".lock", "artifacts", DATABASE]


def test_a_synthesis_that_fails_is_tracked_with_its_reason(tmp_path: Path) -> None:
    mlruns = empty_store(tmp_path / "mlruns")
    result = run(scripted(limits=Limits(refinements=0)), tmp_path)
    assert isinstance(result, Fail)
    synchronise(tmp_path / "data" / "runs", mlruns)
    assert statuses(mlruns)["point-pick-place-1 seed 0"] == "FAILED"
    assert rows(mlruns, "select value from tags where key = 'reason'") == [(result.reason,)]


def word(run: str, kind: str, value: object, time: int) -> dict[str, Json]:
    """Write a record of a journal."""
    return {"run": run, "kind": kind, "key": kind, "value": str(value), "time": time}


def test_the_times_of_all_attempts_add_up() -> None:
    """One that was killed without a word lasted until its last one."""
    first = [word("", "status", "RUNNING", 1000), word("controller hold", "metric", 0.5, 4000)]
    second = [word("", "status", "RUNNING", 900_000), word("", "status", "KILLED", 901_500)]
    back = [word("", "status", "RUNNING", 500), word("", "status", "FINISHED", 2500)]
    assert spent([]) == 0.0
    assert spent(first) == 3.0
    assert spent(first + second) == 4.5
    assert spent(first + second + back) == 6.5, "a clock that was put back takes nothing away"


def test_a_resumed_run_has_one_result(tmp_path: Path) -> None:
    """Formerly each attempt told every figure anew, and `wall_seconds` was that of the last."""

    def interrupt(label: str) -> None:
        if label.startswith("train"):
            sleep(1.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scripted(), tmp_path, on_stage=interrupt)
    start = perf_counter()
    resumed = run(scripted(), tmp_path)
    own = perf_counter() - start
    assert isinstance(resumed, dict)
    assert float(str(resumed["wall_seconds"])) > own + 0.9
    assert run(scripted(), tmp_path) == resumed
    (journal,) = (tmp_path / "data" / "runs").glob("*/journal.jsonl")
    told = [r["key"] for _, r in read_records(journal) if r["run"] == "" and r["kind"] == "metric"]
    assert told.count("wall_seconds") == told.count("evaluation_steps") == 1


def delete_experiment(home: Path) -> MlflowClient:
    """Delete the experiment as a user of MLflow's interface does."""
    client = MlflowClient(database_uri(home / "mlruns"))
    experiment = client.get_experiment_by_name("t")
    assert experiment is not None
    client.delete_experiment(experiment.experiment_id)
    return client


def test_a_deleted_experiment_is_restored(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Formerly the next run waited 45 s and told nothing, and `roboscribe ui` died."""
    empty_store(tmp_path / "mlruns")
    listening = tracker(tmp_path)
    tell(listening, range(3))
    copy(tmp_path)
    client = delete_experiment(tmp_path)
    tell(listening, range(3, 6))
    synchronise(tmp_path / "runs", tmp_path / "mlruns")
    assert points(tmp_path / "mlruns", CURVE) == expected(range(6))
    assert {run.info.lifecycle_stage for run in client.search_runs(["1"])} == {"active"}
    assert [record.message for record in caplog.records] == ["experiment t had been deleted in MLflow; it is restored"]


@pytest.mark.torture
@pytest.mark.row(15)
def test_an_experiment_deleted_during_a_run_is_restored(tmp_path: Path, following: Tracker) -> None:
    tell(following, range(3))
    end = monotonic() + 60
    while points(tmp_path / "mlruns", CURVE) != expected(range(3)):
        assert monotonic() < end
        sleep(0.1)
    delete_experiment(tmp_path)
    tell(following, range(3, 6))
    following.status("FINISHED")
    assert following.close() == run_id_of(tmp_path / "runs" / "abc")
    assert points(tmp_path / "mlruns", CURVE) == expected(range(6))


def test_purged_runs_are_filled_from_the_start(tmp_path: Path) -> None:
    empty_store(tmp_path / "mlruns")
    listening = tracker(tmp_path)
    tell(listening, range(3))
    copy(tmp_path)
    state = tmp_path / "runs" / "abc" / STATE
    with sqlite3.connect(tmp_path / "mlruns" / DATABASE) as database:
        for table in ("metrics", "latest_metrics", "params", "tags", "runs"):
            database.execute(f"delete from {table}")
    assert state.exists()
    tell(listening, range(3, 6))
    copy(tmp_path)
    assert points(tmp_path / "mlruns", CURVE) == expected(range(6))


def test_a_run_that_cannot_be_copied_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The interface comes up all the same."""
    empty_store(tmp_path / "mlruns")
    tell(tracker(tmp_path), range(2))
    (tmp_path / "mlruns" / DATABASE).write_bytes(b"no database at all" * 100)
    synchronise(tmp_path / "runs", tmp_path / "mlruns")
    assert "abc cannot be copied into MLflow" in caplog.text
