"""Where a branch is left: the thresholds of subgoals that come last in some demonstrations and not in others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roboscribe.dsl.rewrite import uses_robot
from roboscribe.dsl.semantics import evaluate
from roboscribe.dsl.syntax import Const, Greater, Less, Norm
from roboscribe.evidence import Crossings, Evidence
from roboscribe.search.recurring import ARRIVING
from roboscribe.search.thresholds import bound, usual_range
from roboscribe.subtask_tree import Node
from roboscribe.world.trajectory import AGREEMENT, last_false


def left_behind(node: Node, crossings: Crossings, evidence: Evidence) -> Node:
    """Return a branch's node with the threshold at which demonstrations leave it for another branch.

    Args:
        node: φ, one of the branches that lead to ψ.
        crossings: into ψ.
        evidence: demonstrations.

    Returns:
        The node as it is where φ is no bound on one number of the world, or where it comes last, or before others,
        whenever ψ is reached.

    Departs: ψ holds as soon as the last of its branches is good enough, so whichever comes last stands at the very edge
        of what will do, and a threshold that fits all demonstrations is that loose. A program that turns to another
        branch there leaves its block half placed.
    """
    phi = node.predicate
    if node.circular or uses_robot(phi) or not isinstance(phi, Less | Greater) or not isinstance(phi.right, Const):
        return node
    if not len(crossings.starts):
        return node
    sign = 1.0 if isinstance(phi, Less) else -1.0
    values = sign * evaluate(phi.left, crossings.frames, {}, evidence.layout)[..., 0]
    last = crossings.starts + crossings.lengths - 1
    undone = last_false(values < sign * phi.right.value, crossings.starts)
    left = (undone < 0) | (undone + 1 < crossings.lengths - 1 - ARRIVING)
    if not 1.0 - AGREEMENT < float(np.mean(left)) < AGREEMENT:
        return node
    pos, at_first = values[last[left]], values[crossings.starts]
    within = phi.left.of if isinstance(phi.left, Norm) and sign > 0 else None
    numbers = 0 if within is None else evaluate(within, crossings.frames[:1], {}, evidence.layout).shape[-1]
    threshold, _ = bound(pos, at_first, float(np.std(values)), usual_range(values, numbers), numbers=numbers)
    sharper = sign * min(threshold, sign * phi.right.value)
    return replace(node, predicate=type(phi)(phi.left, Const(sharper)))
