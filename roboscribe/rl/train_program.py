"""TRAINPROGRAM: ground a program's controllers in the robot's world, one skill after the other (Sec. 4.3.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TypeAlias, assert_never

from roboscribe.dsl.syntax import Program, Run, Solved
from roboscribe.errors import ArtifactError
from roboscribe.rl.best_warm_start import TrainingStarts, best_warm_start
from roboscribe.rl.checkpoint import read_checkpoint, write_checkpoint
from roboscribe.rl.config import PpoConfig, SacConfig, TrainConfig
from roboscribe.rl.learner import Learned, LearnerTask, Log
from roboscribe.rl.program_training import ProgramTraining
from roboscribe.rl.screening import mostly_fails, screen
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import SkillEvaluator, evaluate_skill
from roboscribe.rl.skill_job import SkillJob, SkillReport
from roboscribe.rl.whole_program import WholeProgram
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

ProgramLog: TypeAlias = Callable[[str, Mapping[str, float], int], None]
"""Receives a controller's name, metrics by name, and the control steps spent on it so far."""


IMPROVED = ("clone", "ppo", "sac")
"""What gives a controller other weights than it had."""


def no_log(controller: str, metrics: Mapping[str, float], step: int) -> None:
    """Log nothing."""


@dataclass(frozen=True)
class TrainingResult:
    """A program's grounded controllers, old and new, and how the new ones were learned."""

    library: Mapping[str, Skill]
    reports: tuple[SkillReport, ...]

    @property
    def control_steps(self) -> int:
        """All control steps spent."""
        return sum(report.control_steps for report in self.reports)


@dataclass(frozen=True)
class _RunContext:
    """Where metrics and checkpoints go."""

    log: ProgramLog
    checkpoints: Path | None

    def file(self, name: str) -> Path | None:
        return None if self.checkpoints is None else self.checkpoints / f"{name}.safetensors"


def train_program(
    task: Task,
    program: Program,
    demonstrations: Sequence[Trajectory],
    library: Mapping[str, Skill],
    config: TrainConfig,
    seed: int,
    log: ProgramLog = no_log,
    checkpoints: Path | None = None,
    solve: bool = True,
    trained_before: int = 0,
) -> TrainingResult:
    """Learn every controller that the library lacks, in textual order.

    Per skill: start states from running the program so far, a warm start, and reinforcement learning only where the
    warm start falls short of the target. What is kept never evaluates worse than its warm start.

    Args:
        task: the robot's world.
        program: P.
        demonstrations: their entities named as in the program's rollouts; actions are read in profile `actions` only.
        library: controllers learned before, by name; they stay as they are, but for the last one, see `solve`.
        config: settings.
        seed: decides everything.
        log: receives metrics by controller.
        checkpoints: directory for progress; finished skills found there are not learned again.
        solve: whether the program is to bring ψ_R about; its last skill then acts on after its own φ, and is improved
            for that where it falls short. Otherwise reaching the program's end is all.
        trained_before: how often the same program was trained, and was not good enough: after that what is known is
            improved, however well it does in the episodes that are looked at first.

    Returns:
        The library with a skill for every controller of the program, and one report per skill worked on.

    Source: Algorithm 5 line 5, Sec. 4.3.3.
    Departs: each skill is an ordinary environment started from a pool of the program's own states, instead of a
        replay buffer filled by whole-program runs. ψ_R itself gets a short attempt without cloning: failing is its
        purpose.
    """
    training, context = (
        ProgramTraining(task, program, demonstrations, config, seed, solve, trained_before),
        _RunContext(log, checkpoints),
    )
    skills, reports, whole = dict(library), list[SkillReport](), WholeProgram(training)
    for turn in _turns(training, library):
        found = _take_turn(training, context, turn, skills, reports, whole)
        reports += found
        if turn and turn[0].again and not any(report.learner in IMPROVED for report in found):
            break  # the starts of a further round would be those of this one
    return TrainingResult(skills, tuple(reports))


