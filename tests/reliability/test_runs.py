"""Rows 1, 4, 5, 14 and 16: whatever happens to a run, the same command ends with the same program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import psutil
import pytest

from roboscribe.abstraction_refinement import Limits
from roboscribe.rl.config import CloneConfig
from roboscribe.stages import train
from roboscribe.stages.runtime.journal import read_records
from roboscribe.stages.runtime.store import PROGRESS
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.tracking.mlflow_store import synchronise
from tests.conftest import TORTURE, Figure, effort
from tests.pipelines.runs import contents, learned, outputs, run, scripted
from tests.pipelines.stores import empty_store, statuses

FORK = get_context("fork")
RUN = "-m roboscribe.pipelines.cli synthesize point-pick-place-1 --profile scripted --episodes 40"
COMMAND = RUN.split()
"""Words behind the interpreter."""
"""Children that need not import anything again."""
PROGRAM = {"controllers.safetensors", "manifest.json", "program.txt", "tree.json"}


def start(
    plan: SynthesisPlan, home: Path, fatal: Callable[[str], bool] = lambda path: False, sent: int = signal.SIGKILL
) -> BaseProcess:
    """Run a plan in a process of its own, which gets a signal right before it creates or renames a `fatal` file."""

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        creates = event == "open" and isinstance(arguments[2], int) and arguments[2] & os.O_CREAT
        path = str(arguments[0])
        if (creates or event == "os.rename") and path.startswith(str(home)) and fatal(path):
            os.kill(os.getpid(), sent)

    def work() -> None:
        sys.addaudithook(watch)
        run(plan, home)

    process = FORK.Process(target=work)
    process.start()
    return process


def _is_over(moments: Iterator[int], path: str) -> bool:
    """Tell whether there are no moments left."""
    del path
    return next(moments, None) is None


def stopped_until_done(plan: SynthesisPlan, home: Path, seed: int, sent: int = signal.SIGKILL) -> int:
    """Run a plan again and again, each time stopped before one of its next writes; returns how often it was stopped."""
    rng = np.random.default_rng(seed)
    for stops in range(60):
        moments = iter(range(int(rng.integers(1, 20 * (stops + 1)))))
        process = start(plan, home, partial(_is_over, moments), sent)
        process.join()
        if process.exitcode == 0:
            return stops
        assert process.exitcode == (-sent if sent == signal.SIGKILL else 1)
    pytest.fail("the run never ended")


def tower() -> SynthesisPlan:
    """SynthesisPlan a tower in the plane."""
    return scripted(task="point-tower-3")


PLANS = [learned, *([scripted, tower] if TORTURE in os.environ else [])]


@pytest.mark.parametrize("plan", PLANS)
@pytest.mark.parametrize("seed", range(effort(1, 5)))
def test_row_1_a_killed_run_goes_on_to_the_same_end(
    plan: Callable[[], SynthesisPlan], seed: int, tmp_path: Path, figure: Figure
) -> None:
    assert isinstance(run(plan(), tmp_path / "whole"), dict)
    kills = stopped_until_done(plan(), tmp_path / "killed", seed)
    assert kills >= 3
    assert contents(tmp_path / "killed" / "program") == contents(tmp_path / "whole" / "program")
    assert outputs(tmp_path / "killed") == outputs(tmp_path / "whole")
    figure("kills -9 survived", kills, kills)


@pytest.mark.torture
@pytest.mark.parametrize("seed", range(4))
def test_row_16_an_interrupted_run_goes_on_to_the_same_end(seed: int, tmp_path: Path, figure: Figure) -> None:
    run(scripted(), tmp_path / "whole")
    stops = stopped_until_done(scripted(), tmp_path / "stopped", seed, signal.SIGINT)
    assert contents(tmp_path / "stopped" / "program") == contents(tmp_path / "whole" / "program")
    assert outputs(tmp_path / "stopped") == outputs(tmp_path / "whole")
    assert told_statuses(tmp_path / "stopped").count("KILLED") <= stops
    assert told_statuses(tmp_path / "stopped")[-1] == "FINISHED"
    figure("SIGINT survived", stops, stops)


def reinforced() -> SynthesisPlan:
    """Plan a synthesis that hardly clones its first subgoal, and reinforces it whatever the clone is like."""
    plan = learned()
    assert plan.training is not None
    clone = CloneConfig(steps=2, least_steps=2, checkpoints=1, patient_steps=2)
    training = replace(plan.training, clone=clone, worth_improving=0.0)
    return replace(plan, limits=Limits(success=0.9, programs=2), training=training)


def test_row_3_a_learner_goes_on_from_any_checkpoint_to_the_same_weights(tmp_path: Path, figure: Figure) -> None:
    plan, killed = reinforced(), 0
    run(plan, tmp_path / "whole")
    for number in range(1, effort(2, 12) + 1):
        home, written = tmp_path / str(number), iter(range(number))

        def at_checkpoint(path: str, written: Iterator[int] = written) -> bool:
            return ".progress.safetensors" in path and next(written, None) is None

        process = start(plan, home, at_checkpoint)
        process.join()
        killed += process.exitcode == -signal.SIGKILL
        run(plan, home)
        assert outputs(home) == outputs(tmp_path / "whole")
    assert killed >= 2
    figure("checkpoints gone on from, same bits", killed, killed)


def test_row_1_finished_stages_are_not_repeated(tmp_path: Path) -> None:
    stopped: list[str] = []

    def stop_at_classify(label: str) -> None:
        stopped.append(label)
        if label.startswith("classify"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scripted(), tmp_path, on_stage=stop_at_classify)
    written = {path: path.stat().st_mtime_ns for path in (tmp_path / "data" / "stages").rglob("manifest.json")}
    assert len(written) == len(stopped) - 1
    run(scripted(), tmp_path)
    assert {path: path.stat().st_mtime_ns for path in written} == written


def test_row_1_a_stage_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    """Killed within PPO, the learner does not begin again: no figure is told twice, and its weights are the same."""
    plan, written = reinforced(), iter(range(3))
    process = start(
        plan, tmp_path / "killed", lambda path: ".progress.safetensors" in path and next(written, None) is None
    )
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert len(list((tmp_path / "killed").glob(f"data/stages/train/*/{PROGRESS}/*.progress.safetensors"))) == 1
    resumed: list[int] = []
    run(plan, tmp_path / "killed", on_progress=lambda p: resumed.append(p.done) if p.unit == "steps" else None)
    run(plan, tmp_path / "whole")
    assert outputs(tmp_path / "killed") == outputs(tmp_path / "whole")
    told, undisturbed = (points(tmp_path / home) for home in ("killed", "whole"))
    assert told == undisturbed
    assert len(resumed) < len(undisturbed)


def points(home: Path) -> list[tuple[object, ...]]:
    """List controller, step and names of every figure that training told."""
    paths = (home / "data" / "stages" / train.STAGE.name).glob("*/metrics.jsonl")
    return sorted((r["controller"], r["step"], str(r["names"])) for path in paths for _, r in read_records(path))


@pytest.mark.parametrize("_attempt", range(effort(1, 3)))
def test_row_4_the_seed_decides(tmp_path: Path, _attempt: int) -> None:
    for home, seed in (("first", 0), ("again", 0), ("other", 1)):
        run(learned(seed), tmp_path / home)
    first, again, other = (contents(tmp_path / home / "program") for home in ("first", "again", "other"))
    assert set(first) == {*PROGRAM, "onnx/R.onnx"}
    assert first == again
    assert outputs(tmp_path / "first") == outputs(tmp_path / "again")
    assert first["controllers.safetensors"] != other["controllers.safetensors"]


def test_row_14_the_same_run_twice_at_once(tmp_path: Path) -> None:
    both = [start(scripted(), tmp_path / "both") for _ in range(2)]
    for process in both:
        process.join()
    assert [process.exitcode for process in both] == [0, 0]
    run(scripted(), tmp_path / "alone")
    assert contents(tmp_path / "both" / "program") == contents(tmp_path / "alone" / "program")
    assert outputs(tmp_path / "both") == outputs(tmp_path / "alone")


@pytest.mark.torture
def test_row_14_four_runs_on_a_fresh_store_with_the_default_engine(tmp_path: Path, figure: Figure) -> None:
    """Four commands at once, each starting Prefect's server on the same new database and MLflow's on the same store."""
    command = [sys.executable, *COMMAND, "--home", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    runs = [subprocess.Popen([*command, "--seed", str(seed)], env=environment) for seed in range(4)]
    assert [process.wait(600) for process in runs] == [0] * 4
    found = statuses(tmp_path / "mlruns")
    figure("runs at once", sum(found[f"point-pick-place-1 seed {seed}"] == "FINISHED" for seed in range(4)), 4)


def test_row_16_an_interrupt_is_noted(tmp_path: Path) -> None:
    """What Ctrl-C raises wherever it finds the run; the next attempt is a word of its own."""

    def interrupt(label: str) -> None:
        if label.startswith("train"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scripted(), tmp_path, on_stage=interrupt)
    assert told_statuses(tmp_path) == ["RUNNING", "KILLED"]
    run(scripted(), tmp_path)
    assert told_statuses(tmp_path) == ["RUNNING", "KILLED", "RUNNING", "FINISHED"]


def told_statuses(home: Path) -> list[object]:
    """List what a run's journal says about how the run stands."""
    (journal,) = (home / "data" / "runs").glob("*/journal.jsonl")
    own = (record for _, record in read_records(journal) if record["run"] == "")
    return [record["value"] for record in own if record["kind"] == "status"]


