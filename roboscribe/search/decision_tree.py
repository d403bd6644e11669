"""Decision tree learning (Sec. 4.2.1) for Boolean combinations larger than two atoms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from roboscribe.dsl.rewrite import conjunction
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Or, Predicate
from roboscribe.search.candidates import Candidate, Judged, Samples, judge
from roboscribe.search.features import Feature
from roboscribe.world.layout import FloatArray

if TYPE_CHECKING:
    from sklearn.tree import DecisionTreeClassifier

DEPTH = 3
"""Deepest path: more than three atoms in a row explain nothing to a reader."""


@dataclass(frozen=True)
class _Decision:
    """One side of an inner node."""

    feature: Feature
    predicate: Predicate


_Path: TypeAlias = tuple[_Decision, ...]


def learn_decision_tree(features: Sequence[Feature], samples: Samples) -> tuple[Candidate, ...]:
    """Fit a decision tree and read its positive leaves as a disjunction of conjunctions.

    Args:
        features: scalar expressions on offer.
        samples: positives, negatives and demonstrations.

    Returns:
        One candidate, or none when the tree has no positive leaf.

    Source: LEARNDECISIONTREE in Algorithm 3, line 6.
    """
    from sklearn.tree import DecisionTreeClassifier  # takes a second to import and is hardly ever needed

    states = np.concatenate([samples.before, samples.negatives])
    usable, columns = _finite(features, states, samples)
    if not usable:
        return ()
    labels = np.arange(len(states)) < len(samples.before)
    tree = DecisionTreeClassifier(max_depth=DEPTH, class_weight="balanced", random_state=0).fit(columns, labels)
    leaves = list(_positive_leaves(tree, usable, 0, ()))
    if not leaves or leaves == [()]:
        return ()
    return (_candidate(leaves, states, samples),)


def _finite(features: Sequence[Feature], states: FloatArray, samples: Samples) -> tuple[list[Feature], FloatArray]:
    kept, columns = [], []
    for feature in features:
        values = feature.values(states, samples.layout)
        if np.isfinite(values).all():
            kept.append(feature)
            columns.append(values)
    return kept, np.stack(columns, axis=1) if columns else np.empty((len(states), 0))


def _positive_leaves(
    tree: DecisionTreeClassifier, features: Sequence[Feature], at: int, path: _Path
) -> Iterator[_Path]:
    nodes = tree.tree_
    if nodes.children_left[at] == nodes.children_right[at]:
        if bool(tree.classes_[nodes.value[at][0].argmax()]):
            yield path
        return
    feature = features[nodes.feature[at]]
    threshold = float(f"{nodes.threshold[at]:.4g}")
    below, above = _Decision(feature, feature.below(threshold)), _Decision(feature, feature.above(threshold))
    yield from _positive_leaves(tree, features, nodes.children_left[at], (*path, below))
    yield from _positive_leaves(tree, features, nodes.children_right[at], (*path, above))


def _candidate(leaves: Sequence[_Path], states: FloatArray, samples: Samples) -> Candidate:
    predicate = reduce(Or, [conjunction([decision.predicate for decision in leaf]) for leaf in leaves])
    features = [decision.feature for leaf in leaves for decision in leaf]
    spreads = {str(f.term): float(f"{np.std(f.values(states, samples.layout)):.4g}") for f in features}
    negatives = holds(predicate, samples.negatives, {}, samples.layout)
    frames = holds(predicate, samples.frames, {}, samples.layout)
    seen = np.concatenate([negatives, frames])
    said = float(-np.log2(max(seen.mean(), 1 / len(seen))))
    return judge(Judged(predicate, features, negatives, frames, 0.0, tuple(spreads.items()), said), samples)
