"""Small syntheses for tests: point tasks, few episodes, controllers that look ahead or hardly learn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from roboscribe.abstraction_refinement import Limits
from roboscribe.errors import Fail
from roboscribe.io.atomic import Json
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.synthesis_run import Engine, SynthesisRun
from roboscribe.pipelines.workspace import Workspace
from roboscribe.rl.config import BLIND, PoolConfig, PpoConfig, TrainConfig
from roboscribe.stages.runtime.events import Event
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.mlflow_store import synchronise
from tests.pipelines.stores import empty_store

TASK = TaskConfig("point-pick-place-1")
Command = Callable[..., int]
"""Runs `roboscribe` with some arguments; returns its exit code."""


def scripted(seed: int = 0, task: str = TASK.name, **more: object) -> SynthesisPlan:
    """Plan a synthesis that takes a second: nothing is learned."""
    few = {"n_demonstrations": 12, "rollout_episodes": 20, "evaluation_episodes": 40, "video": False}
    return SynthesisPlan(TaskConfig(task), seed, "scripted", **{**few, **more})  # type: ignore[arg-type]  # its fields


def learned(seed: int = 0) -> SynthesisPlan:
    """Plan a synthesis that accepts whatever one short attempt of PPO gives."""
    ppo = PpoConfig(worlds=8, steps=20, epochs=1, minibatches=2, critic_iterations=1, evaluate_every=1)
    training = TrainConfig(
        budget=40_000,
        learning=0.03,
        opaque_budget=1200,
        pool=PoolConfig(starts=16, evaluation=16),
        learner=ppo,
        blind=replace(ppo, critic_iterations=BLIND.critic_iterations, noise=BLIND.noise),
    )
    return SynthesisPlan(
        TASK,
        seed,
        limits=Limits(success=0.0),
        training=training,
        n_demonstrations=10,
        rollout_episodes=5,
        evaluation_episodes=5,
        video=False,
    )


def run(
    plan: SynthesisPlan,
    home: Path,
    engine: Engine = "local",
    *,
    track: bool = False,
    on_event: Callable[[Event], None] = lambda event: None,
    on_stage: Callable[[str], None] = lambda label: None,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> dict[str, Json] | Fail:
    """Run a plan in a directory of its own."""
    return SynthesisRun(plan, Workspace(home), engine, home / "program", track).run(
        Callbacks(on_stage, on_event, on_progress)
    )


def contents(directory: Path) -> dict[str, bytes]:
    """Read every file of a directory."""
    files = (path for path in sorted(directory.rglob("*")) if path.is_file())
    return {path.relative_to(directory).as_posix(): path.read_bytes() for path in files}


def outputs(home: Path) -> dict[str, bytes]:
    """Read what the stages of a run wrote, but for when they wrote it."""
    found = contents(home / "data" / "stages")
    return {name: data for name, data in found.items() if Path(name).name not in ("timing.json", "metrics.jsonl")}


def tracked(home: Path) -> Path:
    """Do one run in an empty home and copy it to MLflow; returns the home."""
    empty_store(home / "mlruns")
    run(scripted(), home)
    synchronise(home / "data" / "runs", home / "mlruns")
    return home
