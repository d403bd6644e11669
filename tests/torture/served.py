"""What many runs of the flow leave behind: `python -m tests.torture.served --runs 100`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import psutil

from tests.pipelines.runs import run, scripted

EVERY = 10
"""Runs between two lines."""


@dataclass(frozen=True)
class Held:
    """What a process holds.

    Args:
        processes: its children, and theirs.
        files: open files, sockets and pipes.
        threads: of it.
        ports: on which it or they listen.
        unfinished: files in the home that were being written.
        memory: resident, MB.
    """

    processes: int
    files: int
    threads: int
    ports: int
    unfinished: int
    memory: float

    @staticmethod
    def now(home: Path) -> Held:
        """Look."""
        own = psutil.Process()
        family = own.children(recursive=True)
        ports = [each for member in (own, *family) for each in member.net_connections() if each.status == "LISTEN"]
        unfinished = len(list(home.rglob("*.unfinished")))
        return Held(len(family), own.num_fds(), own.num_threads(), len(ports), unfinished, own.memory_info().rss / 1e6)


def serve(runs: int, home: Path, tell: Callable[[str], object]) -> list[Held]:
    """Run the flow again and again with other seeds, on one store, tracked; returns what was held after each run."""
    start, held = perf_counter(), []
    for seed in range(runs):
        result = run(scripted(seed), home, "prefect", track=True)
        assert isinstance(result, dict), result
        held.append(Held.now(home))
        if (seed + 1) % EVERY == 0 or seed in (0, runs - 1):
            tell(f"{seed + 1} runs, {perf_counter() - start:.0f} s: {held[-1]}\n")
    return held


def main(arguments: list[str]) -> int:
    """Run; returns 1 where something is left over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    with tempfile.TemporaryDirectory() as scratch:
        home = Path(scratch)
        held = serve(parser.parse_args(arguments).runs, home, sys.stdout.write)
        psutil.wait_procs(psutil.Process().children(recursive=True), timeout=120)
        first, last = held[0], Held.now(home)
    sys.stdout.write(f"at the end: {last}; {last.memory / first.memory - 1:+.1%} memory since the first run\n")
    return int(bool(last.processes or last.ports or last.unfinished or last.files > first.files + 5))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
