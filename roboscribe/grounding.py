"""Giving programs their controllers: what both the library and the stages do for TRAINPROGRAM."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from roboscribe.controllers import Library, scripted
from roboscribe.dsl.rewrite import controllers, walk
from roboscribe.dsl.syntax import Program, Run, While
from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import Json
from roboscribe.program_gen import OPAQUE
from roboscribe.rl.config import Profile, TrainConfig
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_job import SkillReport
from roboscribe.rl.train_program import ProgramLog, no_log, train_program
from roboscribe.subtask_tree import Tree
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

CHECKED = 20
"""Episodes after which a program that has become worse shows it: half of the successes lost are seen in 20."""


def ground(
    task: Task,
    program: Program,
    tree: Tree,
    demonstrations: Sequence[Trajectory],
    known: Library,
    training: TrainConfig,
    seed: int,
    *,
    solve: bool,
    log: ProgramLog = no_log,
    checkpoints: Path | None = None,
    trained_before: int = 0,
) -> tuple[Library, tuple[SkillReport, ...]]:
    """Give every statement of a program a controller: a learned one, or in profile `scripted` the task's own.

    Args:
        task: the robot's world.
        program: what is to be grounded.
        tree: what it was generated from.
        demonstrations: canonically named.
        known: controllers that are there already.
        training: settings, profile included.
        seed: decides everything random.
        solve: whether the program is to bring ψ_R about, not only to reach its end.
        log: receives figures along the way.
        checkpoints: directory for progress; None keeps none.
        trained_before: how often the same program was trained before, and was not good enough.

    Raises:
        TaskError: profile `scripted`, and the task brings no controllers.
    """
    if training.profile == "scripted":
        new = scripted(task, program, tree, known, seed)
        return {**known, **new}, tuple(SkillReport(name, "scripted", 0, 0.0, 0.0, 0) for name in new)
    skills = {name: each for name, each in known.items() if isinstance(each, Skill)}
    result = train_program(
        task, program, demonstrations, skills, training, seed, log, checkpoints, solve, trained_before
    )
    return result.library, result.reports


def grounds(tree: Tree, program: Program) -> dict[str, Json]:
    """Describe by controller what it follows on: its node's predecessors, and whether a loop repeats it."""
    return {run.controller: _ground(tree, program, run) for run in controllers(program)}


def _ground(tree: Tree, program: Program, run: Run) -> Json:
    before: list[Json] = [node.name for node in tree.predecessors(run.controller)] if run.controller != OPAQUE else []
    return [before, any(run in controllers(part) for part in walk(program) if isinstance(part, While))]


def stale(now: Mapping[str, Json], before: Mapping[str, Json]) -> tuple[str, ...]:
    """List the controllers that have to be trained afresh, for now they take over in other states.

    Args:
        now: what each follows on.
        before: what it followed on when it was trained.
    """
    return tuple(name for name, ground in now.items() if name in before and before[name] != ground)


@dataclass(frozen=True)
class LastTraining:
    """For what controllers were trained last.

    Args:
        goal: of their program.
        program: as text.
        trained_before: how often it was trained before.
        unfinished: whether steps ran out while one of them was still getting better.
    """

    goal: str = ""
    program: str = ""
    trained_before: int = 0
    unfinished: bool = False

    def next(self, goal: str, program: Program) -> LastTraining:
        """Say which training comes next: the same program once more, or another one for the first time."""
        asked = (goal, str(program))
        return LastTraining(*asked, self.trained_before + 1 if asked == (self.goal, self.program) else 0)


def settled_profile(asked: Profile | None, actions: bool, where: str | Path) -> Profile:
    """Settle what to learn from.

    Args:
        asked: None is all there is.
        actions: whether all demonstrations have actions.
        where: names the demonstrations in messages.

    Raises:
        DemonstrationError: profile `actions` is asked for and the demonstrations have none.
    """
    if asked == "actions" and not actions:
        msg = f"{where}: found no actions, expected them for profile actions; use profile states"
        raise DemonstrationError(msg)
    return asked or ("actions" if actions else "states")
