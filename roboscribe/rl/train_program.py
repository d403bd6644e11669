"""TRAINPROGRAM: ground a program's controllers in the robot's world, one skill after the other (Sec. 4.3.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeAlias
from zlib import crc32

import numpy as np

from roboscribe.dsl.interpreter import Segment, segment
from roboscribe.dsl.rewrite import controllers, run_variables, walk
from roboscribe.dsl.semantics import evaluate
from roboscribe.dsl.syntax import Get, Program, Run, Seq, Solved
from roboscribe.errors import ArtifactError
from roboscribe.reward import atom_term, atoms
from roboscribe.rl.checkpoint import read_checkpoint, write_checkpoint
from roboscribe.rl.clone import Samples, clone, initial_skill
from roboscribe.rl.config import TrainConfig
from roboscribe.rl.observation import observation_spec
from roboscribe.rl.pool import StartPool
from roboscribe.rl.ppo import LearnerTask, train_ppo
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_env import evaluate_skill
from roboscribe.rl.starts import Prefix, collect_starts
from roboscribe.rl.subtask import Subtask
from roboscribe.world.protocols import Task
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
        learner: what gave the weights that were kept: "clone", "ppo", "sac" or "initial".
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
        checkpoints: directory for progress; finished skills found there are not learned again.

    Returns:
        The library with a skill for every controller of the program, and one report per new skill.

    Source: Algorithm 5 line 5, Sec. 4.3.3.
    Departs: each skill is an ordinary environment started from a pool of the program's own states, instead of a
        replay buffer filled by whole-program runs. ψ_R itself gets a short attempt without cloning: failing is its
        purpose.
    """
    segments = [segment(program, demonstration, solved=task.solved) for demonstration in demonstrations]
    setting = _Setting(task, program, demonstrations, segments, config, seed, log, checkpoints)
    skills, reports = dict(library), []
    for rank, run in enumerate(controllers(program)):
        if run.controller not in skills:
            skill, report = _learn(setting, rank, run, skills)
            skills[run.controller] = skill
            reports.append(report)
    return TrainingResult(skills, tuple(reports))


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
    finished = None if setting.checkpoints is None else setting.checkpoints / f"{run.controller}.safetensors"
    identity = {"controller": run.controller, "until": str(run.until), "seed": setting.seed}
    if finished is not None and finished.exists():
        return _read(finished, identity, setting.task)
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
    subtask = _subtask(setting, rank, run, pool)
    world = setting.task.world(min(setting.config.pool.batch, len(held_out)))

    def success(skill: Skill) -> float:
        return evaluate_skill(subtask, held_out, skill, world).rate

    warm, warm_success, learner = _warm_start(setting, rank, run, fresh, success)
    setting.log(run.controller, {"warm_success": warm_success}, spent + world.control_steps)
    budget = setting.config.opaque_budget if subtask.opaque else setting.config.budget
    spent_warm = spent + world.control_steps
    if warm_success >= setting.config.target:
        report = SkillReport(run.controller, learner, len(pool), warm_success, warm_success, spent_warm)
        return warm, report
    task = LearnerTask(subtask, pool, success, setting.config.target, budget)
    progress = None if setting.checkpoints is None else setting.checkpoints / f"{run.controller}.ppo.safetensors"
    learned = train_ppo(
        warm,
        warm_success,
        task,
        setting.config.ppo,
        setting.seed_of(f"{run.controller} ppo"),
        lambda metrics, step: setting.log(run.controller, metrics, spent + step),
        progress,
    )
    if learned.success > warm_success:
        learner = "ppo"
    steps = spent + world.control_steps + learned.control_steps
    return learned.skill, SkillReport(run.controller, learner, len(pool), warm_success, learned.success, steps)


def _pools(setting: _Setting, rank: int, run: Run, skills: Mapping[str, Skill]) -> tuple[StartPool, StartPool, int]:
    """Collect held-out starts, starts for training, and the control steps that took."""
    config, rng = setting.config.pool, setting.draw(f"{run.controller} starts")
    prefix = Prefix(setting.program, rank, skills, _limits(setting.program, setting.segments), setting.config.confirm)
    wanted = config.starts + config.evaluation
    seeds = rng.integers(2**31, size=config.attempts * wanted)
    found, steps = collect_starts(prefix, setting.task, wanted, seeds, rng, config.batch)
    share = config.evaluation / wanted
    episodes = len(np.unique(found.episode))
    held_out, pool = found.capped(config.per_episode).split(round(share * episodes))
    return held_out, pool, steps


