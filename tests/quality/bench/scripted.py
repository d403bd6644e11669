"""The learner on a task of the bench, and programs at work, with lookahead controllers in the place of learned ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from roboscribe.abstraction_refinement import Limits, Outcome, Solution, pure_steps, roboscribe
from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.syntax import Program
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.world.trajectory import Trajectory
from tests.quality.bench.controller import Lookahead, lookahead_skills
from tests.quality.bench.task import KinematicTask
from tests.quality.scripted import EPISODES, PATIENCE, spreads

Skills = dict[str, Lookahead]
EXTRA = 40
"""Control steps that a program may take beyond `PATIENCE`."""
FRESH = 40
"""Episodes in which the final program has to succeed."""
FRESH_SEED = 900_000
"""First seed of those: none that the learner has seen."""


def solve(task: KinematicTask, trajectories: list[Trajectory], seed: int) -> Solution[Skills] | Fail:
    """Synthesize a program from demonstrations."""
    evidence = Evidence.of(trajectories, task.solved)
    longest = patience(trajectories)

    def train(program: Program, psi: str, tree: Tree, skills: Skills) -> Skills:
        return {**skills, **lookahead_skills(task, program, lambda name: spreads(program, tree, name), seed)}

    def roll_out(program: Program, psi: str, skills: Skills) -> Outcome:
        rng = np.random.default_rng(seed)
        seeds = np.arange(EPISODES) + 1000 * seed
        until_end = psi != ROOT
        return Outcome.of(
            execute(program, skills, task, seeds, until_end=until_end, limits={}, rng=rng, horizon=longest)
        )

    return roboscribe(pure_steps(evidence, train, roll_out), {}, Limits())


def patience(trajectories: list[Trajectory]) -> int:
    """Control steps of an episode, given the longest demonstration."""
    return int(PATIENCE * max(len(t) for t in trajectories)) + EXTRA


def fresh_rollouts(task: KinematicTask, program: Program, skills: Mapping[str, Lookahead], horizon: int) -> Rollouts:
    """Run a program on seeds that nobody has learned from."""
    seeds = FRESH_SEED + np.arange(FRESH)
    rng = np.random.default_rng(FRESH_SEED)
    return execute(program, skills, task, seeds, limits={}, rng=rng, horizon=horizon)
