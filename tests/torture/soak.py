"""Memory over one long evaluation: `python -m tests.torture.soak --episodes 20000`."""

from __future__ import annotations

import argparse
import os
import sys
from time import perf_counter

import psutil

from roboscribe.evaluation import measure
from roboscribe.policy import load

WARM = 0.1
"""Share of the episodes after which memory must be flat."""


def grown(sizes: list[tuple[int, int]], episodes: int) -> float:
    """Say by which share memory grew from `WARM` of the episodes to the end.

    Args:
        sizes: episodes done, and resident bytes then.
        episodes: all of them.
    """
    warm = next(size for done, size in sizes if done >= WARM * episodes)
    return sizes[-1][1] / warm - 1


def main(arguments: list[str]) -> int:
    """Evaluate a program for long; returns 1 where memory grows by a twentieth after the warm-up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default="tower-5")
    parser.add_argument("--episodes", type=int, default=20_000)
    asked = parser.parse_args(arguments)
    policy, process, start = load(asked.program), psutil.Process(os.getpid()), perf_counter()
    sizes: list[tuple[int, int]] = []

    def watch(done: int, successes: int) -> None:
        sizes.append((done, process.memory_info().rss))
        if done % 1000 == 0:
            took = f"{perf_counter() - start:.0f} s"
            sys.stdout.write(f"{done} episodes, {successes} solved, {sizes[-1][1] / 1e6:.1f} MB, {took}\n")
            sys.stdout.flush()

    found = measure(policy.runnable, policy.task, 0, asked.episodes, watch)
    share = grown(sizes, asked.episodes)
    counts = f"{process.num_fds()} files open, {process.num_threads()} threads"
    sys.stdout.write(f"{found}\nmemory after {WARM:.0%} of the episodes to the end: {share:+.2%}; {counts}\n")
    return int(share > 0.05)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
