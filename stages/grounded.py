"""Programs with their controllers, and running them episode by episode."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from roboscribe.controllers import Library, from_parts
from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.syntax import Program
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import SavedProgram
from roboscribe.subtask_tree import ROOT
from roboscribe.world.layout import IntArray
from roboscribe.world.task import Task
from stages.progress import Progress, Report, silent
from stages.skills import as_controllers

WAVE = 125
"""Episodes between two messages of progress."""


@dataclass(frozen=True)
class Grounded:
    """A program that can run.

    Args:
        program: P.
        library: its controllers.
        limits: step limit by controller.
        confirm: consecutive steps for which a subgoal must hold.
    """

    program: Program
    library: Library
    limits: Mapping[str, int]
    confirm: int = 3


def waves(
    grounded: Grounded, task: Task, seeds: IntArray, goal: str = ROOT, report: Report = silent
) -> Iterator[Rollouts]:
    """Run a program once from every seed, in waves, telling after each how many succeeded so far."""
    successes, what = 0, f"roll out {goal}"
    report(Progress(what, 0, len(seeds), "episodes"))
    for start in range(0, len(seeds), WAVE):
        rollouts = execute(
            grounded.program,
            as_controllers(grounded.library),
            task,
            seeds[start : start + WAVE],
            limits=grounded.limits,
            batch=min(task.most_rows, WAVE),
            until_end=goal != ROOT,
            confirm=grounded.confirm,
        )
        successes += int(rollouts.success.sum())
        done = min(start + WAVE, len(seeds))
        report(Progress(what, done, len(seeds), "episodes", {"success": successes / done}))
        yield rollouts


def grounded(saved: SavedProgram, task: Task, where: str) -> Grounded:
    """Make a saved program ready to run on a task.

    Raises:
        ArtifactError: its controllers or limits cannot be used.
        ProgramError: its text, edited perhaps, is no program.
    """
    limits: Any = saved.manifest.get("limits", {})
    confirm = saved.manifest.get("confirm", 3)
    sound = isinstance(limits, Mapping) and all(isinstance(steps, int) for steps in limits.values())
    if not sound or not isinstance(confirm, int):
        msg = f"{where}: found limits {limits!r} and confirm {confirm!r}, expected steps by controller and a count"
        raise ArtifactError(msg)
    library = from_parts(saved.controllers, saved.weights, task, where)
    return Grounded(parse_program(saved.program_text), library, limits, confirm)


def summary(done: list[Rollouts]) -> dict[str, Json]:
    """Count what happened."""
    return {
        "successes": sum(int(rollouts.success.sum()) for rollouts in done),
        "episodes": sum(len(rollouts.success) for rollouts in done),
        "diverged": sum(int(rollouts.diverged.sum()) for rollouts in done),
        "control_steps": sum(rollouts.control_steps for rollouts in done),
    }


def episode_table(done: list[Rollouts], seeds: IntArray) -> dict[str, Json]:
    """List every episode: its seed, how it ended, and after how many control steps."""
    rows = [
        [int(won), int(broken), len(lines)]
        for rollouts in done
        for won, broken, lines in zip(rollouts.success, rollouts.diverged, rollouts.lines, strict=True)
    ]
    data: list[Json] = [[i, int(seed), *row] for i, (seed, row) in enumerate(zip(seeds, rows, strict=True))]
    return {"columns": ["episode", "seed", "success", "diverged", "steps"], "data": data}


def failures(table: Mapping[str, Any]) -> list[list[int]]:
    """List the episodes of a table that failed: number, seed, whether physics broke, control steps."""
    rows = (dict(zip(table["columns"], row, strict=True)) for row in table["data"])
    return [[row["episode"], row["seed"], row["diverged"], row["steps"]] for row in rows if not row["success"]]
