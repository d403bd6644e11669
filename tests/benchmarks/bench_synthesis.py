"""Where the seconds of a whole synthesis go, from the start of the command to the program.

    python -m tests.benchmarks.bench_synthesis [TASK ...]      # else pick-place-1, tower-5 and push-3

Every second belongs to the innermost of these that it was spent in: simulation (worlds that are built, stepped, loaded
and read), gradient updates, controllers at work (what they see and what they answer), the scripted demonstrator, the
search for predicates and guards. The rest is imports, files, Prefect and MLflow.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import wraps
from time import perf_counter
from typing import Any

TASKS = ("pick-place-1", "tower-5", "push-3")
SIMULATION, LEARNING, ACTING, SHOWING, SEARCH, REST = (
    "simulation",
    "gradient updates",
    "controllers",
    "demonstrator",
    "search",
    "rest",
)
KINDS = (SIMULATION, LEARNING, ACTING, SHOWING, SEARCH, REST)
STARTED = "ROBOSCRIBE_BENCH_STARTED"
"""Environment variable with the time at which the command was started."""


class Shares:
    """Adds up seconds by what they were spent on; calls may be nested, and may come from one thread only."""

    def __init__(self, start: float) -> None:
        """Begin with the rest, at a time of the system's clock."""
        self.seconds: dict[str, float] = defaultdict(float)
        self._open, self._since = [REST], start

    def _turn(self) -> None:
        now = perf_counter()
        self.seconds[self._open[-1]] += now - self._since
        self._since = now

    def timed(self, kind: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with its calls counted as `kind`."""

        @wraps(function)
        def call(*args: object, **options: object) -> object:
            self._turn()
            self._open.append(kind)
            try:
                return function(*args, **options)
            finally:
                self._turn()
                self._open.pop()

        return call

    def total(self) -> float:
        """Close the books; returns all seconds."""
        self._turn()
        return sum(self.seconds.values())

    def watch(self, kind: str, owner: object, *names: str) -> None:
        """Count calls of an owner's functions or methods as `kind`."""
        for name in names:
            setattr(owner, name, self.timed(kind, getattr(owner, name)))


def watch_everything(shares: Shares) -> None:
    """Count what a synthesis calls."""
    from rsl_rl.algorithms import PPO

    from roboscribe.envs.fetch_world import FetchWorld
    from roboscribe.envs.table_top_world import TableTopWorld
    from roboscribe.rl import warm_start
    from roboscribe.rl.observation import Encoder
    from roboscribe.rl.skill import Skill
    from roboscribe.stages import classify, collect, generate, update_tree
    from roboscribe.stages.runtime.store import AnyStage

    clone: Callable[..., Iterator[object]] = vars(warm_start)["clone"]

    def clones(*arguments: object) -> Iterator[object]:
        """Clone, and leave the seconds between two clones to whoever measures them."""
        made = clone(*arguments)
        following = shares.timed(LEARNING, lambda: next(made, None))
        while (found := following()) is not None:
            yield found

    for world in (FetchWorld, TableTopWorld):
        shares.watch(SIMULATION, world, "__init__", "reset", "step", "observe", "load", "save")
    shares.watch(LEARNING, PPO, "update")
    shares.watch(LEARNING, warm_start, "fit_inverse")
    shares.watch(ACTING, PPO, "act")
    shares.watch(ACTING, Skill, "act")
    shares.watch(ACTING, Encoder, "__call__")
    shares.watch(SHOWING, collect, "demonstrate")
    setattr(warm_start, "clone", clones)  # noqa: B010 - the module does not export it
    for module in (classify, update_tree, generate):
        stage: AnyStage = vars(module)["STAGE"]
        setattr(module, "STAGE", replace(stage, run=shares.timed(SEARCH, stage.run)))  # noqa: B010 - the same


def run(task: str, home: str) -> None:
    """Synthesize in this process, as the command does, and print a row."""
    shares = Shares(float(os.environ[STARTED]))
    from roboscribe.pipelines.cli import app

    watch_everything(shares)
    try:
        app(["synthesize", task, "--seed", "0", "--home", home, "--quiet"], standalone_mode=False)
    finally:
        total = shares.total()
    columns = " ".join(f"{shares.seconds[kind]:8.1f} ({shares.seconds[kind] / total:4.0%})" for kind in KINDS)
    print(f"{task:14s} {total:8.1f} {columns}", flush=True)


def main() -> None:
    """Print the table, each task in a process of its own."""
    print(f"{'seconds':14s} {'all':>8s} " + " ".join(f"{kind:>16s}" for kind in KINDS), flush=True)
    for task in sys.argv[1:] or TASKS:
        with tempfile.TemporaryDirectory() as home:
            environment = {**os.environ, STARTED: str(perf_counter())}
            command = [sys.executable, "-c", f"from {__spec__.name} import run; run({task!r}, {home!r})"]
            subprocess.run(command, env=environment, check=True)


if __name__ == "__main__":
    main()
