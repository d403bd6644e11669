"""What surrounds a run: full disks, no network, other locales and paths, clocks that go backwards, read-only code."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from roboscribe.errors import RoboScribeError
from roboscribe.stages.runtime.journal import read_records
from tests.conftest import Figure, effort
from tests.pipelines.runs import contents, outputs, run, scripted
from tests.reliability.terminal import ROOT
from tests.reliability.test_runs import COMMAND, FORK

FULL = 7
"""Exit code of a child that met a full disk and said so."""


def on_full_disk(home: Path, most: int) -> int:
    """Run in a process in which no file may grow beyond `most` bytes; returns its exit code."""

    def work() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        try:
            run(scripted(), home)
        except (RoboScribeError, OSError) as error:
            os._exit(1 if "\n" in str(error) else FULL)

    process = FORK.Process(target=work)
    process.start()
    process.join()
    return int(process.exitcode or 0)


def test_row_13_a_full_disk_is_said_and_the_run_goes_on_later(tmp_path: Path, figure: Figure) -> None:
    run(scripted(), tmp_path / "whole")
    limits = np.geomspace(40, 60_000, effort(5, 60)).astype(int)
    codes = [on_full_disk(tmp_path / "full", int(most)) for most in limits]
    assert set(codes) <= {0, FULL}
    assert codes[0] == FULL
    run(scripted(), tmp_path / "full")
    assert contents(tmp_path / "full" / "program") == contents(tmp_path / "whole" / "program")
    assert outputs(tmp_path / "full") == outputs(tmp_path / "whole")
    assert not list((tmp_path / "full").rglob("*.unfinished"))
    figure("full disks survived", len(codes), len(limits))


@pytest.mark.torture
def test_row_13_a_small_disk_fills_up(tmp_path: Path, figure: Figure) -> None:
    """Disks of 100 kB to 3 MB, really full: one line, exit code 2, and the same command goes on when there is room."""
    held, sizes = 0, [100, 200, 400, 800, 1600, 3000]
    for size in sizes:
        disk, rest = tmp_path / str(size), tmp_path / f"rest-{size}"
        disk.mkdir()
        words = " ".join([sys.executable, *COMMAND, "--engine", "local", "--home", str(disk)])
        script = (
            f"mount -t tmpfs -o size={size}k disk {disk} && {{ {words}; code=$?; cp -r {disk} {rest}; exit $code; }}"
        )
        command = ["unshare", "-rm", "sh", "-c", script]
        ended = subprocess.run(command, capture_output=True, text=True, env=environment(), cwd=ROOT)
        assert ended.returncode in (0, 2), ended.stderr
        assert "Traceback" not in ended.stderr
        again = [sys.executable, *COMMAND, "--engine", "local", "--home", str(rest)]
        held += subprocess.run(again, capture_output=True, env=environment(), cwd=ROOT).returncode == 0
    figure("small disks survived", held, len(sizes))


def environment(**more: str) -> dict[str, str]:
    """Return the environment of commands."""
    return {**os.environ, "PYTHONPATH": str(ROOT), **more}


@pytest.mark.torture
def test_row_17_nothing_is_asked_of_a_network(tmp_path: Path, figure: Figure) -> None:
    """Every connection and look-up of a whole synthesis, tracking included."""
    script = (
        "import sys; from pathlib import Path\n"
        "asked = []\n"
        "def watch(event, arguments):\n"
        "    if event in ('socket.connect', 'socket.getaddrinfo', 'socket.gethostbyname'):\n"
        "        asked.append(str(arguments[1] if event == 'socket.connect' else arguments[0]))\n"
        "sys.addaudithook(watch)\n"
        "from tests.pipelines.runs import run, scripted\n"
        "run(scripted(), Path(sys.argv[1]))\n"
        "print([place for place in asked if '127.0.0.1' not in place and 'localhost' not in place])\n"
    )
    command = [sys.executable, "-c", script, str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment(), cwd=ROOT)
    assert ended.stdout.strip() == "[]", ended.stderr
    figure("runs without a connection outward", 1, 1)


@pytest.mark.torture
def test_row_17_the_default_engine_needs_no_network(tmp_path: Path, figure: Figure) -> None:
    """A network of its own in which there is the loopback address alone."""
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rn", "true"]).returncode:
        pytest.skip("this system gives no network of its own")
    up = (
        "import fcntl, socket, struct, os, sys\n"
        "with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:\n"
        "    fcntl.ioctl(s, 0x8914, struct.pack('16sh', b'lo', 0x1 | 0x40))\n"
        "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])\n"
    )
    command = ["unshare", "-rn", sys.executable, "-c", up, *COMMAND, "--home", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment(), cwd=ROOT)
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    figure("runs in a network of the loopback address", 1, 1)


@pytest.mark.parametrize("name", ["with blanks", "größe-日本-é", "a'b\"c$(d)", "-dash", "[bold]x"])
def test_row_20_any_name_of_a_directory_will_do(tmp_path: Path, name: str) -> None:
    result = run(scripted(), tmp_path / name)
    assert isinstance(result, dict)
    assert result["program_dir"] == str(tmp_path / name / "program")


@pytest.mark.torture
@pytest.mark.parametrize("locale", ["POSIX", "C", "tr_TR.UTF-8"])
def test_row_20_programs_are_read_and_shown_in_any_locale(tmp_path: Path, locale: str) -> None:
    """Files are UTF-8 whatever the system thinks; what a terminal cannot show is escaped."""
    home = tmp_path / "home"
    assert isinstance(run(scripted(), home), dict)
    plain = environment(LC_ALL=locale, LANG=locale, PYTHONUTF8="0", PYTHONCOERCECLOCALE="0", PYTHONIOENCODING="")
    command = [sys.executable, *COMMAND, "--engine", "local", "--home", str(home), "--seed", "1"]
    code = "import sys; from roboscribe.stages.tracking.tracker import Tracker; Tracker.start = lambda tracker: None; "
    code += "sys.argv = sys.argv[1:]; from roboscribe.pipelines.cli import main; main()"
    ended = subprocess.run([sys.executable, "-c", code, *command[2:]], capture_output=True, env=plain, cwd=ROOT)
    assert ended.returncode == 0, ended.stderr
    assert b"Traceback" not in ended.stderr
    assert b"def PointPickPlace1" in ended.stdout


@pytest.mark.torture
def test_row_15_a_clock_that_goes_backwards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, figure: Figure) -> None:
    """Times decide nothing: the same outputs, every point once, no negative durations."""
    run(scripted(), tmp_path / "whole")
    now = count(time.time_ns(), -3_600_000_000_000)
    monkeypatch.setattr("roboscribe.stages.runtime.journal.time_ns", lambda: next(now))
    monkeypatch.setattr("time.time", lambda: next(now) / 1e9)
    result = run(scripted(), tmp_path / "back")
    assert isinstance(result, dict)
    assert float(str(result["wall_seconds"])) >= 0
    assert run(scripted(), tmp_path / "back") == result
    assert outputs(tmp_path / "back") == outputs(tmp_path / "whole")
    (journal,) = (tmp_path / "back" / "data" / "runs").glob("*/journal.jsonl")
    keys = [(r["run"], r["kind"], r["key"], r["step"]) for _, r in read_records(journal) if r["kind"] == "metric"]
    assert len(keys) == len(set(keys))
    figure("clocks put back", 1, 1)


@pytest.mark.torture
def test_row_13_a_checkout_that_cannot_be_written(tmp_path: Path, figure: Figure) -> None:
    """Nothing is written beside the sources."""
    words = " ".join([sys.executable, *COMMAND, "--home", str(tmp_path)])
    script = f"mount --bind {ROOT} {ROOT} && mount -o remount,ro,bind {ROOT} && cd / && {words}"
    ended = subprocess.run(["unshare", "-rm", "sh", "-c", script], capture_output=True, text=True, env=environment())
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    figure("read-only checkouts", 1, 1)
