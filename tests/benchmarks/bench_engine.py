"""Control steps per second of the batched engine against one gymnasium-robotics environment, in the same run.

    python -m tests.benchmarks.bench_engine

Every world is driven by the demonstrator's commands with noise, so that hands close on blocks and contacts count. The
sides take turns and each figure is the median over the turns. Steps per processor second count the time of all threads
and so hardly depend on what else the machine does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np

from roboscribe.envs import multi_block_demonstrator, single_block_demonstrator
from roboscribe.envs.goal_env import make_env, state_of
from roboscribe.envs.tasks.pick_place import PickPlace

ROWS = 64
STEPS = 40
TURNS = 5
NOISE = 0.15
TARGET = 4.0
BASE = "gymnasium-robotics, one environment"
OURS = "faithful, 1 block"


@dataclass
class Watch:
    """Adds up wall time and processor time of the stepping alone."""

    wall: float = 0.0
    cpu: float = 0.0

    def __enter__(self) -> None:
        """Start."""
        self.wall -= perf_counter()
        self.cpu -= process_time()

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self.wall += perf_counter()
        self.cpu += process_time()

    def speeds(self, steps: int) -> tuple[float, float]:
        """Give steps per second of wall time and of processor time."""
        return steps / self.wall, steps / self.cpu


Turn = Callable[[], tuple[float, float]]


def ours(blocks: int, timing: str, *, arm: bool = True) -> Turn:
    """Prepare `ROWS` worlds; each call runs one episode of all of them."""
    world = PickPlace("bench", blocks, contact="paper", timing=timing, arm=arm).world(ROWS)
    rows = np.arange(ROWS)
    command = (multi_block_demonstrator.SINGLE if blocks == 1 else multi_block_demonstrator.SERVE).command

    def turn() -> tuple[float, float]:
        rng, watch, before = np.random.default_rng(0), Watch(), world.control_steps
        states = world.reset(rows, rows)
        for _ in range(STEPS):
            actions = command(states) + rng.normal(size=(ROWS, 4)) * NOISE
            with watch:
                states = world.step(rows, actions)
        return watch.speeds(world.control_steps - before)

    return turn


def theirs(episodes: int = 8) -> Turn:
    """Prepare one environment in a Python loop; each call runs some episodes."""
    env = make_env("FetchPickAndPlace-v4", STEPS + 1)

    def turn() -> tuple[float, float]:
        rng, watch = np.random.default_rng(0), Watch()
        for seed in range(episodes):
            observation, _ = env.reset(seed=seed)
            for _ in range(STEPS):
                action = single_block_demonstrator.command(state_of(observation)[None])[0] + rng.normal(size=4) * NOISE
                with watch:
                    observation = env.step(action)[0]
        return watch.speeds(episodes * STEPS)

    return turn


def main() -> None:
    """Print the table."""
    turns = {BASE: theirs(), OURS: ours(1, "faithful"), "fast, 1 block": ours(1, "fast")}
    turns |= {"faithful, 5 blocks": ours(5, "faithful"), "fast, 5 blocks": ours(5, "fast")}
    turns |= {f"fast, hand alone, {count} block(s)": ours(count, "fast", arm=False) for count in (1, 5)}
    seen: dict[str, list[tuple[float, float]]] = {name: [] for name in turns}
    for _ in range(TURNS):
        for name, turn in turns.items():
            seen[name].append(turn())
    speeds = {name: np.median(pairs, axis=0) for name, pairs in seen.items()}
    ratios = {name: speed / speeds[BASE] for name, speed in speeds.items()}
    out = sys.stdout.write
    out(f"Simulation: {ROWS} worlds on 2 threads, contact model of the scene file, median of {TURNS} turns\n")
    out(f"{'':38}{'control steps/s':>16}{'ratio':>8}{'per processor second':>22}{'ratio':>8}\n")
    for name, (wall, cpu) in speeds.items():
        out(f"{name:38}{wall:16,.0f}{ratios[name][0]:8.2f}{cpu:22,.0f}{ratios[name][1]:8.2f}\n")
    wall, cpu = ratios[OURS]
    out(f"{OURS}: {wall:.2f} times {BASE}, target {TARGET:g}; {2 * cpu:.2f} with two processors to itself\n")


if __name__ == "__main__":
    main()
