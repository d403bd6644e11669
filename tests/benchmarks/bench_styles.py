"""Length and success of demonstrations by style.

    python -m tests.benchmarks.bench_styles [EPISODES [TASK ...]]

Counts attempts, not what is left of them: a file of demonstrations holds successful ones alone. A length is the
control steps of a successful attempt, and what it is compared with is the task's horizon.
"""

from __future__ import annotations

import sys

import numpy as np

from roboscribe.envs.catalogue import make_task
from roboscribe.envs.demonstrator import DemonstrationAttempt, ScriptedTask, run, start
from roboscribe.envs.styles import choices, style_names

TASKS = ("pick-place-1", "pick-place-4", "tower-5")
SEED = 1


def attempts(name: str, style: str, count: int) -> list[DemonstrationAttempt]:
    """Try to give `count` demonstrations."""
    task = make_task(name)
    assert isinstance(task, ScriptedTask)
    wave = [start(SEED, index, choices(style)) for index in range(count)]
    run(task, task.world(count), wave)
    return wave


def main(count: int = 40, *names: str) -> None:
    """Print the table."""
    print(f"{'task':16}{'style':10}{'solved':>12}{'median':>8}{'longest':>9}{'horizon':>9}")
    for name in names or TASKS:
        for style in style_names():
            wave = attempts(name, style, count)
            lengths = [len(episode.actions) for episode in wave if episode.succeeded]
            row = f"{len(lengths)} of {count}", np.median(lengths), max(lengths), make_task(name).horizon
            print(f"{name:16}{style:10}{row[0]:>12}{row[1]:8.0f}{row[2]:9}{row[3]:9}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40, *sys.argv[2:])
