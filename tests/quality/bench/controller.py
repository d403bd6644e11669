"""Scripted controllers in the place of learned ones: greedy for R_φ, one step ahead."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from zlib import crc32

import numpy as np

from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.dsl.syntax import Program, Run, Solved
from roboscribe.reward import reward
from roboscribe.world.layout import FloatArray, IntArray
from tests.quality.bench.kinematics import advance
from tests.quality.bench.task import KinematicTask

HEADINGS = 12
"""Directions in the plane among which a controller chooses."""
SPEEDS = (1.0, 0.3, 0.1)
"""Speeds among which it chooses, in full speeds."""
TURNS = (1.0, -1.0, 0.3, -0.3)
"""Turns of a held object among which it chooses, while the hand stands still."""
PRICE = 0.002
"""What it pays for a step at full speed, in spreads of R_φ."""
DRIFT = 0.1
"""Speed at which it drifts where no action pays, in full speeds."""


@dataclass(frozen=True, eq=False)
class Lookahead:
    """A controller that tries a fixed set of actions in the kinematic model and takes the most rewarding.

    Memoryless, and nearly still, in random directions, where no action pays.
    """

    task: KinematicTask
    run: Run
    scales: Mapping[str, float]
    seed: int = 0

    @cached_property
    def _choices(self) -> FloatArray:
        """Every action on offer (C, A): open fingers first, for of equals the first is taken."""
        return actions(self.task)

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Choose an action (R, A) for states (R, F)."""
        rng = np.random.default_rng([self.seed, crc32(states.tobytes())])  # memoryless, yet reproducible
        choices, width = self._choices, self.task.width
        drawn = choices[rng.integers(len(choices), size=len(states))]
        if isinstance(self.run.until, Solved):
            return np.asarray(drawn)
        after = advance(self.task, states[:, None], choices[None])
        value = self._reward(np.concatenate([states[:, None], after], axis=1), entities)
        gain = value[:, 1:] - value[:, :1] - PRICE * self._effort
        best = choices[gain.argmax(axis=1)]
        direction = rng.standard_normal((len(states), width))
        drift = DRIFT * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        still = best[:, width:] * (np.arange(best.shape[1] - width) == 0)
        pays = gain.max(axis=1, keepdims=True) > 0.0
        return np.asarray(np.where(pays, best, np.concatenate([drift, still], axis=1)))

    @cached_property
    def _effort(self) -> FloatArray:
        """How much each action moves or turns (C,), in full speeds."""
        motion = self._choices.copy()
        motion[:, self.task.width :][:, : self.task.fingers] = 0.0
        return np.asarray(np.linalg.norm(motion, axis=1))

    def _reward(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """R_φ in states (R, C, F) for entities (R, n); as flat rows, which are evaluated fastest."""
        rows, choices, width = states.shape
        names = run_variables(self.run)
        binding = {name: np.repeat(entities[:, j], choices) for j, name in enumerate(names)}
        flat = states.reshape(-1, width)
        layout, solved = self.task.layout, self.task.solved
        return reward(self.run.until, flat, binding, layout, self.scales, solved).reshape(rows, choices)


def actions(task: KinematicTask) -> FloatArray:
    """Return moves in all directions with open, then with closed fingers, then turns; (C, A)."""
    moves = np.concatenate([speed * _headings(task.width, HEADINGS * (1 if task.fingers else 2)) for speed in SPEEDS])
    if not task.fingers:
        return np.asarray(moves)
    turns = np.zeros((len(task.rotations) * len(TURNS), task.width + 1 + len(task.rotations)))
    for row, (axis, turn) in enumerate(product(range(len(task.rotations)), TURNS)):
        turns[row, [task.width, task.width + 1 + axis]] = 1.0, turn
    still = np.zeros((len(moves), len(task.rotations)))
    opened, closed = (np.column_stack([moves, np.full(len(moves), fingers), still]) for fingers in (-1.0, 1.0))
    return np.asarray(np.vstack([opened, closed, turns]))


def _headings(width: int, count: int) -> FloatArray:
    """Return unit vectors: a clock's in the plane, those to the faces, edges and corners of a cube in space."""
    if width == 2:
        angles = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    cube = np.array([corner for corner in product((-1.0, 0.0, 1.0), repeat=3) if any(corner)])
    return np.asarray(cube / np.linalg.norm(cube, axis=1, keepdims=True))


def lookahead_skills(
    task: KinematicTask, program: Program, scales: Callable[[str], Mapping[str, float]], seed: int = 0
) -> dict[str, Lookahead]:
    """Return a controller for every controller statement of a program."""
    return {run.controller: Lookahead(task, run, scales(run.controller), seed) for run in controllers(program)}
