"""PlaceCubesDrawer on the batched engine beside the same scene in robosuite's own stepping, in one run.

    python -m tests.benchmarks.bench_drawer

Speed: every side is driven by the demonstrator's commands with noise, and the sides take turns. Agreement: the same
actions in free space, and how far the hands are apart.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

from roboscribe.envs.catalogue import make_task
from roboscribe.envs.drawer import moves
from roboscribe.envs.drawer.world import DrawerWorld
from roboscribe.envs.suite.bench import bench
from roboscribe.envs.suite.request import DRAWER, SuiteRequest
from tests.benchmarks.bench_engine import Watch

ROWS, STEPS, TURNS, NOISE, TARGET = 64, 20, 3, 0.15, 8.0
RUNS, LONG, SHOWN = 6, 60, (1, 5, 20, 60)
REQUEST = SuiteRequest(DRAWER, "Sawyer")


def ours(timing: str) -> Callable[[], tuple[float, float]]:
    """Prepare `ROWS` worlds; each call goes some steps with all of them."""
    world, rows = DrawerWorld(3, False, timing, ROWS), np.arange(ROWS)

    def turn() -> tuple[float, float]:
        rng, watch, before = np.random.default_rng(0), Watch(), world.control_steps
        states = world.reset(rows, rows)
        for _ in range(STEPS):
            actions = moves.command(states) + rng.normal(size=(ROWS, 4)) * NOISE
            with watch:
                states = world.step(rows, actions)
        return watch.speeds(world.control_steps - before)

    return turn


def theirs() -> tuple[float, float]:
    """Step robosuite's environment itself, once warm, without our saving and loading of its state."""
    one, rng, watch = bench(REQUEST), np.random.default_rng(0), Watch()
    one.reset(0)
    for step in range(STEPS + 1):
        action = np.append(rng.normal(size=6) * NOISE, -1.0)
        if step == 0:
            one.env.step(action)
            continue
        with watch:
            one.env.step(action)
    return watch.speeds(STEPS)


def apart(timing: str) -> list[float]:
    """Return the mean distance of the hands after `SHOWN` steps of the same smooth actions, mm."""
    world, other, rows = DrawerWorld(3, False, timing, RUNS), make_task(f"robosuite:{DRAWER}").world(2), np.arange(RUNS)
    rng = np.random.default_rng(1)
    phase, speed = rng.uniform(0, 6, size=(RUNS, 3)), rng.uniform(0.1, 0.3, size=(RUNS, 3))
    world.reset(rows, rows)
    gaps = np.empty((LONG, RUNS))
    hands = []
    for step in range(LONG):
        actions = np.concatenate([0.6 * np.sin(phase + speed * step) * (1, 1, 0.3), np.ones((RUNS, 1))], axis=1)
        hands.append(world.step(rows, actions)[:, :3])
    for run in range(RUNS):
        other.reset(rows[:1], rows[run : run + 1])
        for step in range(LONG):
            action = np.append(0.6 * np.sin(phase[run] + speed[run] * step) * (1, 1, 0.3), 1.0)
            gaps[step, run] = np.linalg.norm(other.step(rows[:1], action[None])[0, :3] - hands[step][run])
    return [1e3 * float(gaps[step - 1].mean()) for step in SHOWN]


def main() -> None:
    """Print both tables."""
    turns = {"robosuite, one environment": theirs, "faithful": ours("faithful"), "fast": ours("fast")}
    seen: dict[str, list[tuple[float, float]]] = {name: [] for name in turns}
    for _ in range(TURNS):
        for name, turn in turns.items():
            seen[name].append(turn())
    speeds = {name: np.median(pairs, axis=0) for name, pairs in seen.items()}
    base, out = speeds["robosuite, one environment"], sys.stdout.write
    out(f"PlaceCubesDrawer, 3 cubes: {ROWS} worlds on 2 threads, median of {TURNS} turns\n")
    out(f"{'':30}{'control steps/s':>16}{'ratio':>8}{'per processor second':>22}{'ratio':>8}\n")
    for name, (wall, cpu) in speeds.items():
        out(f"{name:30}{wall:16,.0f}{wall / base[0]:8.2f}{cpu:22,.0f}{cpu / base[1]:8.2f}\n")
    out(f"fast: {speeds['fast'][0] / base[0]:.2f} times robosuite, target {TARGET:g}\n")
    for timing in ("faithful", "fast"):
        gaps = ", ".join(f"{gap:.1f} mm after {step}" for gap, step in zip(apart(timing), SHOWN, strict=True))
        out(f"{timing}: hands apart from robosuite's by {gaps} steps of the same actions\n")


if __name__ == "__main__":
    main()
