"""TRAINPROGRAM: ground a program's controllers in the robot's world, one skill after the other (Sec. 4.3.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeAlias
from zlib import crc32

import numpy as np

from roboscribe.dsl.interpreter import Segment, execute, segment
from roboscribe.dsl.rewrite import controllers, run_variables, walk
from roboscribe.dsl.semantics import evaluate
from roboscribe.dsl.syntax import Get, Program, Run, Seq, Solved
from roboscribe.errors import ArtifactError
from roboscribe.reward import atom_term, atoms
from roboscribe.rl.checkpoint import read_checkpoint, write_checkpoint
from roboscribe.rl.clone import Samples, initial_skill
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.inverse_dynamics import ALL_UNITS
from roboscribe.rl.observation import ObservationSpec, observation_spec
from roboscribe.rl.pool import StartPool
from roboscribe.rl.ppo import Learned, LearnerTask, Log, train_ppo
from roboscribe.rl.sac import train_sac
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import evaluate_skill
from roboscribe.rl.starts import Prefix, collect_starts
from roboscribe.rl.subtask import Subtask
from roboscribe.rl.warm_start import Frames, best_of, candidates, frames_of, inferred, joined
from roboscribe.world.protocols import Task, World
from roboscribe.world.trajectory import Trajectory

ProgramLog: TypeAlias = Callable[[str, Mapping[str, float], int], None]
"""Receives a controller's name, metrics by name, and the control steps spent on it so far."""


def quiet(controller: str, metrics: Mapping[str, float], step: int) -> None:
    """Log nothing."""


@dataclass(frozen=True)
class SkillReport:
    """How one skill was learned.

    Args:
        controller: its name.
        learner: what gave the weights that were kept: "kept" from before, "clone", "ppo", "sac" or "initial".
        starts: start states found for training; 0 where the program never got there.
        warm_success: success on held-out starts before reinforcement learning.
        success: success of what was kept.
        control_steps: all control steps spent on it: starts, evaluations and learning.
    """

    controller: str
    learner: str
    starts: int
    warm_success: float
    success: float
    control_steps: int


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
class _Setting:
    """What every skill of one TRAINPROGRAM call shares."""

    task: Task
    program: Program
    demonstrations: Sequence[Trajectory]
    segments: Sequence[tuple[Segment, ...]]
    config: TrainConfig
    seed: int
    log: ProgramLog
    checkpoints: Path | None
    solve: bool

    def ends_with(self, run: Run) -> bool:
        """Tell whether `run` is the last statement of a program that is to bring ψ_R about, not only its own φ."""
        body = self.program.body
        last = body.parts[-1] if isinstance(body, Seq) and body.parts else body
        return self.solve and last is run and not isinstance(run.until, Solved)

    def draw(self, name: str) -> np.random.Generator:
        """Return a generator of its own for one purpose, so that a resumed run draws the same numbers."""
        return np.random.default_rng([self.seed, crc32(name.encode())])

    def seed_of(self, name: str) -> int:
        """Return a seed of its own for one purpose."""
        return int(self.draw(name).integers(2**31))


