"""LEARNCLASSIFIER (Algorithm 3): what must hold before a goal can be reached."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from roboscribe.dsl.rewrite import rename, walk
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import And, Const, Greater, Less, Predicate, Term
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.search.decision_tree import learn_decision_tree
from roboscribe.search.features import enumerate_features
from roboscribe.search.naming import name_predicate
from roboscribe.search.predicates import Anchor, Candidate, Samples, bound, rank_predicates
from roboscribe.subtask_tree import NEVER, Node, Tree
from roboscribe.world.layout import FloatArray, IntArray

REUSE_MISSES = 0.1
"""Share of P_s in which a reused predicate may be false: its threshold was learned from another entity."""
REUSE_ACCEPTS = 0.02
"""Share of N_s on which a reused predicate may be true."""
MOST_NEGATIVES = 6_000
"""Negatives beyond this many are thinned evenly."""


@dataclass(frozen=True)
class Refinement:
    """The outcome of one comparison of demonstrations with failures.

    Args:
        psi: name of the goal that could not be reached.
        node: the subgoal φ; when φ is reused an existing node of the tree, its thresholds perhaps moved.
        reused: whether φ is an existing predecessor that recurs with another entity.
        table: every separating predicate considered, best first (empty when reused).
        positives: count of P_s.
        negatives: count of N_s.
        moved: when φ is reused, further nodes about its entity, with thresholds that fit the other entities, too.
    """

    psi: str
    node: Node
    reused: bool
    table: tuple[Candidate, ...]
    positives: int
    negatives: int
    moved: tuple[Node, ...] = ()


def learn_classifier(negatives: FloatArray, evidence: Evidence, tree: Tree, psi: str) -> Refinement | Fail:
    """Learn a predicate φ that holds just before ψ in the demonstrations and never in failing rollouts.

    Args:
        negatives: (M, F), N_s, all states of all failing rollouts, named by the order in which the program binds.
        evidence: demonstrations, from which P_s is taken.
        tree: T.
        psi: name of the goal ψ.

    Returns:
        The refinement, or Fail when no predicate of the grammar separates the samples.

    Source:  Algorithm 3.
    Departs: the lift of line 2 ranges over entities other than those the program already handles; an exact ranked
        search over single atoms, over what one atom adds to a predecessor, and over pairs comes before the decision
        tree; negatives on which the learned predecessor does not hold are told apart by it already and do not count.
    """
    positives = evidence.states_before(tree.node(psi).predicate)
    if not len(positives):
        return Fail(f"no demonstration reaches {psi}, so there is nothing to compare failures with")
    negatives = negatives[:: len(negatives) // MOST_NEGATIVES + 1]
    reused = _recurring(positives, negatives, evidence, tree, psi)
    if reused is not None:
        moved = _moved(evidence, tree, reused)
        return Refinement(psi, reused, True, (), len(positives), len(negatives), moved)
    features = enumerate_features(evidence.layout, _nameable(evidence, tree, psi))
    samples = _samples(positives, negatives, evidence, tree, psi)
    terms = set(walk(tree.node(psi).predicate))
    copied = frozenset(f.family for f in features if f.term in terms)
    samples = replace(samples, goal_families=copied, goal_entities=frozenset(tree.node(psi).entities))
    table = rank_predicates(features, samples)
    if not table or not table[0].separates:
        table = (*learn_decision_tree(features, samples), *table)
    if not table or not table[0].separates:
        best = f"; the best, {table[0].predicate}, accepts {table[0].accepted:.0%} of the failures" if table else ""
        return Fail(f"no predicate separates the states before {psi} from the failing rollouts{best}")
    best_name = name_predicate(table[0].predicate, {node.name for node in tree.nodes})
    node = Node(best_name, table[0].predicate, scales=dict(table[0].scales))
    return Refinement(psi, node, False, table, len(positives), len(negatives))


def _recurring(positives: FloatArray, negatives: FloatArray, evidence: Evidence, tree: Tree, psi: str) -> Node | None:
    """Line 2: a predecessor of ψ that some unhandled entity of the same type satisfies in P_s and never in N_s.

    Departs: its thresholds, learned from one entity, are moved to where they hold for all those that satisfy it.
    """
    for node in tree.predecessors(psi):
        if len(node.entities) == 1:
            others = [
                other for other in _unhandled(node, evidence) if _recurs(node, other, positives, negatives, evidence)
            ]
            if others:
                return _fitted(node, dict.fromkeys((*node.entities, *others), positives), evidence)
    return None


def _recurs(node: Node, other: str, positives: FloatArray, negatives: FloatArray, evidence: Evidence) -> bool:
    phi = rename(node.predicate, {node.entities[0]: other})
    often = _share(phi, positives, evidence) >= 1 - REUSE_MISSES
    return often and _share(phi, negatives, evidence) <= REUSE_ACCEPTS


def _moved(evidence: Evidence, tree: Tree, reused: Node) -> tuple[Node, ...]:
    """Fit the thresholds of what comes before a recurring φ, learned from one entity, to all of its type.

    P_s of another entity are the states before it satisfies φ.
    """
    (entity,) = reused.entities
    alike = (entity, *_unhandled(reused, evidence))
    before = {name: evidence.states_before(rename(reused.predicate, {entity: name})) for name in alike}
    preceding = (node for node in tree.predecessors(reused.name) if node.entities == (entity,))
    return tuple(_fitted(node, before, evidence) for node in preceding)


def _fitted(node: Node, samples: Mapping[str, FloatArray], evidence: Evidence) -> Node:
    """Move each threshold of φ that is too tight to where it holds, for each entity, on the samples of that entity."""
    (entity,) = node.entities

    def values(term: Term) -> FloatArray:
        found = [evaluate(rename(term, {entity: e}), s, {}, evidence.layout)[..., 0] for e, s in samples.items()]
        return np.concatenate(found)

    return replace(node, predicate=_loosened(node.predicate, values))


def _loosened(phi: Predicate, values: Callable[[Term], FloatArray]) -> Predicate:
    """Move each threshold of a conjunction that some of its term's `values` miss."""
    match phi:
        case And(left, right):
            return And(_loosened(left, values), _loosened(right, values))
        case Less(term, Const(old)) | Greater(term, Const(old)):
            sign = 1.0 if isinstance(phi, Less) else -1.0
            pos = sign * values(term)
            if pos.max() >= sign * old:
                return replace(phi, right=Const(sign * bound(pos, np.empty(0), float(np.std(pos)))[0]))
    return phi


