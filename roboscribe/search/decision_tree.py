"""Decision tree learning (Sec. 4.2.1) for Boolean combinations larger than two atoms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce

import numpy as np
from sklearn.tree import DecisionTreeClassifier

from roboscribe.dsl.rewrite import conjunction, conjuncts, free_vars, size
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Or, Predicate
from roboscribe.search.features import Feature
from roboscribe.search.predicates import Candidate, Samples, first_true
from roboscribe.world.layout import FloatArray

DEPTH = 3
"""Deepest path: more than three atoms in a row explain nothing to a reader."""


def learn_decision_tree(features: Sequence[Feature], samples: Samples) -> tuple[Candidate, ...]:
    """Fit a decision tree and read its positive leaves as a disjunction of conjunctions.

    Args:
        features: scalar expressions on offer.
        samples: positives, negatives and demonstrations.

    Returns:
        One candidate, or none when the tree has no positive leaf.

    Source: LEARNDECISIONTREE in Algorithm 3, line 6.
    """
    states = np.concatenate([samples.positives, samples.negatives])
    usable, columns = _finite(features, states, samples)
    if not usable:
        return ()
    labels = np.arange(len(states)) < len(samples.positives)
    tree = DecisionTreeClassifier(max_depth=DEPTH, class_weight="balanced", random_state=0).fit(columns, labels)
    leaves = list(_positive_leaves(tree, usable, 0, ()))
    if not leaves or leaves == [()]:
        return ()
    predicate = reduce(Or, [conjunction(leaf) for leaf in leaves])
    return (_judge(predicate, len([p for leaf in leaves for p in leaf]), samples),)


def _finite(features: Sequence[Feature], states: FloatArray, samples: Samples) -> tuple[list[Feature], FloatArray]:
    kept, columns = [], []
    for feature in features:
        values = feature.values(states, samples.layout)
        if np.isfinite(values).all():
            kept.append(feature)
            columns.append(values)
    return kept, np.stack(columns, axis=1) if columns else np.empty((len(states), 0))


def _positive_leaves(
    tree: DecisionTreeClassifier, features: Sequence[Feature], at: int, path: tuple[Predicate, ...]
) -> Iterator[tuple[Predicate, ...]]:
    nodes = tree.tree_
    if nodes.children_left[at] == nodes.children_right[at]:
        if bool(tree.classes_[nodes.value[at][0].argmax()]):
            yield path
        return
    feature = features[nodes.feature[at]]
    threshold = float(f"{nodes.threshold[at]:.4g}")
    yield from _positive_leaves(tree, features, nodes.children_left[at], (*path, feature.below(threshold)))
    yield from _positive_leaves(tree, features, nodes.children_right[at], (*path, feature.above(threshold)))


def _judge(predicate: Predicate, atoms: int, samples: Samples) -> Candidate:
    negatives = holds(predicate, samples.negatives, {}, samples.layout)
    frames = holds(predicate, samples.frames, {}, samples.layout)
    lengths = np.diff(np.append(samples.starts, len(frames)))
    first = first_true(frames, samples.starts)
    after = samples.after.get(frozenset(free_vars(predicate)), np.full(len(first), -1))
    return Candidate(
        predicate=predicate,
        accepted=float(negatives.mean()) if negatives.size else 0.0,
        initial=float(np.mean(first == 0)),
        kept=float(frames.mean()),
        first=float(np.median(first / np.maximum(1, lengths - 1))),
        copy=False,
        relevant=samples.goal_entities <= set(free_vars(predicate)),
        advances=bool(np.mean(first > after) >= 0.95),
        margin=0.0,
        scales=(),
        entities=len(free_vars(predicate)),
        detail=atoms,
        own_goal=False,
        size=size(predicate),
        family=" ".join(str(p) for p in conjuncts(predicate)),
    )
