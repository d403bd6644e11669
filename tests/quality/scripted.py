"""Runs the whole of Algorithm 1 on point tasks, with lookahead controllers in the place of learned ones."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from roboscribe.abstraction_refinement import Limits, Outcome, Solution, pure_steps, roboscribe
from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.envs.point_world import POINT_TASKS, Lookahead, PointTask, lookahead_skills
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.reward import atom_term, atoms
from roboscribe.subtask_tree import ROOT, TRUE, Tree
from roboscribe.world.trajectory import Trajectory

Skills = dict[str, Lookahead]
EPISODES = 50
"""Episodes in which a program is tried. A wide interval cannot tell a good program from one that lacks a subgoal."""
PATIENCE = 1.5
"""Control steps of an episode, in lengths of the longest demonstration: whoever needs longer has failed."""


def solve(task: PointTask, trajectories: list[Trajectory], seed: int) -> Solution[Skills] | Fail:
    """Synthesize a program from demonstrations of a point task."""
    evidence = Evidence.of(trajectories, task.solved)
    horizon = min(task.horizon, int(PATIENCE * max(len(t) for t in trajectories)))

    def train(program: Program, psi: str, tree: Tree, skills: Skills) -> Skills:
        return {**skills, **lookahead_skills(task, program, lambda name: spreads(program, tree, name), seed)}

    def roll_out(program: Program, psi: str, skills: Skills) -> Outcome:
        rng = np.random.default_rng(seed)
        seeds = np.arange(EPISODES) + 1000 * seed
        until_end = psi != ROOT
        ran = execute(program, skills, task, seeds, until_end=until_end, limits={}, rng=rng, horizon=horizon)
        return Outcome.of(ran)

    return roboscribe(pure_steps(evidence, train, roll_out), {}, Limits())


def spreads(program: Program, tree: Tree, name: str) -> dict[str, float]:
    """Scales of a node, by the terms that its controller's `until` is about."""
    until = next(run.until for run in controllers(program) if run.controller == name)
    node = next((node for node in tree.nodes if node.name == name), None)
    if node is None:
        return {}
    pairs = zip(atoms(until), atoms(node.predicate), strict=True)
    return {str(atom_term(mine)): node.scales[str(atom_term(theirs))] for mine, theirs in pairs}


def demonstrations(name: str, seed: int, episodes: int = 40, *, shuffled: bool = False) -> list[Trajectory]:
    """Collect demonstrations, if asked with the entity indices of every one shuffled on their own."""
    task = POINT_TASKS[name]
    rng = np.random.default_rng(seed)
    return [t.renamed(_shuffle(task, rng)) if shuffled else t for t in _collected(name, episodes, seed)]


@lru_cache(maxsize=8)
def _collected(name: str, episodes: int, seed: int) -> tuple[Trajectory, ...]:
    """Several tests learn from the same demonstrations."""
    return tuple(POINT_TASKS[name].demonstrate(episodes, seed))


def _shuffle(task: PointTask, rng: np.random.Generator) -> tuple[int, ...]:
    order = list(range(len(task.kinds)))
    for kind in dict.fromkeys(task.kinds):
        members = [i for i, k in enumerate(task.kinds) if k == kind]
        for place, entity in zip(members, rng.permutation(members), strict=True):
            order[place] = int(entity)
    return tuple(order)


def paths(tree: Tree) -> set[tuple[str, ...]]:
    """Every path of a tree from True to ψ_R, circular nodes in parentheses."""

    def to(name: str) -> list[tuple[str, ...]]:
        if name == TRUE:
            return [(TRUE,)]
        shown = f"({name})" if tree.node(name).circular else name
        return [(*path, shown) for a, b in tree.edges if b == name for path in to(a)]

    return set(to(ROOT))


def variant(name: str, **changes: object) -> PointTask:
    """Return a point task with other options."""
    return replace(POINT_TASKS[name], **changes)  # type: ignore[arg-type]  # options are checked by their use
