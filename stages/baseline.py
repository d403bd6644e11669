"""Train a baseline: a policy that sees the whole state and knows no subgoals."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from roboscribe.baselines.cloning import clone_actions, clone_chunks
from roboscribe.baselines.config import RECIPES, BaselineConfig, Method, usual_steps
from roboscribe.baselines.course import Course
from roboscribe.baselines.off_policy import learn_off_policy
from roboscribe.baselines.policy import Policy, as_program, name_of, to_parts
from roboscribe.controllers import plain
from roboscribe.defaults import ROLLOUT_EPISODES
from roboscribe.evaluation import episode_seeds, waves
from roboscribe.io.atomic import Json
from roboscribe.io.saved_program import SavedProgram, save_program
from roboscribe.runnable import Runnable
from roboscribe.saved import BASELINE, KIND
from roboscribe.stages.package import DIRECTORY
from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.files import OUTCOME, program_bytes, write_json
from roboscribe.stages.runtime.journal import Journal, read_records
from roboscribe.stages.runtime.progress import Progress, ProgressCallback, ignore_progress
from roboscribe.stages.runtime.store import METRICS, PROGRESS, Inputs, Stage
from roboscribe.stages.runtime.task_config import TaskConfig, load_demonstrations
from roboscribe.world import Task, Trajectory

CHECKPOINT = "checkpoint.safetensors"


@dataclass(frozen=True)
class Config:
    """Which baseline.

    Args:
        task: where.
        method: how it learns.
        seed: decides everything.
        steps: gradient steps of clones, control steps of the others; None is what is usual.
        rollout_episodes: of each evaluation on the way; their control steps do not count.
        settings: of the methods.
        demonstrations: SHA-256 of the demonstrations, for the manifest.
        command: command line that makes it, for the manifest.
    """

    task: TaskConfig
    method: Method = "bc"
    seed: int = 0
    steps: int | None = None
    rollout_episodes: int = ROLLOUT_EPISODES
    settings: BaselineConfig = field(default_factory=BaselineConfig)
    demonstrations: str = ""
    command: str = ""


@dataclass(frozen=True)
class TrainedPolicy:
    """A policy, and the steps that its training took.

    Args:
        policy: the last weights.
        gradient_steps: of a clone; 0 for others.
        control_steps: of methods with rollouts; 0 for clones.
        hopeless: it was given up early.
    """

    policy: Policy
    gradient_steps: int = 0
    control_steps: int = 0
    hopeless: bool = False


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write the directory `program/`, and `outcome.json` with what it took and the success on the way.

    An interrupted run goes on from the checkpoint in `progress/`. Figures along the way go to `metrics.jsonl`.

    Inputs:
        demonstrations: a Parquet file; left out where the method learns without.
    """
    task = config.task.make()
    given = inputs.get("demonstrations")
    shown = () if given is None else load_demonstrations(given, config.task).trajectories
    (out / PROGRESS).mkdir(exist_ok=True)
    trained = _train(config, task, shown, out, report)
    curve = [
        {"step": record["step"], **figures}
        for _, record in read_records(out / METRICS)
        if isinstance(figures := record["metrics"], Mapping)
    ]
    taken: dict[str, Json] = {
        "gradient_steps": trained.gradient_steps,
        "control_steps": trained.control_steps,
        "hopeless": trained.hopeless,
    }
    write_json(out / OUTCOME, {**taken, "curve": curve})
    _save(config, trained.policy, taken, out / DIRECTORY)


def _train(
    config: Config, task: Task, shown: tuple[Trajectory, ...], out: Path, report: ProgressCallback
) -> TrainedPolicy:
    """Train by the method."""
    method, settings = config.method, config.settings
    steps = usual_steps(method, task.layout, settings) if config.steps is None else config.steps
    log = _Log(out / METRICS, method, steps, report)
    course = Course(steps, config.seed, out / PROGRESS / CHECKPOINT, log)
    match method:
        case "bc":
            return TrainedPolicy(clone_actions(task, shown, settings.network, settings.cloning, course), steps)
        case "chunked-bc":
            return TrainedPolicy(clone_chunks(task, shown, settings.chunks, course), steps)
        case _:
            judge = _PolicyEvaluator(task, method, config.seed, config.rollout_episodes)
            learned = learn_off_policy(task, method, shown, settings, course, judge=judge)
            return TrainedPolicy(learned.policy, 0, learned.control_steps, learned.hopeless)


@dataclass(frozen=True)
class _PolicyEvaluator:
    """Measures a policy on the same episodes each time, which are not those of the final evaluation."""

    task: Task
    method: Method
    seed: int
    episodes: int

    def __call__(self, policy: Policy) -> float:
        program = Runnable(as_program(self.method), {name_of(self.method): policy}, {})
        seeds = episode_seeds(self.seed, "evaluate on the way", self.episodes)
        return sum(int(done.success.sum()) for done in waves(program, self.task, seeds)) / self.episodes


class _Log:
    """Appends figures to the stage's journal and reports them as progress."""

    def __init__(self, path: Path, method: Method, steps: int, report: ProgressCallback) -> None:
        self._journal = Journal(path, ("step",))
        self._name, self._steps, self._report = name_of(method), steps, report

    def __call__(self, metrics: Mapping[str, float], step: int) -> None:
        figures: dict[str, Json] = {name: float(value) for name, value in sorted(metrics.items())}
        told = self._journal.append({"controller": self._name, "step": step, "metrics": figures})
        time = told["time"]
        assert isinstance(time, int)
        self._report(Progress(self._name, step, self._steps, "steps", metrics, time))


def _save(config: Config, policy: Policy, taken: Mapping[str, Json], directory: Path) -> None:
    """Save the policy as a program of one controller."""
    name, recipe = name_of(config.method), RECIPES[config.method]
    description, arrays = to_parts(policy)
    manifest: dict[str, Json] = {
        KIND: BASELINE,
        "task": config.task.name,
        "contact": config.task.contact,
        "timing": config.task.timing,
        "horizon": config.task.make().horizon,
        "method": config.method,
        "profile": recipe.profile,
        "given": asdict(recipe),
        "seed": config.seed,
        **taken,
        "demonstrations": config.demonstrations,
        "command": config.command,
        "figures": {},
    }
    weights = {f"{name}.{part}": array for part, array in arrays.items()}
    text = program_bytes(as_program(config.method)).decode()
    tree: dict[str, Json] = {"nodes": [], "edges": []}
    save_program(directory, SavedProgram(text, tree, weights, {name: plain(description)}, manifest))


STAGE = Stage("baseline", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