def _unhandled(node: Node, evidence: Evidence) -> list[str]:
    kind = evidence.types[node.entities[0]]
    return [name for name, other in evidence.types.items() if other == kind and name not in node.entities]


def _share(phi: Predicate, states: FloatArray, evidence: Evidence) -> float:
    return float(holds(phi, states, {}, evidence.layout, evidence.solved).mean()) if len(states) else 0.0


def _nameable(evidence: Evidence, tree: Tree, psi: str) -> list[str]:
    """Entities that may be mentioned by name: after a loop over a type, none of that type has a name any more."""
    looped = {evidence.types[e] for node in tree.below(psi) if node.circular for e in _free(node)}
    return [name for name, kind in evidence.types.items() if kind not in looped]


def _free(node: Node) -> tuple[str, ...]:
    return Node(node.name, node.predicate).entities


def _samples(positives: FloatArray, negatives: FloatArray, evidence: Evidence, tree: Tree, psi: str) -> Samples:
    predecessors = tree.predecessors(psi)
    if len(predecessors) == 1:
        phi = predecessors[0].completed(evidence.types)
        reached = holds(phi, negatives, {}, evidence.layout, evidence.solved)
        negatives = negatives[reached] if reached.sum() >= 50 else negatives
    frames, starts = _frames_before(evidence, evidence.first_steps(tree.node(psi).predicate))
    anchors = tuple(Anchor(node.predicate, node.scales) for node in predecessors if node.entities)
    after = _after(evidence, tree, psi)
    return Samples(evidence.layout, positives, negatives, frames, starts, after, anchors=anchors)


def _after(evidence: Evidence, tree: Tree, psi: str) -> dict[frozenset[str], IntArray]:
    kept = _voting(evidence.first_steps(tree.node(psi).predicate))
    return {
        frozenset(node.entities): evidence.first_steps(node.lifted(evidence.types))[kept]
        for node in tree.predecessors(psi)
    }


def _voting(reached: IntArray) -> IntArray:
    """Demonstrations that go from not ψ to ψ."""
    return np.flatnonzero((reached > 0) & (reached < NEVER))


def _frames_before(evidence: Evidence, reached: IntArray) -> tuple[FloatArray, IntArray]:
    """Frames of each demonstration before ψ first holds, and where each demonstration starts in them."""
    kept = _voting(reached)
    parts = [evidence.trajectories[d].states[: reached[d]] for d in kept]
    starts = np.concatenate([[0], np.cumsum(reached[kept])[:-1]]).astype(np.int64)
    return np.concatenate(parts), starts