def _take_turn(
    training: ProgramTraining,
    context: _RunContext,
    turn: Sequence[SkillJob],
    skills: dict[str, Skill],
    before: Sequence[SkillReport],
    whole: WholeProgram,
) -> list[SkillReport]:
    """Learn what a turn is to learn, where it is worthwhile, and put it among the `skills`."""
    verdict = screen(training, turn, skills, before)
    reports = [] if verdict.report is None else [verdict.report]
    steps = verdict.control_steps
    for job in turn if verdict.worthwhile else ():
        name = job.run.controller
        spent = 0 if job.again else sum(each.control_steps for each in before if each.controller == name)
        skill, report = _learn(training, context, job, skills, spent + steps + whole.most(skills))
        if report.learner in IMPROVED and whole.suffers(skills, {**skills, name: skill}):
            report = replace(report, learner="undone", success=report.known_success, unfinished=False)
        else:
            skills[name] = skill
        reports.append(replace(report, control_steps=report.control_steps + steps + whole.take_steps()))
        steps = 0
    return reports


def _turns(training: ProgramTraining, library: Mapping[str, Skill]) -> Iterator[tuple[SkillJob, ...]]:
    """List what is learned in which order: controllers that the library lacks, in textual order, then known ones.

    A loop's controllers take two turns: warm starts of all of them first, because only together do they show the
    states of later iterations; then each is measured and reinforced on those. Known ones are improved in rounds.
    """
    for group in training.groups:
        runs = [run for run in group.runs if run.controller not in library]
        yield tuple(SkillJob(run, training.title(run), reinforce=not group.loop) for run in runs)
        yield tuple(SkillJob(run, f"{run.controller}.loop", together=True) for run in runs if group.loop)
    for again in range(1, _rounds(training) + 1):
        yield tuple(_known(training, library, again))


def _rounds(training: ProgramTraining) -> int:
    """Return how many turns known controllers have to be improved; SAC begins anew in each, and has one."""
    return 1 if isinstance(training.config.learner, SacConfig) else training.config.rounds


def _known(training: ProgramTraining, library: Mapping[str, Skill], again: int) -> list[SkillJob]:
    """List the controllers of the library that are to be improved, in textual order.

    A program that is to bring ψ_R about may improve all it knows; where it solves the task too rarely a subgoal is
    missing, and they are not to blame. One for a subgoal improves them where all are known: it was tried before, and
    nothing explains why it fails.
    """
    runs = {run.controller: run for run in training.runs}
    title = "improved" if again == 1 else f"improved.{again}"
    known = [SkillJob(run, f"{name}.{title}", again=again) for name, run in runs.items() if name in library]
    return known if training.solve or len(known) == len(runs) else []


def _learn(
    training: ProgramTraining, context: _RunContext, job: SkillJob, skills: Mapping[str, Skill], before: int
) -> tuple[Skill, SkillReport]:
    """Learn one skill, for which `before` control steps were spent already, or read it from its checkpoint."""
    finished = context.file(job.title)
    identity = {"controller": job.title, "until": str(job.run.until), "seed": training.seed}
    if finished is not None and finished.exists():
        return _read(finished, identity, job.run.controller, training.task)
    skill, report = _train(training, context, job, skills, training.config.budget - before)
    if finished is not None:
        _write(finished, identity, skill, report)
    return skill, report


def _train(
    training: ProgramTraining, context: _RunContext, job: SkillJob, skills: Mapping[str, Skill], most: int
) -> tuple[Skill, SkillReport]:
    """Measure a warm start, and improve it by reinforcement learning where needed, in `most` control steps."""
    run = job.run
    held_out, spent = training.held_out(run, skills, most, again=job.again)
    if not len(held_out):
        untrained = skills.get(run.controller) or training.fresh_skills(run, held_out)[0]
        return untrained, SkillReport(run.controller, "initial", 0, 0.0, 0.0, spent)
    config = training.config
    world = training.task.world(config.pool.batch)
    evaluator = SkillEvaluator(training.subtask(run), held_out, world, config.pool.screening, most - spent)
    starts = TrainingStarts(lambda: training.starts(run, skills, most, evaluator.rest, again=job.again))
    known, (warm, rate, learner) = best_warm_start(training, run, skills, starts, evaluator, again=job.again)
    steps = spent + evaluator.world.control_steps
    report = SkillReport(run.controller, learner, len(held_out), rate, rate, steps, known_success=known)
    context.log(run.controller, {"warm_success": rate}, report.control_steps + starts.control_steps)
    budget = config.learning_steps // _rounds(training) if job.again else _budget(training, run, rate, len(held_out))
    spared = job.again and training.may_be_enough(run, rate, len(held_out))
    if rate < training.enough(run) and not spared and job.reinforce and budget:
        warm, report = _improve(training, context, job, warm, report, starts, evaluator, budget)
    return warm, replace(report, control_steps=report.control_steps + starts.control_steps)