def test_row_16_a_signal_ends_a_command_cleanly(tmp_path: Path) -> None:
    """The command ends with a word about going on, leaves no process behind, and its run is marked as killed."""
    command = [sys.executable, "-m", "roboscribe.pipelines.cli", "synthesize", "point-pick-place-1"]
    command += ["--profile", "scripted", "--engine", "local", "--episodes", "50000", "--home", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    empty_store(tmp_path / "mlruns")
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        wait_for(lambda: any((tmp_path / "data").glob("stages/roll_out/*/manifest.json")))
        family = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGTERM)
        said = process.communicate(timeout=300)[1]
    finally:
        process.kill()
    assert process.returncode == 130
    assert b"the same command goes on from here" in said
    assert b"Traceback" not in said
    assert family, "the process that copies the journal was at work; now and then it has a short-lived child"
    _, alive = psutil.wait_procs(family, timeout=120)
    assert alive == []
    assert told_statuses(tmp_path) == ["RUNNING", "KILLED"]
    synchronise(tmp_path / "data" / "runs", tmp_path / "mlruns")
    assert statuses(tmp_path / "mlruns")["point-pick-place-1 seed 0"] == "KILLED"


def wait_for(happened: Callable[[], bool], seconds: float = 300.0) -> None:
    """Wait until something happened."""
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.002)
