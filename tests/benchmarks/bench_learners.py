"""Updates per second of each learner, and the share of wall time outside simulation and learning.

    python -m tests.benchmarks.bench_learners

Each learner works on the `hold` skill of pick-place-1 for a fixed amount of work. Simulation is the time spent in the
world; learning the time spent in gradient updates; the rest is observations, rewards, actions and bookkeeping.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from stable_baselines3 import SAC

from roboscribe.dsl.parser import parse_program
from roboscribe.envs.catalogue import make_task
from roboscribe.rl import clone as cloning
from roboscribe.rl.config import CloneConfig, PpoConfig, SacConfig, TrainConfig
from roboscribe.rl.inverse_dynamics import fit_inverse, probe, random_actions
from roboscribe.rl.learner import LearnerTask
from roboscribe.rl.ppo import train_ppo
from roboscribe.rl.program_training import ProgramTraining
from roboscribe.rl.sac import train_sac
from roboscribe.rl.skill_env import Verdict
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.task import Task, World
from roboscribe.world.trajectory import Trajectory

UNBOUNDED = 10**9
"""Control steps that start states may take."""
PROGRAM = "def Reach(μ : EE): b := get(λb:block. true); π_hold(μ, b) until ‖μ↓xyz − b↓xyz‖ < 0.033"


@dataclass
class Watch:
    """Adds up the seconds spent inside its calls."""

    seconds: float = 0.0

    def timed(self, function: Callable[..., object]) -> Callable[..., object]:
        """Return the function with its calls timed."""

        def call(*args: object, **options: object) -> object:
            start = perf_counter()
            try:
                return function(*args, **options)
            finally:
                self.seconds += perf_counter() - start

        return call


class TimedWorld(World):
    """A world whose stepping, loading and saving are timed."""

    def __init__(self, world: World, watch: Watch) -> None:
        """Wrap a world."""
        self.inner, self.batch = world, world.batch
        for name in ("reset", "step", "observe", "load", "save"):
            setattr(self, name, watch.timed(getattr(world, name)))

    @property
    def control_steps(self) -> int:  # type: ignore[override]  # the wrapped world counts
        """Count of the wrapped world."""
        return self.inner.control_steps

    def diverged(self, rows: IntArray) -> BoolArray:
        """Ask the wrapped world."""
        return self.inner.diverged(rows)


class TimedTask(Task):
    """Pick&Place-1 with timed worlds."""

    def __init__(self, watch: Watch) -> None:
        """Wrap the task."""
        self.inner, self.watch = make_task("pick-place-1"), watch
        self.name, self.horizon, self.frequency = self.inner.name, self.inner.horizon, self.inner.frequency
        self.action_size = self.inner.action_size
        self.layout: Layout = self.inner.layout

    def solved(self, states: FloatArray) -> BoolArray:
        """Ask the wrapped task."""
        return self.inner.solved(states)

    def world(self, batch: int) -> World:
        """Build a timed world."""
        return TimedWorld(self.inner.world(batch), self.watch)  # type: ignore[abstract]  # its methods are set

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Ask the wrapped task."""
        return self.inner.demonstrate(episodes, seed)


@dataclass(frozen=True)
class Figures:
    """What one learner did in how long."""

    name: str
    updates: int
    samples: int
    steps: int
    wall: float
    simulation: float
    learning: float

    def row(self) -> str:
        """Format as one line of the table."""
        rest = max(0.0, 1 - (self.simulation + self.learning) / self.wall)
        speed = f"{self.steps / self.wall:8.0f}" if self.steps else "       -"
        rate = self.updates / self.learning
        return f"{self.name:18s} {rate:10.0f} {rate * self.samples:12.0f} {speed} {100 * rest:8.1f} %"


