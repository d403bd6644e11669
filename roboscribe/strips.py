"""Where a predicate holds along the demonstrations: what a report draws as one strip per demonstration."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from roboscribe.dsl.rewrite import free_vars, rename
from roboscribe.evidence import Evidence
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.world.layout import IntArray
from roboscribe.world.trajectory import NEVER


@dataclass(frozen=True)
class Strip:
    """One demonstration.

    Args:
        frames: its length.
        spans: first frame, frame after the last one, and of how many entities the predicate holds in between.
        goal: frame at which the goal is first reached; -1 where it never is.
    """

    frames: int
    spans: tuple[tuple[int, int, int], ...]
    goal: int


@dataclass(frozen=True)
class Strips:
    """A predicate along all demonstrations.

    Args:
        frequency: frames per second.
        most: of how many entities it can hold at once.
        rows: the demonstrations.
    """

    frequency: float
    most: int
    rows: tuple[Strip, ...]


def strips(name: str, psi: str, tree: Tree, evidence: Evidence, frequency: float) -> Strips:
    """See where a subgoal holds along the demonstrations; what a loop serves is counted over all of its type.

    Args:
        name: of the subgoal's node.
        psi: name of the goal to which it leads.
        tree: with both of them.
        evidence: the demonstrations.
        frequency: frames per second.
    """
    predicate, loop = tree.node(name).predicate, tree.loop_around(name)
    looped = loop is not None and loop.role in free_vars(predicate)
    members = evidence.layout.of_type(evidence.types[loop.role]) if loop is not None and looped else (-1,)
    names = [{loop.role: evidence.layout.names[entity]} if loop is not None and looped else {} for entity in members]
    counts = np.sum([evidence.truth(rename(predicate, mapping)) for mapping in names], axis=0)
    goal = tree.node(psi)
    reached = evidence.solved_at if psi == ROOT else evidence.first_steps(goal.completed(evidence.types))
    parts = np.split(counts.astype(np.int64), evidence.starts[1:])
    rows = tuple(Strip(len(p), spans(p), -1 if r == NEVER else int(r)) for p, r in zip(parts, reached, strict=True))
    return Strips(frequency, len(members), rows)


def spans(counts: IntArray) -> tuple[tuple[int, int, int], ...]:
    """Sum up counts (T,) as (begin, end, count) where they are not zero."""
    changes = np.flatnonzero(np.diff(counts)) + 1
    edges = [0, *changes.tolist(), len(counts)]
    return tuple((begin, end, int(counts[begin])) for begin, end in pairwise(edges) if end > begin and counts[begin])
