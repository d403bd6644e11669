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
from roboscribe.stages.runtime.events import Abandoned, Evaluated, EventCallback, Failed, Filmed, Ingested, Packaged
from roboscribe.stages.runtime.files import EPISODES, OUTCOME, read_fail, read_json
from roboscribe.stages.runtime.plan_file import assignments
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import DEMONSTRATIONS, TaskConfig
from roboscribe.stages.steps import ControllerFiles, RunStage, StagedSteps, StoreValue
from roboscribe.steps import Outcome

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
    asked, plan = plan, replace(plan, task=replace(plan.task, horizon=int(report["horizon"])))
    found = _learned(plan, shown, call, put, tell)
    if not isinstance(found, Fail) and found.misled(plan):
        tell(Abandoned(found.astray))
        again = _learned(replace(plan, light=False), shown, call, put, tell)
        if not isinstance(again, Fail) and again.outcome.rate > found.outcome.rate:
            found, asked = again, replace(asked, light=False)
    if isinstance(found, Fail):
        tell(Failed(found.reason))
        return found
    solution, running, evaluated, figures = found.solution, found.running, found.evaluated, found.figures
    tell(Evaluated(figures, evaluated / EPISODES))
    made_by = command(asked, profile)
    made = package.Config(plan.task, profile, plan.seed, plan.training.confirm, report["digest"], made_by)
    inputs = {**running, "tree": found.tree, "outcome": evaluated / OUTCOME}
    directory = call("package program", package.STAGE, made, inputs) / package.DIRECTORY
    tell(Packaged(solution.program, solution.tree, directory))
    if plan.video:
        scene = film.Config(plan.task, plan.seed, plan.training.confirm)
        filmed = call("film program", film.STAGE, scene, running)
        tell(Filmed(next(filmed.glob("rollout.*"))))
    return SynthesisResult(solution, profile, figures, directory, int(report["horizon"]))


@dataclass(frozen=True)
class _Learned:
    """A solution, where its program, controllers and tree lie, and its final evaluation."""

    solution: Solution[ControllerFiles]
    running: dict[str, Path]
    tree: Path
    evaluated: Path
    figures: dict[str, Any]

    @property
    def outcome(self) -> Outcome:
        """What the final evaluation showed."""
        return Outcome(int(self.figures["successes"]), int(self.figures["episodes"]))

    def misled(self, plan: SynthesisPlan) -> bool:
        """Tell whether the lighter simulator that it was learned in, where there is one, let it succeed too easily."""
        lighter = plan.light and plan.practice.make() != plan.task.make()
        return lighter and plan.limits.misled(self.solution.outcome, self.outcome)

    @property
    def astray(self) -> str:
        """Say why it is learned again."""
        learned, evaluated = self.solution.outcome.rate, self.outcome.rate
        return (
            f"{learned:.0%} of the episodes succeed in the lighter simulator, and {evaluated:.0%} in the task's own: "
            "it is learned in that"
        )


def _learned(plan: SynthesisPlan, shown: Path, call: RunStage, put: StoreValue, tell: EventCallback) -> _Learned | Fail:
    """Run Algorithm 1 and evaluate what it finds."""
    staged = StagedSteps(plan, shown, call, put, tell)
    solution = roboscribe(staged.steps(), ControllerFiles(), plan.limits)
    if isinstance(solution, Fail):
        return solution
    running = {"program": staged.program(solution.program), **solution.skills.runnable()}
    config = evaluate.Config(plan.task, plan.seed, plan.evaluation_episodes, plan.training.confirm)
    evaluated = call("evaluate program", evaluate.STAGE, config, running)
    return _Learned(solution, running, staged.tree(solution.tree), evaluated, read_json(evaluated / OUTCOME))


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