def bench_ppo(training: ProgramTraining, watch: Watch, iterations: int = 10) -> Figures:
    """Run PPO for a few iterations."""
    run, config = training.runs[0], PpoConfig(critic_iterations=0)
    pool, _ = training.starts(run, {}, UNBOUNDED)
    skill, learning = training.fresh_skills(run, pool)[0], Watch()
    budget = iterations * config.worlds * config.steps
    task = LearnerTask(training.subtask(run), pool, lambda *_: Verdict(0.0, 0), 1.0, budget)

    def log(metrics: object, step: int) -> None:
        assert isinstance(metrics, dict)
        learning.seconds += metrics["learn_time"]

    watch.seconds, start = 0.0, perf_counter()
    train_ppo(skill, 0.0, task, config, 0, log)
    wall, updates = perf_counter() - start, iterations * config.epochs * config.minibatches
    samples = config.worlds * config.steps // config.minibatches
    return Figures("PPO (rsl-rl)", updates, samples, budget, wall, watch.seconds, learning.seconds)


def bench_sac(training: ProgramTraining, watch: Watch, rounds: int = 120) -> Figures:
    """Run SAC for some rounds, most of them with updates."""
    run, config = training.runs[0], SacConfig(evaluate_every=rounds, learning_starts=1280)
    pool, _ = training.starts(run, {}, UNBOUNDED)
    task = LearnerTask(training.subtask(run), pool, lambda *_: Verdict(0.0, 0), 2.0, config.worlds * rounds)
    learning, train = Watch(), SAC.train
    SAC.train = learning.timed(train)  # type: ignore[method-assign,assignment] # the library has no hook around its updates
    try:
        watch.seconds, start = 0.0, perf_counter()
        train_sac(training.fresh_skills(run, pool)[0], task, config, 0)
        wall = perf_counter() - start
    finally:
        SAC.train = train  # type: ignore[method-assign] # put back
    updates = config.updates * (rounds - config.learning_starts // config.worlds)
    return Figures("SAC (SB3)", updates, config.batch, task.budget, wall, watch.seconds, learning.seconds)


def bench_clone(training: ProgramTraining) -> Figures:
    """Clone the demonstrated segments."""
    run, config = training.runs[0], CloneConfig()
    frames = training.frames(run)
    assert frames is not None
    pool, _ = training.starts(run, {}, UNBOUNDED)
    skill, start = training.fresh_skills(run, pool)[0], perf_counter()
    list(cloning.clone(skill, frames.samples(), config, 0))
    wall = perf_counter() - start
    return Figures("cloning", config.steps, config.batch, 0, wall, 0.0, wall)


def bench_inverse(training: ProgramTraining, watch: Watch) -> Figures:
    """Try actions out from the demonstrated states, and fit them."""
    run, config = training.runs[0], training.config.inverse
    frames = training.frames(run)
    assert frames is not None
    rng, world = np.random.default_rng(0), training.task.world(64)
    watch.seconds, start = 0.0, perf_counter()
    snapshots = np.repeat(frames.snapshots, config.tries, axis=0)
    entities = np.repeat(frames.entities, config.tries, axis=0)
    data = probe(world, snapshots, entities, random_actions(1, len(snapshots), 4, rng))
    fitting = perf_counter()
    fit_inverse(training.specs(run, speeds=True)[0], training.task.layout, data, config, 0)
    end = perf_counter()
    return Figures("inverse dynamics", config.steps, config.batch, len(data), end - start, watch.seconds, end - fitting)


def main() -> None:
    """Print the table."""
    watch = Watch()
    task = TimedTask(watch)
    config = TrainConfig()
    config = replace(config, pool=replace(config.pool, starts=128, evaluation=16))
    training = ProgramTraining(task, parse_program(PROGRAM), task.demonstrate(20, 0), config, 0, False)
    print(f"{'learner':18s} {'updates/s':>10s} {'samples/s':>12s} {'steps/s':>8s} {'elsewhere':>10s}")
    for figures in (
        bench_clone(training),
        bench_inverse(training, watch),
        bench_ppo(training, watch),
        bench_sac(training, watch),
    ):
        print(figures.row())


if __name__ == "__main__":
    main()
