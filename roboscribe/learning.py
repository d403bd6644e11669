"""From a task and demonstrations to a program that runs: all of the method in memory, without files or tracking."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from roboscribe.abstraction_refinement import roboscribe
from roboscribe.controllers import Library
from roboscribe.defaults import EVALUATION_EPISODES, ROLLOUT_EPISODES
from roboscribe.dsl.fields import check_layout
from roboscribe.dsl.printer import text
from roboscribe.dsl.syntax import Program
from roboscribe.errors import Fail, expected
from roboscribe.evaluation import Evaluation, measure, try_program
from roboscribe.evidence import Evidence
from roboscribe.grounding import CHECKED, LastTraining, ground, grounds, settled_profile, stale
from roboscribe.io.atomic import Json
from roboscribe.io.demonstrations import Demonstrations
from roboscribe.io.validation import screen
from roboscribe.loosening import looser
from roboscribe.policy import Policy, task_named
from roboscribe.programs import program_name, saved_form
from roboscribe.rl.config import Profile, TrainConfig
from roboscribe.rl.program_training import step_limits
from roboscribe.runnable import Runnable
from roboscribe.steps import (
    Abandoned,
    Decision,
    Limits,
    Loosened,
    Outcome,
    Refined,
    Removed,
    Retrained,
    Solution,
    Steps,
    pure_steps,
)
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.synthesis import Synthesis
from roboscribe.world.episode_length import episode_length
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory


def synthesize(
    task: Task | str,
    demonstrations: Demonstrations | Sequence[Trajectory],
    *,
    seed: int = 0,
    profile: Profile | None = None,
    rollout_episodes: int = ROLLOUT_EPISODES,
    evaluation_episodes: int = EVALUATION_EPISODES,
    limits: Limits | None = None,
    training: TrainConfig | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> Synthesis | Fail:
    """Find a program that solves a task, from demonstrations.

    Nothing is written and nothing is tracked: `Synthesis.save` keeps the result, and `roboscribe synthesize` is the
    command that resumes and tracks. Both find the same program.

    Args:
        task: a task, or the name of one.
        demonstrations: of it.
        seed: decides everything random.
        profile: what may be learned from; None is `actions` where all demonstrations have them, else `states`.
        rollout_episodes: episodes in which each program of Algorithm 2 is tried.
        evaluation_episodes: episodes of the final evaluation.
        limits: accuracy asked and effort allowed.
        training: settings of the learners, but for the profile.
        tell: told in one line what happens; `print` shows it.

    Returns:
        The program with its controllers and how it was found; Fail with the reason where there is none.

    Raises:
        DemonstrationError: demonstrations that cannot be learned from.
        TaskError: an unknown task, or one that declares names which programs cannot speak of.
    """
    expected("rollout_episodes", rollout_episodes, 1)
    expected("evaluation_episodes", evaluation_episodes, 1)
    where = task_named(task)
    check_layout(where.layout)
    digest = demonstrations.digest if isinstance(demonstrations, Demonstrations) else ""
    shown = demonstrations.trajectories if isinstance(demonstrations, Demonstrations) else tuple(demonstrations)
    screened = screen(where, shown)
    if isinstance(screened, Fail):
        return screened
    horizon, slow = episode_length(where, screened.kept)
    for line in (*screened.report, *([slow] if slow else ())):
        tell(line)
    where = where.lasting(horizon)
    chosen = settled_profile(profile, all(each.actions is not None for each in screened.kept), "demonstrations")
    settings = (training or TrainConfig()).for_profile(chosen)
    evidence = Evidence.of(screened.kept, where.solved)
    asked = limits or Limits()
    name = task if isinstance(task, str) else task.name

    def learned(practice: Task) -> tuple[Solution[TrainedControllers], Runnable, Evaluation] | Fail:
        learning = Learning(practice, evidence, seed, settings, rollout_episodes, asked, tell)
        solution = roboscribe(learning.steps(program_name(name)), TrainedControllers(), asked)
        if isinstance(solution, Fail):
            return solution
        program = Runnable(solution.program, solution.skills.library, solution.skills.limits, settings.confirm)
        measured = measure(program, where, seed, evaluation_episodes)
        tell(str(measured))
        return solution, program, measured

    result = learned(where.light)
    if not isinstance(result, Fail) and where.light != where and asked.misled(result[0].outcome, result[2].outcome):
        tell("it succeeds in the lighter simulator, and not in the task's own: it is learned in that")
        again = learned(where)
        if not isinstance(again, Fail) and again[2].success > result[2].success:
            result = again
    if isinstance(result, Fail):
        return result
    found, runnable, evaluation = result
    manifest: dict[str, Json] = {
        "task": name,
        "horizon": horizon,
        "profile": chosen,
        "seed": seed,
        "confirm": settings.confirm,
        "limits": dict(found.skills.limits),
        "demonstrations": digest,
        "figures": evaluation.figures,
    }
    saved = saved_form(found.program, found.tree, found.skills.library, manifest)
    return Synthesis(Policy(runnable, where), found.tree, found.refinements, evaluation, saved)


@dataclass(frozen=True)
class TrainedControllers:
    """Controllers as they pass through Algorithm 2.

    Args:
        library: by name.
        limits: step limits of the program that was trained last.
        grounds: by controller, what its node followed on when it was trained, see `grounds`.
        last: for what they were trained last.
    """

    library: Library = field(default_factory=dict)
    limits: Mapping[str, int] = field(default_factory=dict)
    grounds: Mapping[str, Json] = field(default_factory=dict)
    last: LastTraining = field(default_factory=LastTraining)


@dataclass(frozen=True)
class Learning:
    """The pieces of Algorithm 2 that touch the robot's world.

    Args:
        task: the world, a lighter one where the task has it.
        evidence: the demonstrations.
        seed: decides everything random.
        training: settings of the learners.
        rollout_episodes: in which each program is tried, see `try_program`.
        wanted: accuracy asked.
        tell: told in one line what happens.
    """

    task: Task
    evidence: Evidence
    seed: int
    training: TrainConfig
    rollout_episodes: int
    wanted: Limits
    tell: Callable[[str], None]

    def steps(self, name: str) -> Steps[TrainedControllers]:
        """Return all pieces of Algorithm 2 for a program of some name."""
        pure = pure_steps(self.evidence, self.train, self.roll_out, name)
        return replace(
            pure,
            check=self.check,
            looser=lambda outcome, tree: looser(outcome, tree, self.evidence.layout),
            unfinished=lambda trained: trained.last.unfinished,
            tell=lambda decision: self.tell(decision_line(decision)),
        )

    def train(self, program: Program, goal: str, tree: Tree, trained: TrainedControllers) -> TrainedControllers:
        """TRAINPROGRAM."""
        now = grounds(tree, program)
        known = {name: each for name, each in trained.library.items() if name not in stale(now, trained.grounds)}
        shown, solve, asked = self.evidence.trajectories, goal == ROOT, trained.last.next(goal, program)
        library, reports = ground(
            self.task,
            program,
            tree,
            shown,
            known,
            self.training,
            self.seed,
            solve=solve,
            trained_before=asked.trained_before,
        )
        for report in reports:
            self.tell(f"π_{report.controller}: {report.learner}, {report.success:.0%}, {report.control_steps} steps")
        limits = step_limits(program, shown, self.task, self.training.confirm)
        last = replace(asked, unfinished=any(report.unfinished for report in reports))
        return TrainedControllers(library, limits, {**trained.grounds, **now}, last)

    def roll_out(self, program: Program, goal: str, trained: TrainedControllers) -> Outcome:
        """Exec(M, P)."""
        limits = self.wanted if goal == ROOT else None
        outcome = self._outcome(program, goal, trained, self.rollout_episodes, limits)
        self.tell(f"{goal} is reached in {outcome.successes} of {outcome.episodes} episodes")
        return outcome

    def check(self, program: Program, goal: str, trained: TrainedControllers) -> Outcome:
        """Exec(M, P) for a few episodes."""
        return self._outcome(program, goal, trained, min(CHECKED, self.rollout_episodes))

    def _outcome(
        self, program: Program, goal: str, trained: TrainedControllers, episodes: int, limits: Limits | None = None
    ) -> Outcome:
        runnable = Runnable(program, trained.library, trained.limits, self.training.confirm)
        return Outcome.total(map(Outcome.of, try_program(runnable, self.task, self.seed, goal, episodes, limits)))


def decision_line(decision: Decision) -> str:
    """Say in one line what Algorithm 1 decided."""
    match decision:
        case Refined(refinement, _, count, shown):
            node = refinement.node
            return f"{node.name} ≡ {text(node.predicate)}, before {refinement.psi}: explains {count} of {shown}"
        case Abandoned(reason):
            return f"another line is taken up, for {reason}"
        case Retrained(success):
            return f"a promising program, {success:.0%}, is trained on"
        case Loosened(name, predicate, success, helps):
            verdict = "better" if helps else "no better"
            return f"{name} asked for less, {text(predicate)}: {success:.0%} of the episodes succeed, {verdict}"
        case Removed(node_name, success):
            return f"{node_name} is taken out again: without it {success:.0%} of the episodes succeed"
