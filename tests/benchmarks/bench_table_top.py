"""Control steps per second of the table-top against one of metaworld's own environments, in the same run.

    python -m tests.benchmarks.bench_table_top

Both sides are driven by their demonstrators with noise, so that contacts count: ours through mug, drawer and faucet,
metaworld's through its drawer alone. A control step of metaworld is 12.5 ms long, one of ours 40 ms; the last columns
count the seconds that are simulated. Sides take turns, and each figure is the median over the turns.
"""

from __future__ import annotations

import sys

import numpy as np
from metaworld import MT1
from metaworld.policies import SawyerDrawerOpenV3Policy

from roboscribe.envs.tasks.table_top import TableTop
from tests.benchmarks.bench_engine import Turn, Watch

ROWS, STEPS, TURNS = 64, 100, 5
NOISE = 0.15
NAME = "drawer-open-v3"
OURS = "table-top, fast"
BASE = f"metaworld, {NAME}, one environment"
LENGTHS = {BASE: 0.0125}
"""Seconds of a control step; ours are 0.04 s."""
TARGET = 3.0


def ours(timing: str) -> Turn:
    """Prepare `ROWS` worlds; each call runs one episode of all of them."""
    task, rows = TableTop("bench", timing=timing), np.arange(ROWS)
    world = task.world(ROWS)

    def turn() -> tuple[float, float]:
        rng, watch, before = np.random.default_rng(0), Watch(), world.control_steps
        states = world.reset(rows, rows)
        for _ in range(STEPS):
            actions = task.command(states) + rng.normal(size=(ROWS, 4)) * NOISE
            with watch:
                states = world.step(rows, actions)
        return watch.speeds(world.control_steps - before)

    return turn


def theirs(episodes: int = 8) -> Turn:
    """Prepare one environment in a Python loop; each call runs some episodes."""
    benchmark, policy = MT1(NAME, seed=0), SawyerDrawerOpenV3Policy()  # type: ignore[no-untyped-call]  # Meta-World has none
    env = benchmark.train_classes[NAME]()

    def turn() -> tuple[float, float]:
        rng, watch = np.random.default_rng(0), Watch()
        for task in benchmark.train_tasks[:episodes]:
            env.set_task(task)
            observation, _ = env.reset()
            for _ in range(STEPS):
                action = np.clip(policy.get_action(observation) + rng.normal(size=4) * NOISE, -1.0, 1.0)
                with watch:
                    observation = env.step(action)[0]
        return watch.speeds(episodes * STEPS)

    return turn


def main() -> None:
    """Print the table."""
    turns = {BASE: theirs(), "table-top, faithful": ours("faithful"), OURS: ours("fast")}
    seen: dict[str, list[tuple[float, float]]] = {name: [] for name in turns}
    for _ in range(TURNS):
        for name, turn in turns.items():
            seen[name].append(turn())
    out = sys.stdout.write
    out(f"Simulation: {ROWS} worlds on 2 threads, median of {TURNS} turns\n")
    out(f"{'':44}{'control steps/s':>16}{'ratio':>7}{'per processor s':>16}{'ratio':>7}{'seconds/s':>11}{'ratio':>7}\n")
    base, base_cpu = np.median(seen[BASE], axis=0)
    for name, pairs in seen.items():
        wall, cpu = np.median(pairs, axis=0)
        length = LENGTHS.get(name, 0.04)
        figures = f"{wall:16,.0f}{wall / base:7.2f}{cpu:16,.0f}{cpu / base_cpu:7.2f}"
        out(f"{name:44}{figures}{wall * length:11.1f}{wall * length / (base * LENGTHS[BASE]):7.2f}\n")
    ratio = 2 * np.median(seen[OURS], axis=0)[1] / base_cpu
    out(f"{OURS}: {ratio:.2f} times {BASE}, with two processors to itself; target {TARGET:g}\n")


if __name__ == "__main__":
    main()