def train_program(
    task: Task,
    program: Program,
    demonstrations: Sequence[Trajectory],
    library: Mapping[str, Skill],
    config: TrainConfig,
    seed: int,
    log: ProgramLog = quiet,
    checkpoints: Path | None = None,
    solve: bool = True,
) -> TrainingResult:
    """Learn every controller that the library lacks, in textual order.

    Per skill: start states from running the program so far, a warm start, and reinforcement learning only where the
    warm start falls short of the target. What is kept never evaluates worse than its warm start.

    Args:
        task: the robot's world.
        program: P.
        demonstrations: their entities named as in the program's rollouts; actions are read in profile `actions` only.
        library: controllers learned before, by name; they stay as they are.
        config: settings.
        seed: decides everything.
        log: receives metrics by controller.
        solve: whether the program is to bring ψ_R about; its last skill then acts on after its own φ, and is improved
            for that where it falls short. Otherwise reaching the program's end is all.
        checkpoints: directory for progress; finished skills found there are not learned again.

    Returns:
        The library with a skill for every controller of the program, and one report per new skill.

    Source: Algorithm 5 line 5, Sec. 4.3.3.
    Departs: each skill is an ordinary environment started from a pool of the program's own states, instead of a
        replay buffer filled by whole-program runs. ψ_R itself gets a short attempt without cloning: failing is its
        purpose.
    """
    segments = [segment(program, demonstration, solved=task.solved) for demonstration in demonstrations]
    setting = _Setting(task, program, demonstrations, segments, config, seed, log, checkpoints, solve)
    skills, reports = dict(library), []
    for rank, run in enumerate(controllers(program)):
        if run.controller not in skills:
            skills[run.controller], report = _learn(setting, rank, run, skills)
            reports.append(report)
        elif setting.ends_with(run):
            skills[run.controller], report = _improve(setting, rank, run, skills)
            reports.append(report)
    return TrainingResult(skills, tuple(reports))


def _improve(setting: _Setting, rank: int, run: Run, skills: Mapping[str, Skill]) -> tuple[Skill, SkillReport]:
    """Improve the last skill for ψ_R where the program solves the task often enough for that to be worth while.

    Otherwise a subgoal is missing, and the last skill, which acts on until ψ_R, is not to blame.
    """
    config, seeds = setting.config, setting.draw("screening").integers(2**31, size=setting.config.screening)
    limits = _limits(setting.program, setting.segments)
    screened = execute(setting.program, skills, setting.task, seeds, limits=limits, confirm=config.confirm)
    rate, steps = float(screened.success.mean()), screened.control_steps
    if rate < config.worth_improving:
        return skills[run.controller], SkillReport(run.controller, "kept", 0, rate, rate, steps)
    skill, report = _learn(setting, rank, run, skills)
    return skill, replace(report, control_steps=report.control_steps + steps)


def step_limits(program: Program, demonstrations: Sequence[Trajectory], task: Task) -> dict[str, int]:
    """Return each controller's step limit: twice its longest segment in the demonstrations.

    Args:
        program: P.
        demonstrations: canonically named.
        task: answers ψ_R.

    Returns:
        Steps by controller name; controllers that no demonstration runs are left out.

    Source: algorithms.md, ruling 12.
    """
    return _limits(program, [segment(program, d, solved=task.solved) for d in demonstrations])


def _limits(program: Program, segments: Sequence[tuple[Segment, ...]]) -> dict[str, int]:
    runs = controllers(program)
    longest: dict[str, int] = {}
    for part in (part for parts in segments for part in parts):
        name = runs[part.run_index].controller
        longest[name] = max(longest.get(name, 0), part.stop - part.start)
    return {name: 2 * steps for name, steps in longest.items() if steps > 0}


def _learn(setting: _Setting, rank: int, run: Run, skills: Mapping[str, Skill]) -> tuple[Skill, SkillReport]:
    """Learn one skill, or read it from its checkpoint."""
    name = f"{run.controller}.last" if setting.ends_with(run) else run.controller
    finished = None if setting.checkpoints is None else setting.checkpoints / f"{name}.safetensors"
    identity = {"controller": name, "until": str(run.until), "seed": setting.seed}
    if finished is not None and finished.exists():
        return _read(finished, identity, run.controller, setting.task)
    skill, report = _train(setting, rank, run, skills)
    if finished is not None:
        _write(finished, identity, skill, report)
    return skill, report


