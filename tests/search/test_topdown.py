"""TOPDOWNENUM against the meaning of what it returns."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import conjunction, rename
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Predicate, Truth, Var
from roboscribe.search.topdown import (
    Atoms,
    Literal,
    Situations,
    Strictest,
    counts_by_cost,
    enumerate_conjunctions,
    literals,
    strictest_literal,
    top_down_enum,
)
from roboscribe.world.layout import Attribute, BoolArray, FloatArray, IntArray, Layout, ObjectType

COUNT = 3
LAYOUT = Layout(ObjectType("EE", ()), (ObjectType("block", (Attribute("p", ("p",)), Attribute("q", ("q",)))),) * COUNT)
OUTER = (("v↓p < 0.5", 1), ("v↓q < 0.5", 2))
INNER = (("o↓p < 0.5", 1), ("o↓p < v↓p", 2), ("o↓q < v↓q", 2))


def about(predicate: Predicate, states: FloatArray, entities: IntArray) -> BoolArray:
    """Decide a predicate about v in every example."""
    return holds(predicate, states, {"v": entities}, LAYOUT)


def atoms(states: FloatArray, entities: IntArray) -> Atoms:
    """Tabulate the atoms on examples."""
    outer = [(parse_predicate(text), cost) for text, cost in OUTER]
    inner = [(parse_predicate(text), cost) for text, cost in INNER]
    others = [np.stack([holds(p, states, {"v": entities, "o": o}, LAYOUT) for o in range(COUNT)]) for p, _ in inner]
    return Atoms(
        tuple(Literal(p, cost, about(p, states, entities)) for p, cost in outer),
        tuple(Literal(p, cost, truth) for (p, cost), truth in zip(inner, others, strict=True)),
        Var("o"),
        "block",
    )


def examples(rng: np.random.Generator, count: int) -> tuple[FloatArray, IntArray]:
    """Draw states and the entity that each is about."""
    return rng.uniform(0.0, 1.0, (count, LAYOUT.size)), rng.integers(COUNT, size=count)


PLANTED = [
    "v↓p < 0.5",
    "¬(v↓q < 0.5)",
    "¬(v↓p < 0.5) ∧ ¬∃o:block. o↓q < v↓q ∧ ¬(o↓p < 0.5)",
    "∃o:block. o↓p < v↓p ∧ o↓q < v↓q",
    "v↓p < 0.5 ∧ v↓q < 0.5 ∧ ∃o:block. o↓p < v↓p",
]


@pytest.mark.parametrize("text", PLANTED)
def test_a_planted_predicate_is_found_up_to_meaning(text: str) -> None:
    rng = np.random.default_rng(0)
    states, entities = examples(rng, 600)
    truth = parse_predicate(text)
    found = top_down_enum(atoms(states, entities), about(truth, states, entities), 0.0)
    assert found is not None
    fresh, others = examples(rng, 2000)
    assert np.mean(about(found, fresh, others) == about(truth, fresh, others)) > 0.99


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_every_table_is_what_the_semantics_say(seed: int) -> None:
    states, entities = examples(np.random.default_rng(seed), 40)
    for literal in literals(atoms(states, entities)):
        assert np.array_equal(literal.truth, about(literal.predicate, states, entities))


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1]))
def test_the_answer_is_the_cheapest_that_brute_force_finds(seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    states, entities = examples(rng, 25)
    positive = about(parse_predicate(PLANTED[seed % len(PLANTED)]), states, entities)
    table = atoms(states, entities)
    costs = brute_force(table, positive, tolerance)
    found = top_down_enum(table, positive, tolerance)
    if found is None:
        assert not costs
    else:
        assert separates(about(found, states, entities), positive, tolerance)
        assert costs[str(found)] == min(costs.values())


def brute_force(table: Atoms, positive: BoolArray, tolerance: float) -> dict[str, int]:
    """Cost of every separating conjunction, one at a time."""
    return {
        str(conjunction([p.predicate for p in chosen])): sum(p.cost for p in chosen)
        for length in (1, 2, 3)
        for chosen in combinations(literals(table), length)
        if separates(np.all([p.truth for p in chosen], axis=0), positive, tolerance)
    }


def separates(truth: BoolArray, positive: BoolArray, tolerance: float) -> bool:
    """Whether at most a share of `tolerance` of either class is wrong."""
    wrong = truth != positive
    return all(wrong[each].sum() <= tolerance * each.sum() for each in (positive, ~positive))


def test_noise_within_the_tolerance_does_not_matter() -> None:
    states, entities = examples(np.random.default_rng(1), 1000)
    positive = about(parse_predicate(PLANTED[2]), states, entities)
    noisy = positive.copy()
    noisy[np.flatnonzero(positive)[::100]] = False
    assert top_down_enum(atoms(states, entities), noisy, 0.0) is None
    found = top_down_enum(atoms(states, entities), noisy, 0.02)
    assert found is not None
    assert np.array_equal(about(found, states, entities), positive)


def test_repeated_examples_change_nothing() -> None:
    states, entities = examples(np.random.default_rng(2), 200)
    positive = about(parse_predicate(PLANTED[3]), states, entities)
    once = top_down_enum(atoms(states, entities), positive, 0.0)
    many = top_down_enum(atoms(np.repeat(states, 5, 0), np.repeat(entities, 5)), np.repeat(positive, 5), 0.0)
    assert once == many


def test_labels_drawn_by_lot_have_no_explanation() -> None:
    rng = np.random.default_rng(3)
    states, entities = examples(rng, 500)
    assert top_down_enum(atoms(states, entities), rng.random(500) < 0.5, 0.02) is None


def test_the_budget_counts_candidates() -> None:
    rng = np.random.default_rng(4)
    states, entities = examples(rng, 300)
    positive = rng.random(300) < 0.5
    table = atoms(states, entities)
    kept = len(literals(table))
    everything = enumerate_conjunctions(table, positive, 1.0)
    assert everything.candidates == kept + kept * (kept - 1) // 2 + kept * (kept - 1) * (kept - 2) // 6
    assert enumerate_conjunctions(table, positive, 1.0, budget=1).candidates == kept


def test_bound_names_do_not_clash_with_the_entity() -> None:
    states, entities = examples(np.random.default_rng(5), 300)
    positive = about(parse_predicate(PLANTED[3]), states, entities)
    found = top_down_enum(atoms(states, entities), positive, 0.0)
    assert found is not None
    renamed = rename(found, {"v": "o"})
    assert np.array_equal(holds(renamed, states, {"o": entities}, LAYOUT), positive)


def test_the_strictest_literal_refuses_no_positive_and_the_most_negatives() -> None:
    rng = np.random.default_rng(0)
    states, entities = examples(rng, 600)
    table = atoms(states, entities)
    truth = parse_predicate("¬∃o:block. o↓q < v↓q ∧ ¬(o↓p < 0.5)")
    fits = about(truth, states, entities)
    positive = fits & (rng.random(600) < 0.7)
    found = strictest_literal(table, positive, 0.0)
    assert np.array_equal(about(found.predicate, states, entities), fits)
    assert found.refused == pytest.approx(np.mean(~fits[~positive]))
    assert strictest_literal(table, np.ones(600, np.bool_), 0.0).refused == 0.0


def test_the_strictest_literal_is_true_of_those_who_were_chosen_however_few_they_are() -> None:
    """What is false wherever a choice is made refuses all who wait there, and explains no choice."""
    at_choices = np.arange(600) < 20
    elsewhere, chosen = Literal(parse_predicate("v↓q > 0.5"), 1, ~at_choices), at_choices & (np.arange(600) % 2 == 0)
    table = Atoms((elsewhere,), (), Var("b'"), "block")
    positive = ~at_choices | chosen
    assert strictest_literal(table, positive, 0.02).predicate == elsewhere.predicate
    assert strictest_literal(table, positive, 0.02, chosen=chosen).refused == 0.0


def test_without_atoms_nothing_is_found() -> None:
    """Entities that are known by flags alone can be told apart by nothing."""
    none = Atoms((), (), Var("b'"), "block")
    assert top_down_enum(none, np.array([True, False, True]), 0.0) is None
    assert strictest_literal(none, np.array([True, False]), 0.0) == Strictest(Truth(), 0.0)


def test_exceptions_have_a_price() -> None:
    """A cheap atom errs on two of forty examples; a dearer one does not."""
    positive = np.arange(40) % 2 == 0
    cheap = positive.copy()
    cheap[[0, 1]] = ~cheap[[0, 1]]
    flag, exact = (parse_predicate(f"b↓{name} > 0") for name in ("x", "y"))
    atoms = Atoms((Literal(flag, 1, cheap), Literal(exact, 2, positive)), (), Var("b'"), "block")
    assert enumerate_conjunctions(atoms, positive, 0.05).best == flag
    assert enumerate_conjunctions(atoms, positive, 0.05, exception_bits=5.0).best == exact


def test_a_predicate_that_is_true_of_nobody_somewhere_is_passed_over() -> None:
    """Both are right about the four that are judged; the cheaper one leaves nobody in the third situation."""
    positive = np.array([True, False, True, False, False, False])
    cheap, dear = np.array([1, 0, 1, 0, 0, 0], np.bool_), np.array([1, 0, 1, 0, 1, 0], np.bool_)
    flag, other = (parse_predicate(f"b↓{name} > 0") for name in ("x", "y"))
    atoms = Atoms((Literal(flag, 1, cheap), Literal(other, 2, dear)), (), Var("b'"), "block")
    situations = Situations(np.array([0, 0, 1, 1, 2, 2]), np.arange(6) < 4, 0.0)
    assert enumerate_conjunctions(atoms, positive, 0.0, situations=situations).best == other
    forgiving = replace(situations, most_empty=0.4)
    assert enumerate_conjunctions(atoms, positive, 0.0, situations=forgiving).best == flag


@pytest.mark.parametrize("costs", [[], [3], [1, 1, 2, 5, 5, 5], [2, 4, 6]])
def test_what_costs_no_more_is_counted_as_if_every_pair_was_listed(costs: list[int]) -> None:
    together = [*costs, *(a + b for a, b in combinations(costs, 2))]
    counts = counts_by_cost(costs)
    assert [counts[min(cost, len(counts) - 1)] for cost in range(15)] == [
        sum(each <= cost for each in together) for cost in range(15)
    ]
