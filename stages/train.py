"""TRAINPROGRAM: ground every controller of a program that the library lacks."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from roboscribe.grounding import ground
from roboscribe.io.atomic import Json
from roboscribe.program_gen import OPAQUE
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.program_training import step_limits
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.controller_files import read_library, write_library
from roboscribe.stages.runtime.files import read_program, write_json
from roboscribe.stages.runtime.journal import Journal
from roboscribe.stages.runtime.progress import Progress, ProgressCallback, ignore_progress
from roboscribe.stages.runtime.serialization import read_tree
from roboscribe.stages.runtime.store import METRICS, PROGRESS, Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig, load_evidence
from roboscribe.subtask_tree import ROOT

LIMITS, REPORTS = "limits.json", "reports.json"


@dataclass(frozen=True)
class Config:
    """How to train.

    Args:
        task: where.
        goal: node that the program is to reach.
        seed: decides everything.
        training: settings of the learners.
        afresh: controllers of the library that are to be trained again.
        solve: whether the program is to bring ψ_R about, not only to reach its end.
        trained_before: how often the same program was trained before, and was not good enough.
    """

    task: TaskConfig
    goal: str = ROOT
    seed: int = 0
    training: TrainConfig = field(default_factory=TrainConfig)
    afresh: tuple[str, ...] = ()
    solve: bool = True
    trained_before: int = 0


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
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
    (out / PROGRESS).mkdir(exist_ok=True)
    grown, reports = ground(
        task,
        program,
        read_tree(inputs["tree"]),
        shown,
        known,
        config.training,
        config.seed,
        solve=config.solve,
        log=_Log(out / METRICS, config.training, report),
        checkpoints=out / PROGRESS,
        trained_before=config.trained_before,
    )
    write_library(out, grown)
    write_json(out / LIMITS, dict(step_limits(program, shown, task, config.training.confirm)))
    write_json(out / REPORTS, [asdict(each) for each in reports])


class _Log:
    """Appends figures to the stage's journal and reports them as progress."""

    def __init__(self, path: Path, training: TrainConfig, report: ProgressCallback) -> None:
        self._journal = Journal(path, ("controller", "step", "names"))
        self._training = training
        self._report = report

    def __call__(self, controller: str, metrics: Mapping[str, float], step: int) -> None:
        figures: dict[str, Json] = {name: float(value) for name, value in sorted(metrics.items())}
        names: list[Json] = list(figures)
        told = self._journal.append({"controller": controller, "step": step, "names": names, "metrics": figures})
        time, first = told["time"], told["metrics"]
        assert isinstance(time, int)
        assert isinstance(first, Mapping)
        budget = self._training.opaque_budget if controller == OPAQUE else self._training.budget
        known = {name: float(str(value)) for name, value in first.items()}
        self._report(Progress(controller, step, budget, "steps", known, time))


STAGE = Stage("train", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
