"""The bench on the command line: `python -m tests.quality.bench --help`."""

from __future__ import annotations

import argparse
import sys
from itertools import groupby

from tests.quality.bench.bench import TASKS, Result, attempts, share_right

WIDTH = 110
"""Most characters of a reason that the table shows."""


def main(arguments: list[str] | None = None) -> None:
    """Print the table of the tasks that were asked for."""
    options = _options().parse_args(arguments)
    names = options.task or [n for n, task in TASKS.items() if options.all or task.held_out == options.held_out]
    unknown = [name for name in names if name not in TASKS]
    if unknown:
        sys.exit(f"unknown task {unknown[0]!r}; known are {', '.join(n for n, t in TASKS.items() if not t.held_out)}")
    first, last = (int(end) for end in f"{options.seeds}-{options.seeds}".split("-")[:2])
    _print(f"{'task':34s} {'right':>5s} {'wrong':>5s} {'Fail':>5s} {'error':>5s} {'seconds':>8s}  first reason")
    done: list[Result] = []
    for name, group in groupby(attempts(names, range(first, last + 1), options.jobs), key=lambda r: r.task):
        results = list(group)
        done += results
        _print(_row(name, results))
        if options.show:
            _print("\n".join(_listing(result) for result in results))
    for label, held_out in (("development", False), ("held out", True)):
        mine = [result for result in done if TASKS[result.task].held_out == held_out]
        if mine:
            right = sum(result.outcome == "right" for result in mine)
            _print(f"{label}: {right} of {len(mine)} runs right, {share_right(mine):.0%}")


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.quality.bench", description=__doc__)
    parser.add_argument("--seeds", default="0", help="one seed, or first-last (default 0)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--task", nargs="+", metavar="NAME", help="only these tasks")
    parser.add_argument("--show", action="store_true", help="print the programs")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--all", action="store_true", help="also the tasks that were set aside")
    which.add_argument("--held-out", action="store_true", help="only those")
    return parser


def _row(name: str, results: list[Result]) -> str:
    counts = [sum(r.outcome == outcome for r in results) for outcome in ("right", "wrong", "Fail", "error")]
    seconds = sum(r.seconds for r in results) / len(results)
    reason = next((f"seed {r.seed}: {r.reason}" for r in results if r.reason), "")
    shown = reason if len(reason) <= WIDTH else reason[: WIDTH - 1] + "…"
    return f"{name:34s} " + " ".join(f"{count:5d}" for count in counts) + f" {seconds:8.1f}  {shown}"


def _listing(result: Result) -> str:
    text = f"-- {result.task}, seed {result.seed}: {result.outcome}. {result.reason}\n{result.program}"
    return "\n".join(f"    {line}" for line in text.splitlines())


def _print(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
