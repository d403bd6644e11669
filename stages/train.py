"""TRAINPROGRAM: ground every controller of a program that the library lacks."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program, Run
from roboscribe.envs.point_world import Lookahead, PointTask
from roboscribe.errors import TaskError
from roboscribe.io.atomic import Json
from roboscribe.program_gen import OPAQUE
from roboscribe.reward import atom_term, atoms
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.train_program import SkillReport, step_limits, train_program
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.world.task import Task
from stages import alone
from stages.files import read_program, write_json
from stages.journal import Journal
from stages.progress import Progress, Report, silent
from stages.skills import Library, read_library, write_library
from stages.store import METRICS, PROGRESS, Inputs, Stage
from stages.values import read_tree
from stages.world import TaskConfig, load_evidence

LIMITS, REPORTS = "limits.json", "reports.json"


@dataclass(frozen=True)
class Config:
    """How to train.

    Args:
        task: where.
        goal: node that the program is to reach.
        seed: decides everything.
        settings: of the learners.
        scripted: take lookahead controllers instead of learned ones; point tasks only.
        afresh: controllers of the library that are to be trained again.
        solve: whether the program is to bring ψ_R about, not only to reach its end.
    """

    task: TaskConfig
    goal: str = ROOT
    seed: int = 0
    settings: TrainConfig = field(default_factory=TrainConfig)
    scripted: bool = False
    afresh: tuple[str, ...] = ()
    solve: bool = True


def run(config: Config, inputs: Inputs, out: Path, report: Report = silent) -> None:
    """Write the library, each controller's step limit, and how each new skill was learned.

    An interrupted run goes on from the checkpoints in `progress/`. Figures along the way go to `metrics.jsonl`.

    Inputs:
        demonstrations: a Parquet file.
        program, tree: what is to be grounded.
        controllers, weights: the library so far; left out where there is none.
    """
    task = config.task.make()
    program = read_program(inputs["program"])
    shown = load_evidence(inputs["demonstrations"], config.task).trajectories
    library = read_library(inputs["controllers"], inputs["weights"], task) if "controllers" in inputs else {}
    known = {name: skill for name, skill in library.items() if name not in config.afresh}
    if config.scripted:
        grown, reports = _script(task, program, read_tree(inputs["tree"]), known, config.seed)
    else:
        (out / PROGRESS).mkdir(exist_ok=True)
        log = _Log(out / METRICS, config.settings, report)
        skills = {name: skill for name, skill in known.items() if not isinstance(skill, Lookahead)}
        result = train_program(
            task,
            program,
            shown,
            skills,
            config.settings,
            config.seed,
            log=log,
            checkpoints=out / PROGRESS,
            solve=config.goal == ROOT,
        )
        grown, reports = result.library, result.reports
    write_library(out, grown)
    write_json(out / LIMITS, dict(step_limits(program, shown, task)))
    write_json(out / REPORTS, [asdict(each) for each in reports])


class _Log:
    """Writes figures to the stage's journal, and tells them to whoever watches."""

    def __init__(self, path: Path, settings: TrainConfig, report: Report) -> None:
        self._journal = Journal(path, ("controller", "step", "names"))
        self._settings = settings
        self._report = report

    def __call__(self, controller: str, metrics: Mapping[str, float], step: int) -> None:
        figures: dict[str, Json] = {name: float(value) for name, value in sorted(metrics.items())}
        names: list[Json] = list(figures)
        told = self._journal.append({"controller": controller, "step": step, "names": names, "metrics": figures})
        time, first = told["time"], told["metrics"]
        assert isinstance(time, int)
        assert isinstance(first, Mapping)
        budget = self._settings.opaque_budget if controller == OPAQUE else self._settings.budget
        known = {name: float(str(value)) for name, value in first.items()}
        self._report(Progress(controller, step, budget, "steps", known, time))


def _script(
    task: Task, program: Program, tree: Tree, known: Library, seed: int
) -> tuple[Library, tuple[SkillReport, ...]]:
    """Give every new controller a lookahead in the kinematic model."""
    if not isinstance(task, PointTask):
        msg = f"profile scripted needs a point task, found {task.name}"
        raise TaskError(msg)
    new = {run.controller: run for run in controllers(program) if run.controller not in known}
    skills = {name: Lookahead(task, run, _scales(run, tree), seed) for name, run in new.items()}
    reports = tuple(SkillReport(name, "scripted", 0, 0.0, 0.0, 0) for name in new)
    return {**known, **skills}, reports


def _scales(run: Run, tree: Tree) -> dict[str, float]:
    """Rename the spreads learned with a node, which speak of named entities, to the program's variables."""
    node = next((node for node in tree.nodes if node.name == run.controller), None)
    if node is None:
        return {}
    pairs = zip(atoms(run.until), atoms(node.predicate), strict=True)
    return {str(atom_term(mine)): node.scales.get(str(atom_term(theirs)), 1.0) for mine, theirs in pairs}


STAGE = Stage("train", Config, run)

if __name__ == "__main__":
    sys.exit(alone.main(STAGE))