def _train(setting: _Setting, rank: int, run: Run, skills: Mapping[str, Skill]) -> tuple[Skill, SkillReport]:
    """Collect starts, warm-start, and improve by reinforcement learning where needed."""
    held_out, pool, spent = _pools(setting, rank, run, skills)
    fresh = _fresh_skill(setting, rank, run, pool)
    if not len(pool):
        return fresh, SkillReport(run.controller, "initial", 0, 0.0, 0.0, spent)
    subtask = _subtask(setting, rank, run)
    world = setting.task.world(setting.config.pool.batch)

    def success(skill: Skill) -> float:
        return evaluate_skill(subtask, held_out, skill, world).rate

    warm, warm_success, learner = _warm_start(setting, rank, run, fresh, skills, success, world)
    log = partial(_shifted, setting.log, run.controller, spent)
    log({"warm_success": warm_success}, world.control_steps)
    report = SkillReport(run.controller, learner, len(pool), warm_success, warm_success, spent + world.control_steps)
    if warm_success >= setting.config.target:
        return warm, report
    budget = setting.config.opaque_budget if subtask.opaque else setting.config.budget
    task = LearnerTask(subtask, pool, success, setting.config.target, budget)
    learned = _reinforce(setting, run, warm, warm_success, task, log)
    better = learned.success > warm_success
    return learned.skill if better else warm, replace(
        report,
        learner=_learner(setting.config) if better else learner,
        success=max(learned.success, warm_success),
        control_steps=spent + world.control_steps + learned.control_steps,
    )


def _shifted(log: ProgramLog, controller: str, spent: int, metrics: Mapping[str, float], step: int) -> None:
    """Log under a controller's name, counting on from the steps spent before."""
    log(controller, metrics, spent + step)


def _learner(config: TrainConfig) -> str:
    return "sac" if config.profile == "paper" else "ppo"


def _reinforce(setting: _Setting, run: Run, warm: Skill, success: float, task: LearnerTask, log: Log) -> Learned:
    """Learn by reinforcement, from the warm start by PPO or from scratch by SAC.

    An attempt on ψ_R itself is PPO in every profile: it has no time for a replay buffer, and nothing to lose.
    """
    config, seed = setting.config, setting.seed_of(f"{run.controller} {_learner(setting.config)}")
    if config.profile == "paper" and not task.subtask.opaque:
        return train_sac(warm, task, config.sac, seed, log)
    settings = replace(config.ppo, critic_iterations=0, noise=config.blind_noise) if task.subtask.opaque else config.ppo
    name = f"{run.controller}.last" if setting.ends_with(run) else run.controller
    progress = None if setting.checkpoints is None else setting.checkpoints / f"{name}.ppo.safetensors"
    return train_ppo(warm, success, task, settings, seed, log, progress)


def _pools(setting: _Setting, rank: int, run: Run, skills: Mapping[str, Skill]) -> tuple[StartPool, StartPool, int]:
    """Collect held-out starts, starts for training, and the control steps that took."""
    config, rng = setting.config.pool, setting.draw(f"{run.controller} starts")
    if isinstance(run.until, Solved):
        config = replace(config, starts=config.opaque, evaluation=config.opaque)
    prefix = Prefix(setting.program, rank, skills, _limits(setting.program, setting.segments), setting.config.confirm)
    wanted = config.starts + config.evaluation
    seeds = rng.integers(2**31, size=config.attempts * wanted)
    found, steps = collect_starts(prefix, setting.task, wanted, seeds, rng, config.batch)
    share = config.evaluation / wanted
    episodes = len(np.unique(found.episode))
    held_out, pool = found.capped(config.per_episode).split(round(share * episodes))
    return held_out, pool, steps


def _subtask(setting: _Setting, rank: int, run: Run) -> Subtask:
    """Say what is asked of the skill: its step limit and the units of its reward come from the demonstrations."""
    limits = _limits(setting.program, setting.segments)
    return Subtask(
        task=setting.task,
        until=run.until,
        variables=run_variables(run),
        limit=limits.get(run.controller, setting.task.horizon),
        confirm=setting.config.confirm,
        maintain=setting.ends_with(run),
        scales=_scales(setting, rank, run),
    )


