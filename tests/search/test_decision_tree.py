"""The fallback for formulas that two atoms cannot express."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import conjuncts
from roboscribe.reward import atoms
from roboscribe.search.decision_tree import learn_decision_tree
from tests.search.examples import FEATURES, planted, random_states, samples, truth_of


@pytest.mark.parametrize(
    "text",
    ["b1↓p < 0.5 ∧ b1↓q < 0.5 ∧ b1↓r < 0.5", "b1↓p < 0.4 ∧ b1↓q > 0.5 ∧ b1↓s < 0.6", "b1↓p < 0.2 ∨ b1↓q < 0.2"],
)
def test_a_planted_formula_is_found(text: str) -> None:
    truth = parse_predicate(text)
    rng = np.random.default_rng(0)
    positives, negatives = planted(truth, rng)
    (found,) = learn_decision_tree(FEATURES, samples(positives, negatives))
    fresh = random_states(rng, 4000)
    assert np.mean(truth_of(found.predicate, fresh) == truth_of(truth, fresh)) > 0.98
    assert found.separates
    assert found.informative
    assert set(dict(found.scales)) == {str(atom.left) for atom in atoms(found.predicate)}


def test_three_atoms_are_read_as_one_conjunction() -> None:
    truth = parse_predicate("b1↓p < 0.5 ∧ b1↓q < 0.5 ∧ b1↓r < 0.5")
    positives, negatives = planted(truth, np.random.default_rng(1))
    (found,) = learn_decision_tree(FEATURES, samples(positives, negatives))
    assert len(conjuncts(found.predicate)) == 3


def test_nothing_is_found_where_nothing_differs() -> None:
    states = np.full((50, 5), 0.5)
    assert learn_decision_tree(FEATURES, samples(states[:20], states, episodes=(states,))) == ()
