"""ROBOSCRIBE and SYNTHESIZE (Algorithms 1 and 2): refine the abstraction until a program solves the task."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from roboscribe.classifier import Refinement, learn_classifier
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.syntax import Program
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.program_gen import gen_program
from roboscribe.subtask_tree import ROOT, Tree, update_tree, validate
from roboscribe.world.layout import FloatArray
from roboscribe.world.naming import by_binding

Skills = TypeVar("Skills")
"""Whatever TRAINPROGRAM returns: the algorithms pass controllers on without looking at them."""


@dataclass(frozen=True)
class Outcome:
    """What Exec(M, P) showed for one program and goal.

    Args:
        successes: episodes that reached the goal.
        episodes: episodes run.
        failures: (M, F), N_s, all states of all failing episodes, entities named in the order of their binding.
    """

    successes: int
    episodes: int
    failures: FloatArray

    @property
    def rate(self) -> float:
        """Share of episodes that reached the goal."""
        return self.successes / self.episodes

    @classmethod
    def of(cls, rollouts: Rollouts) -> Outcome:
        """Read rollouts; a diverged episode is a failure whose states are left out."""
        layout = rollouts.layout
        lost = [
            layout.permute(t.states, by_binding(layout, bound))
            for t, bound, won, broken in zip(
                rollouts.trajectories, rollouts.bound, rollouts.success, rollouts.diverged, strict=True
            )
            if not won and not broken
        ]
        failures = np.concatenate(lost) if lost else np.empty((0, layout.size))
        return cls(int(rollouts.success.sum()), len(rollouts.success), failures)


@dataclass(frozen=True)
class Steps(Generic[Skills]):
    """The pieces of Algorithm 2. Pipelines wrap each to track and cache it; the algorithm stands here once.

    Args:
        generate: GENPROGRAM without training: goal and tree to program.
        train: TRAINPROGRAM: grounds every controller of a program that the given skills lack.
        roll_out: Exec(M, P) for a program, its skills and a goal.
        classify: LEARNCLASSIFIER: N_s, tree and goal to a refinement.
        update_tree: UPDATETREE: tree and refinement to tree.
        validate: VALIDATE: the reason why a tree cannot be right, or None.
    """

    generate: Callable[[str, Tree], Program | Fail]
    train: Callable[[Program, str, Tree, Skills], Skills]
    roll_out: Callable[[Program, str, Skills], Outcome]
    classify: Callable[[FloatArray, Tree, str], Refinement | Fail]
    update_tree: Callable[[Tree, Refinement], Tree]
    validate: Callable[[Tree], Fail | None]


def pure_steps(
    evidence: Evidence,
    train: Callable[[Program, str, Tree, Skills], Skills],
    roll_out: Callable[[Program, str, Skills], Outcome],
    name: str = "P",
) -> Steps[Skills]:
    """Bind the pure functions to the demonstrations; training and rollouts arrive as callables."""
    return Steps(
        generate=lambda goal, tree: gen_program(goal, evidence, tree, name),
        train=train,
        roll_out=roll_out,
        classify=lambda failures, tree, goal: learn_classifier(failures, evidence, tree, goal),
        update_tree=lambda tree, refinement: update_tree(tree, refinement.node, refinement.psi, refinement.moved),
        validate=lambda tree: validate(tree, evidence.first_steps_of(tree)),
    )


@dataclass(frozen=True)
class Solution(Generic[Skills]):
    """P*, T* and how they were found.

    Args:
        program: the program.
        tree: the abstraction it was generated from.
        skills: its controllers.
        rate: share of episodes that reached the goal when the program was accepted.
        refinements: every refinement in order.
    """

    program: Program
    tree: Tree
    skills: Skills
    rate: float
    refinements: tuple[Refinement, ...] = ()


@dataclass(frozen=True)
class Limits:
    """When a program is good enough, and when to give up.

    Args:
        success: 1 − ε, least success rate of every subgoal.
        task: the same of the task and of loops. What four episodes in five do not lack is no subgoal, but better
            controllers of the many that have to succeed together.
        refinements: most refinements of one synthesis (Sec. 4.4 bounds them; this bounds them tighter).
    """

    success: float = 0.95
    task: float = 0.8
    refinements: int = 20


def roboscribe(steps: Steps[Skills], skills: Skills, limits: Limits) -> Solution[Skills] | Fail:
    """Synthesize a program that solves the task.

    Args:
        steps: the pieces of Algorithm 2, bound to world and demonstrations.
        skills: no controllers, in whatever form `steps.train` wants them.
        limits: accuracy asked and effort allowed.

    Returns:
        The solution, or Fail with the reason.

    Source: Algorithm 1.
    """
    return synthesize(ROOT, Tree(), skills, steps, limits)


def synthesize(
    psi: str, tree: Tree, skills: Skills, steps: Steps[Skills], limits: Limits, blind: FloatArray | None = None
) -> Solution[Skills] | Fail:
    """Find a program that reaches ψ, refining the tree where the present one fails.

    Args:
        psi: name of the goal node.
        tree: T.
        skills: controllers trained so far.
        steps: the pieces.
        limits: accuracy asked and effort left.
        blind: N_s of the attempt on ψ_R itself; None before it.

    Returns:
        The solution for ψ with every refinement made on the way, or Fail.

    Source:  Algorithm 2.
    Departs: the goal is explicit; failure carries its reason; controllers trained once are kept. While nothing
        precedes ψ, it is compared with the attempt on ψ_R itself: an attempt on ψ that was cloned reaches most of
        what leads to ψ even where it fails, and would teach muddled predicates.
    """
    program = steps.generate(psi, tree)
    if isinstance(program, Fail):
        return program
    skills = steps.train(program, psi, tree, skills)
    outcome = steps.roll_out(program, psi, skills)
    if outcome.rate >= (limits.task if psi == ROOT or tree.node(psi).circular else limits.success):
        return Solution(program, tree, skills, outcome.rate)
    if limits.refinements <= 0:
        return Fail(f"{psi} is reached in only {outcome.rate:.0%} of the episodes after the last refinement allowed")
    failures = outcome.failures if blind is None or tree.predecessors(psi) else blind
    blind = failures if blind is None else blind
    refinement = steps.classify(failures, tree, psi)
    if isinstance(refinement, Fail):
        return Fail(f"{psi} is reached in only {outcome.rate:.0%} of the episodes, and {refinement.reason}")
    tree = steps.update_tree(tree, refinement)
    invalid = steps.validate(tree)
    if invalid is not None:
        return invalid
    subgoal = synthesize(refinement.node.name, tree, skills, steps, _less(limits, 1), blind)
    if isinstance(subgoal, Fail):
        return subgoal
    goal = synthesize(psi, subgoal.tree, subgoal.skills, steps, _less(limits, 1 + len(subgoal.refinements)), blind)
    if isinstance(goal, Fail):
        return goal
    return replace(goal, refinements=(refinement, *subgoal.refinements, *goal.refinements))


def _less(limits: Limits, used: int) -> Limits:
    return replace(limits, refinements=limits.refinements - used)