def _scales(setting: _Setting, rank: int, run: Run) -> dict[str, float]:
    """Return the spread of each atom's term over the demonstrated segments of the skill."""
    values: dict[str, list[float]] = {}
    names = run_variables(run)
    for demonstration, parts in zip(setting.demonstrations, setting.segments, strict=True):
        for part in (part for part in parts if part.run_index == rank):
            binding = dict(zip(names, part.entities, strict=True))
            states = demonstration.states[part.start : part.stop + 1]
            for atom in atoms(run.until):
                term = atom_term(atom)
                found = evaluate(term, states, binding, setting.task.layout)
                values.setdefault(str(term), []).extend(found[..., 0].tolist())
    spreads = {text: float(np.nanstd(found)) for text, found in values.items()}
    return {text: spread for text, spread in spreads.items() if spread > 0}


def _frames(setting: _Setting, rank: int, beyond: int) -> Frames | None:
    """Cut the frames of one controller out of the demonstrations, and a few beyond φ; None where there are none."""
    actions, size = setting.config.profile == "actions", setting.task.action_size
    found = [
        frames_of(part, demonstration, beyond, actions, size)
        for demonstration, parts in zip(setting.demonstrations, setting.segments, strict=True)
        for part in parts
        if part.run_index == rank
    ]
    return joined(found) if found else None


def _spec(setting: _Setting, run: Run, *units: Sequence[str]) -> ObservationSpec:
    """Return what is seen of a controller's arguments, not yet normalised."""
    types = {part.var.name: part.type for part in walk(setting.program) if isinstance(part, Get)}
    return observation_spec(run, types, setting.task.layout, *units)


def _fresh_skill(setting: _Setting, rank: int, run: Run, pool: StartPool) -> Skill:
    """Return an untrained skill that sees its arguments, normalised on demonstrated states, else on start states."""
    frames = _frames(setting, rank, setting.config.clone.extra_frames)
    states, entities = (pool.states, pool.entities) if frames is None else (frames.states, frames.entities)
    fitted = _spec(setting, run).fitted(setting.task.layout, states, entities)
    return initial_skill(
        Skill(run.controller, fitted, (), setting.task.layout),
        setting.task.action_size,
        setting.config.clone.hidden,
        setting.seed_of(f"{run.controller} weights"),
    )


def _warm_start(
    setting: _Setting,
    rank: int,
    run: Run,
    fresh: Skill,
    skills: Mapping[str, Skill],
    success: Callable[[Skill], float],
    world: World,
) -> tuple[Skill, float, str]:
    """Return the best of what was known before and of clones, its success, and what gave it."""
    known, target = skills.get(run.controller), setting.config.target
    kept = None if known is None else success(known)
    if known is not None and kept is not None and kept >= target:
        return known, kept, "kept"
    samples = _samples(setting, rank, run, fresh, world)
    cloned = None
    if samples is not None and len(samples):
        seed = setting.seed_of(f"{run.controller} clone")
        cloned = best_of(candidates(fresh, samples, setting.config, seed), success, target)
    if cloned is not None and (kept is None or cloned[1] > kept):
        return *cloned, "clone"
    if known is not None and kept is not None:
        return known, kept, "kept"
    return fresh, success(fresh), "initial"


def _samples(setting: _Setting, rank: int, run: Run, fresh: Skill, world: World) -> Samples | None:
    """Return what there is to clone in this profile; actions are inferred where they may not be read."""
    if setting.config.profile == "paper" or isinstance(run.until, Solved):
        return None
    frames = _frames(setting, rank, setting.config.clone.extra_frames)
    if frames is not None and setting.config.profile == "states":
        seed = setting.seed_of(f"{run.controller} inverse")
        frames = inferred(frames, fresh.layout, _spec(setting, run, ALL_UNITS, ALL_UNITS), world, setting.config, seed)
    return None if frames is None else frames.samples()


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