def _improve(
    training: ProgramTraining,
    context: _RunContext,
    job: SkillJob,
    warm: Skill,
    report: SkillReport,
    starts: TrainingStarts,
    evaluator: SkillEvaluator,
    budget: int,
) -> tuple[Skill, SkillReport]:
    """Improve a warm start by reinforcement learning; what is returned is never worse.

    Reports leave out what it took to find the starts.
    """
    settings, rate, spent, pool = training.config.pool, report.success, report.control_steps, starts.pool
    if not len(pool):
        return warm, report
    evaluator = starts.counted(evaluator)
    if rate > settings.stress_above and evaluator.rest > len(pool) * evaluator.subtask.limit:
        tried = evaluate_skill(evaluator.subtask, pool, warm, evaluator.world)
        # A skill does not see others that it knocks off their places: to repeat that teaches nothing.
        pool = pool.oversample_hard(~tried.success & ~tried.harmful, settings.repeats)
        spent += tried.control_steps

    def log(metrics: Mapping[str, float], step: int) -> None:
        context.log(job.run.controller, metrics, spent + starts.control_steps + step)

    enough = training.enough(job.run)
    task = LearnerTask(evaluator.subtask, pool, evaluator, enough, budget, evaluator.rest)
    learned, by = _reinforce(training, warm, rate, task, log, context.file(f"{job.title}.progress"))
    report = replace(report, control_steps=spent + learned.control_steps)
    if learned.success <= rate:
        return warm, report
    return learned.skill, replace(report, learner=by, success=learned.success, unfinished=learned.unfinished)


def _budget(training: ProgramTraining, run: Run, rate: float, starts: int) -> int:
    """Return the control steps that reinforcement may cost, after a warm start of success `rate` on so many starts.

    None for ψ_R where no start succeeds, for then nothing is ever rewarded. Few where a subgoal may still be found
    before `run`; none where it is likely, since what was done in demonstrations mostly fails here. Where none is found
    then, all is trained once more.
    """
    config = training.config
    if isinstance(run.until, Solved):
        return min(config.opaque_budget, config.budget) if rate else 0
    if training.solve or isinstance(config.learner, SacConfig):
        return config.learning_steps
    first = run is training.runs[0]
    if mostly_fails(config, rate, starts) and (first or config.profile == "actions"):
        return 0
    return min(config.first_budget, config.learning_steps) if first else config.learning_steps


def _reinforce(
    training: ProgramTraining, warm: Skill, rate: float, task: LearnerTask, log: Log, progress: Path | None
) -> tuple[Learned, str]:
    """Learn by reinforcement, from the warm start by PPO or from scratch by SAC; returns what by, too."""
    config, seed = training.config, training.seed_of(training.this_time(f"{warm.name} learner"))
    match config.blind if task.subtask.opaque else config.learner:
        case PpoConfig() as settings:
            from roboscribe.rl.ppo import train_ppo  # each learner's library takes seconds to load

            return train_ppo(warm, rate, task, settings, seed, log, progress), "ppo"
        case SacConfig() as settings:
            from roboscribe.rl.sac import train_sac

            return train_sac(warm, task, settings, seed, log), "sac"
        case other:
            assert_never(other)


def _write(path: Path, identity: Mapping[str, object], skill: Skill, report: SkillReport) -> None:
    description, arrays = skill.to_parts()
    write_checkpoint(path, arrays, {**identity, "skill": description, "report": asdict(report)})


def _read(path: Path, identity: Mapping[str, object], name: str, task: Task) -> tuple[Skill, SkillReport]:
    arrays, notes = read_checkpoint(path, identity)
    description, report = notes["skill"], notes["report"]
    if not isinstance(description, Mapping) or not isinstance(report, Mapping):
        msg = f"checkpoint {path} holds no skill; delete it to train from the start"
        raise ArtifactError(msg)
    skill = Skill.from_parts(name, description, arrays, task.layout)
    return skill, SkillReport(**report)
