"""Subgoals that ask for more than is needed: thresholds that failing episodes come close to and never pass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.rewrite import conjunction, conjuncts
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import Atom, Const, Greater, Less, Predicate
from roboscribe.search.thresholds import beyond
from roboscribe.steps import Outcome
from roboscribe.subtask_tree import Node, Tree
from roboscribe.world.layout import FloatArray, Layout

ADMITTED = (0.5, 0.9)
"""Shares of the episodes that were stuck at a subgoal which a looser one is to let pass."""
ENOUGH = 3
"""Episodes that have to be stuck, for one or two say nothing of what others come close to."""


def looser(outcome: Outcome, tree: Tree, layout: Layout) -> Iterator[tuple[Node, Tree]]:
    """Yield trees in which the subgoal that most failing episodes were stuck at is looser, and that subgoal.

    A threshold lies just beyond what was demonstrated. A robot that is less precise than its demonstrators may do what
    they did without ever passing it: a cube that is held at its edge is held.

    Args:
        outcome: its failing episodes tell how near to the subgoal they came.
        tree: T.
        layout: meaning of their states.
    """
    found = next((node for node in tree.nodes if node.name == outcome.stuck_at), None)
    stuck = [each.states for each in outcome.lost if each.unreached == outcome.stuck_at and len(each.states) >= CONFIRM]
    if found is None or len(stuck) < ENOUGH:
        return
    atoms = conjuncts(found.predicate)
    for atom in atoms:
        others = conjunction([each for each in atoms if each is not atom])
        for wider in _wider(atom, others, stuck, layout):
            node = replace(found, predicate=conjunction([wider if each is atom else each for each in atoms]))
            yield node, tree.replacing(node)


def _wider(atom: Predicate, others: Predicate, stuck: list[FloatArray], layout: Layout) -> Iterator[Atom]:
    """Yield an atom with thresholds that let more and more of the episodes pass, as far as the `others` hold there."""
    match atom:
        case Less(left, Const(bound)):
            sign = 1.0
        case Greater(left, Const(bound)):
            sign = -1.0
        case _:
            return
    nearest = []
    for states in stuck:
        value = sign * evaluate(left, states, {}, layout)[..., 0]
        value = np.where(holds(others, states, {}, layout) & np.isfinite(value), value, np.inf)
        nearest.append(float(sliding_window_view(value, CONFIRM).max(axis=1).min()))
    thresholds = [sign * bound]
    for value in np.quantile(nearest, ADMITTED, method="higher").tolist():
        if thresholds[-1] <= value < np.inf:
            thresholds.append(beyond(value, thresholds[-1], abs(value), np.empty(0)))
            yield type(atom)(left, Const(sign * thresholds[-1]))
