"""ROBOSCRIBE and SYNTHESIZE (Algorithms 1 and 2): refine the abstraction until a program solves the task."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from roboscribe.best_first import Line, Search, possible_program
from roboscribe.classifier import Refinement
from roboscribe.dsl.rewrite import conjunction, conjuncts, controllers, free_vars
from roboscribe.dsl.syntax import Program
from roboscribe.errors import Fail
from roboscribe.steps import Abandoned, Limits, Outcome, Removed, Skills, Solution, Steps, pure_steps
from roboscribe.subtask_tree import ROOT, Node, Tree
from roboscribe.world.layout import FloatArray

__all__ = ["Limits", "Outcome", "Solution", "Steps", "pure_steps", "roboscribe", "shortest", "synthesize"]


def roboscribe(steps: Steps[Skills], skills: Skills, limits: Limits) -> Solution[Skills] | Fail:
    """Synthesize a program that solves the task.

    Args:
        steps: the pieces of Algorithm 2, bound to world and demonstrations.
        skills: no controllers, in whatever form `steps.train` wants them.
        limits: accuracy asked and effort allowed.

    Returns:
        The solution, after the budget the best program found, or Fail with the reason.

    Source:  Algorithm 1.
    Departs: no choice of a subgoal is final. Algorithm 2 is run again with another choice, the likeliest first, until a
        program is good enough or the budget is spent; what was done once is remembered. A subgoal that most failing
        episodes were stuck at asks for less where a program is better with that. Controllers of a promising
        program that were still getting better are trained on before it is refined; before a line gives up all that it
        stands on, or when it hardly fails any more, they are trained once more.
        At the end subgoals that do not help are removed.
    """
    search = Search(steps, limits)
    reasons: list[str] = []
    for line in search.lines():
        found = synthesize(ROOT, Tree(), skills, line)
        if isinstance(found, Fail):
            reasons.append(found.reason)
            steps.tell(Abandoned(found.reason))
        else:
            search.keep(found)
    return Fail(reasons[0]) if search.best is None else shortest(search.best, steps, limits)


def synthesize(
    psi: str, tree: Tree, skills: Skills, line: Line[Skills], blind: FloatArray | None = None
) -> Solution[Skills] | Fail:
    """Find a program that reaches ψ, refining the tree where the present one fails.

    Args:
        psi: name of the goal node.
        tree: T.
        skills: controllers trained so far.
        line: the pieces, and which subgoal to take where several are possible.
        blind: N_s of the attempt on ψ_R itself; None before it.

    Returns:
        The solution for ψ with every refinement made on the way, or Fail.

    Source:  Algorithm 2.
    Departs: the goal is explicit; failure carries its reason; controllers trained once are kept. While nothing
        precedes ψ, it is compared with the attempt on ψ_R itself: an attempt on ψ that was cloned reaches most of
        what leads to ψ even where it fails, and would teach muddled predicates. A subgoal that is reached in half of
        the episodes, or in half of a loop's turns, is first taken as it is, and so is one that nothing explains: its
        controllers are improved for ψ_R, and ψ_R decides; the latter are trained on before, and given up where they are
        never reached. What a loop is to bring about for every entity is not attempted before something precedes it, in
        the tree or as another branch of its program: the attempt on ψ_R has shown that it does not come about by
        itself. Where most failing episodes were stuck at an earlier subgoal, that one is refined first: nothing that is
        learned about ψ helps them.
    """
    program = line.generate(psi, tree)
    if blind is not None and _is_bare_loop(psi, tree, program):
        refined = line.refine(blind, tree, psi)
        if not isinstance(refined, Fail):
            return _through(psi, refined, skills, line, blind)
        if line.exhausted:
            return refined
    found = program if isinstance(program, Fail) else line.attempt(program, psi, tree, skills)
    if isinstance(found, Fail):
        return found
    outcome = found.outcome
    likely = line.limits.undecided(outcome) if psi == ROOT else line.is_promising(psi, found)
    if line.limits.met(outcome) or (likely and line.goes_on()):
        return found
    blind = outcome.failures() if blind is None else blind
    refined = _refine(psi, found, line, blind)
    if isinstance(refined, Fail):
        return _unexplained(psi, found, refined, line, tried=likely)
    return _through(psi, refined, found.skills, line, blind)


def _is_bare_loop(psi: str, tree: Tree, program: Program | Fail) -> bool:
    """Tell whether ψ is brought about for every entity, and nothing is known yet that helps."""
    helped = isinstance(program, Program) and len({run.controller for run in controllers(program)}) > 1
    return tree.node(psi).circular and not tree.predecessors(psi) and not helped


def _refine(psi: str, found: Solution[Skills], line: Line[Skills], blind: FloatArray) -> tuple[Refinement, Tree] | Fail:
    """Refine what stands in the way of ψ: an earlier subgoal that most failing episodes were stuck at, else ψ.

    Where few episodes fail that subgoal's controller is to blame, and not what comes before it.
    """
    tree, outcome, earlier = found.tree, found.outcome, found.outcome.stuck_at
    if earlier in {node.name for node in tree.nodes} - {psi} and not line.limits.nearly(outcome):
        failures = outcome.failures(earlier) if tree.predecessors(earlier) else blind
        refined = line.refine(failures, tree, earlier, optional=True)
        if line.exhausted or not isinstance(refined, Fail):
            return refined
    return line.refine(outcome.failures() if tree.predecessors(psi) else blind, tree, psi)


def _unexplained(
    psi: str, found: Solution[Skills], why: Fail, line: Line[Skills], *, tried: bool
) -> Solution[Skills] | Fail:
    """Take a subgoal whose failures nothing explains as it is, unless it is never reached, however often trained.

    It is trained once more, and on as long as that makes it measurably better. One that was `tried` as it is by an
    earlier line is given up.
    """
    failed = Fail(
        f"{psi} is reached in {found.outcome.successes} of {found.outcome.episodes} episodes, and {why.reason}"
    )
    if psi == ROOT or line.exhausted or tried:
        return failed
    better = True
    while better and not line.limits.met(found.outcome):
        again = line.attempt(found.program, psi, found.tree, found.skills)
        if isinstance(again, Fail):
            return found
        better = again.outcome.interval[0] > found.outcome.interval[1]
        found = again if again.rate >= found.rate else found
    return found if found.outcome.successes else failed


def _through(
    psi: str, refined: tuple[Refinement, Tree], skills: Skills, line: Line[Skills], blind: FloatArray
) -> Solution[Skills] | Fail:
    """Reach the new subgoal, what it leads to, then ψ; Algorithm 2, lines 12 and 13."""
    refinement, tree = refined
    reached = synthesize(refinement.node.name, tree, skills, line, blind)
    refinements: tuple[Refinement, ...] = (refinement,)
    for goal in dict.fromkeys((refinement.psi, psi)):
        if isinstance(reached, Fail):
            return reached
        refinements = (*refinements, *reached.refinements)
        reached = synthesize(goal, reached.tree, reached.skills, line, blind)
    return reached if isinstance(reached, Fail) else replace(reached, refinements=(*refinements, *reached.refinements))


def shortest(found: Solution[Skills], steps: Steps[Skills], limits: Limits) -> Solution[Skills]:
    """Take out, one after the other, the subgoals and atoms without which the program succeeds as often.

    Departs: the paper keeps every subgoal. What was learned early may have been overtaken by what was learned later.
    """
    if not limits.undecided(found.outcome):
        return found  # chance decides about a bad program
    while (less := _less(found, steps, limits)) is not None:
        found = less
    return found


def _less(found: Solution[Skills], steps: Steps[Skills], limits: Limits) -> Solution[Skills] | None:
    """Take one subgoal or atom out, the latest that is not needed; what it was needed for may be next."""
    least = min(limits.success, found.rate)
    for node in reversed(found.tree.nodes[2:]):
        others = [other.predicate for other in found.tree.nodes if other.name != node.name]
        for shorter, what in _shorter(node):
            if shorter is not None and shorter.predicate in others:
                continue  # that is reached already: the controller would act on, and the program not say until when
            tree = found.tree.without(node.name) if shorter is None else found.tree.replacing(shorter)
            possible = possible_program(tree, steps) if len(tree.nodes) > 2 else Fail("nothing would be left")
            if isinstance(possible, Fail):
                continue
            if steps.check is not None and steps.check(possible.program, ROOT, found.skills).rate < least:
                continue
            outcome = steps.roll_out(possible.program, ROOT, found.skills)
            if outcome.rate >= least:
                steps.tell(Removed(what, outcome.rate))
                removed = (*found.removed, what)
                return replace(found, program=possible.program, tree=tree, outcome=outcome, removed=removed)
    return None


def _shorter(node: Node) -> Iterator[tuple[Node | None, str]]:
    """Yield what might do in the place of a node, and what is missing then: nothing at all, or all atoms but one."""
    yield None, node.name
    atoms = conjuncts(node.predicate)
    for atom in atoms if len(atoms) > 1 else ():
        rest = conjunction([a for a in atoms if a is not atom])
        if free_vars(rest) == free_vars(node.predicate):
            yield replace(node, predicate=rest), str(atom)