def _subtask(setting: _Setting, rank: int, run: Run, pool: StartPool) -> Subtask:
    """Say what is asked of the skill: its step limit and the units of its reward come from the demonstrations."""
    limits = _limits(setting.program, setting.segments)
    return Subtask(
        task=setting.task,
        until=run.until,
        variables=run_variables(run),
        limit=limits.get(run.controller, setting.task.horizon),
        confirm=setting.config.confirm,
        maintain=_ends(setting.program, run),
        scales=_scales(setting, rank, run),
    )


def _ends(program: Program, run: Run) -> bool:
    """Tell whether a controller is the program's last statement: it is to bring ψ_R about, not only its own φ."""
    last = program.body.parts[-1] if isinstance(program.body, Seq) and program.body.parts else program.body
    return last is run and not isinstance(run.until, Solved)


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


def _frames(setting: _Setting, rank: int, run: Run, beyond: int) -> Samples:
    """Cut the frames of one controller out of the demonstrations, and a few beyond φ; actions are NaN where absent."""
    states = [np.zeros((0, setting.task.layout.size))]
    actions = [np.zeros((0, setting.task.action_size))]
    entities = [np.zeros((0, len(run_variables(run))), np.int64)]
    for demonstration, parts in zip(setting.demonstrations, setting.segments, strict=True):
        for part in (part for part in parts if part.run_index == rank):
            stop = min(part.stop + beyond, len(demonstration) - 1)
            states.append(demonstration.states[part.start : stop])
            unknown = np.full((stop - part.start, setting.task.action_size), np.nan)
            actions.append(unknown if demonstration.actions is None else demonstration.actions[part.start : stop])
            entities.append(np.tile(np.array(part.entities, np.int64), (stop - part.start, 1)))
    return Samples(np.concatenate(states), np.concatenate(entities), np.concatenate(actions))


def _fresh_skill(setting: _Setting, rank: int, run: Run, pool: StartPool) -> Skill:
    """Return an untrained skill that sees its arguments, normalised on demonstrated and start states."""
    types = {part.var.name: part.type for part in walk(setting.program) if isinstance(part, Get)}
    spec = observation_spec(run, types, setting.task.layout)
    frames = _frames(setting, rank, run, 0)
    states = np.concatenate([frames.states, pool.states])
    fitted = spec.fitted(setting.task.layout, states, np.concatenate([frames.entities, pool.entities]))
    return initial_skill(
        Skill(run.controller, fitted, (), setting.task.layout),
        setting.task.action_size,
        setting.config.clone.hidden,
        setting.seed_of(f"{run.controller} weights"),
    )


def _warm_start(
    setting: _Setting, rank: int, run: Run, fresh: Skill, success: Callable[[Skill], float]
) -> tuple[Skill, float, str]:
    """Return a warm start, its success on the held-out starts, and what gave it."""
    if setting.config.profile == "actions" and not isinstance(run.until, Solved):
        frames = _frames(setting, rank, run, setting.config.clone.extra_frames)
        samples = frames.known()
        if len(samples):
            return _best_clone(setting, fresh, samples, success)
    return fresh, success(fresh), "initial"


def _best_clone(
    setting: _Setting, fresh: Skill, samples: Samples, success: Callable[[Skill], float]
) -> tuple[Skill, float, str]:
    """Clone, and choose among the checkpoints by rollouts, latest first; training loss does not tell."""
    best, best_rate = fresh, -1.0
    seed = setting.seed_of(f"{fresh.name} clone")
    for _, candidate in reversed(list(clone(fresh, samples, setting.config.clone, seed))):
        rate = success(candidate)
        if rate > best_rate:
            best, best_rate = candidate, rate
        if rate >= setting.config.target:
            break
    return best, best_rate, "clone"


def _write(path: Path, identity: Mapping[str, object], skill: Skill, report: SkillReport) -> None:
    description, arrays = skill.to_parts()
    write_checkpoint(path, arrays, {**identity, "skill": description, "report": asdict(report)})


def _read(path: Path, identity: Mapping[str, object], task: Task) -> tuple[Skill, SkillReport]:
    arrays, notes = read_checkpoint(path, identity)
    description, report = notes["skill"], notes["report"]
    if not isinstance(description, Mapping) or not isinstance(report, Mapping):
        msg = f"checkpoint {path} holds no skill; delete it to train from the start"
        raise ArtifactError(msg)
    skill = Skill.from_parts(str(identity["controller"]), description, arrays, task.layout)
    return skill, SkillReport(**report)
