"""What a synthesis does from demonstrations to a saved program, whatever runs its stages."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from roboscribe.abstraction_refinement import Solution, roboscribe
from roboscribe.errors import DemonstrationError, Fail
from roboscribe.grounding import settled_profile
from roboscribe.stages import collect, evaluate, film, ingest, package
from roboscribe.stages.runtime.events import Evaluated, EventCallback, Failed, Filmed, Ingested, Packaged
from roboscribe.stages.runtime.files import EPISODES, OUTCOME, read_fail, read_json
from roboscribe.stages.runtime.plan_file import assignments
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import DEMONSTRATIONS, TaskConfig
from roboscribe.stages.steps import ControllerFiles, RunStage, StagedSteps, StoreValue

SPELLED = (
    "task.name",
    "task.contact",
    "task.timing",
    "task.horizon",
    "seed",
    "profile",
    "evaluation_episodes",
    "training.budget",
    "limits.success",
)
"""Fields of a plan that have options of their own."""


@dataclass(frozen=True)
class SynthesisResult:
    """What a synthesis found.

    Args:
        solution: P*, T* and the refinements.
        profile: how it was learned.
        figures: of the final evaluation.
        directory: the saved program, in the store.
        horizon: control steps of an episode.
    """

    solution: Solution[ControllerFiles]
    profile: str
    figures: dict[str, Any]
    directory: Path
    horizon: int


def run_pipeline(plan: SynthesisPlan, call: RunStage, put: StoreValue, tell: EventCallback) -> SynthesisResult | Fail:
    """Collect or take demonstrations, run Algorithm 1, evaluate and package.

    Args:
        plan: what is asked for.
        call: runs a stage.
        put: stores a small value.
        tell: hears what happens.
    """
    shown, report = usable_demonstrations(plan, call)
    if isinstance(report, Fail):
        tell(Failed(report.reason))
        return report
    profile = settled_profile(plan.profile, report["actions"], plan.demonstrations or DEMONSTRATIONS)
    tell(Ingested(report, profile))
    plan = replace(plan, training=plan.training.for_profile(profile))
    made_by, plan = command(plan, profile), replace(plan, task=replace(plan.task, horizon=int(report["horizon"])))
    staged = StagedSteps(plan, shown, call, put, tell)
    solution = roboscribe(staged.steps(), ControllerFiles(), plan.limits)
    if isinstance(solution, Fail):
        tell(Failed(solution.reason))
        return solution
    running = {"program": staged.program(solution.program), **solution.skills.runnable()}
    config = evaluate.Config(plan.task, plan.seed, plan.evaluation_episodes, plan.training.confirm)
    evaluated = call("evaluate program", evaluate.STAGE, config, running)
    figures = read_json(evaluated / OUTCOME)
    tell(Evaluated(figures, evaluated / EPISODES))
    made = package.Config(plan.task, profile, plan.seed, plan.training.confirm, report["digest"], made_by)
    inputs = {**running, "tree": staged.tree(solution.tree), "outcome": evaluated / OUTCOME}
    directory = call("package program", package.STAGE, made, inputs) / package.DIRECTORY
    tell(Packaged(solution.program, solution.tree, directory))
    if plan.video:
        scene = film.Config(plan.task, plan.seed, plan.training.confirm)
        filmed = call("film program", film.STAGE, scene, running)
        tell(Filmed(next(filmed.glob("rollout.*"))))
    return SynthesisResult(solution, profile, figures, directory, int(report["horizon"]))


def command(plan: SynthesisPlan, profile: str | None) -> str:
    """Spell the command line that makes a plan's program.

    Args:
        plan: what is asked for.
        profile: what is learned from; None leaves the choice to the command.
    """
    task, usual = plan.task, SynthesisPlan(TaskConfig(plan.task.name))
    options = (  # each of `SPELLED`
        ("--profile", profile, None),
        ("--demos", plan.demonstrations, usual.demonstrations),
        ("--episodes", plan.evaluation_episodes, usual.evaluation_episodes),
        ("--budget", plan.training.budget, usual.training.budget),
        ("--success", plan.limits.success, usual.limits.success),
        ("--contact", task.contact, usual.task.contact),
        ("--timing", task.timing, usual.task.timing),
        ("--horizon", task.horizon, usual.task.horizon),
    )
    words = ["roboscribe", "synthesize", task.name, "--seed", str(plan.seed)]
    for option, value, default in options:
        words += [option, str(value)] if value != default else []
    settled = replace(usual, training=usual.training.for_profile(plan.training.profile))
    for assignment in assignments(plan, settled, (*SPELLED, "training.profile")):
        words += ["--set", assignment]
    return shlex.join(words)


def demonstration_file(plan: SynthesisPlan, call: RunStage) -> Path:
    """Return the file of demonstrations, given or collected.

    Raises:
        DemonstrationError: the file that is named is not there.
    """
    given = plan.demonstrations
    if given is None:
        config = collect.Config(plan.task, plan.n_demonstrations, plan.seed)
        return call("collect demonstrations", collect.STAGE, config, {}) / DEMONSTRATIONS
    if not given.is_file():
        msg = f"{given}: no such file, expected demonstrations in Parquet"
        raise DemonstrationError(msg)
    return given


def usable_demonstrations(plan: SynthesisPlan, call: RunStage) -> tuple[Path, dict[str, Any] | Fail]:
    """Return the file of usable demonstrations and what is said about it."""
    given = demonstration_file(plan, call)
    out = call("ingest demonstrations", ingest.STAGE, ingest.Config(plan.task), {"demonstrations": given})
    fail = read_fail(out)
    return out / DEMONSTRATIONS, fail or {**read_json(out / ingest.REPORT), "source": str(given)}
