"""How long a predicate is, where shorter ones are preferred."""

from __future__ import annotations

from roboscribe.dsl.rewrite import size, walk
from roboscribe.dsl.syntax import Diff, Goal, Predicate, Proj

SIDES = 2
"""Nodes of a difference and of its length, ‖·−·‖, which bounds it on both sides."""


def length(phi: Predicate) -> int:
    """Count the nodes of φ but for those by which something is held against its own goal.

    A task that declares a goal has said them already. And demonstrations that stop at a goal do not show whether
    beyond it would do: nothing stops a controller that is reinforced at a bound on one side alone.
    """
    goals = [node.right for node in walk(phi) if isinstance(node, Diff) and _is_against_own_goal(node)]
    return size(phi) - sum(size(goal) + SIDES for goal in goals)


def _is_against_own_goal(difference: Diff) -> bool:
    match difference:
        case Diff(Proj(of, field), Proj(Goal(owner), attribute)):
            return (of, field) == (owner, attribute)
        case _:
            return False
