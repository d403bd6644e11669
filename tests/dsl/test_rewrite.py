"""Variables, renaming and normal forms, by hand."""

from __future__ import annotations

from roboscribe.dsl.parser import parse_predicate, parse_program, parse_statement
from roboscribe.dsl.rewrite import (
    alpha_equivalent,
    conjunction,
    conjuncts,
    controllers,
    free_vars,
    negation_normal_form,
    rename,
    run_variables,
    seq,
    size,
    uses_robot,
)
from roboscribe.dsl.syntax import Const, Goal, Less, Proj, Run, Seq, Truth, Var
from tests.dsl.kinematic import AT, HOLD, MU, PICK, PLACE, TOWER, B


def test_free_variables_come_in_order_of_first_occurrence_and_without_bound_ones() -> None:
    assert free_vars(parse_predicate("c↓z < b↓z ∧ ∃d:block. d↓z < g(a)↓z")) == ("c", "b", "a")
    assert free_vars(parse_predicate("(∃b:block. b↓z < 1.0) ∧ b↓z < 2.0")) == ("b",)
    assert free_vars(TOWER) == ()


def test_get_binds_for_what_runs_afterwards_only() -> None:
    late = parse_statement("π_a(b) until true; b := get(λb:block. c ≠ null); π_a(b) until d ≠ null")
    assert free_vars(late) == ("b", "c", "d")
    branches = "if (true) { b := get(λb:block. true) } else { skip }; π_a(b) until true"
    assert free_vars(parse_statement(branches)) == ("b",)


def test_renaming_is_simultaneous_and_never_captures() -> None:
    swapped = rename(parse_predicate("a↓z < b↓z"), {"a": "b", "b": "a"})
    assert swapped == parse_predicate("b↓z < a↓z")
    lower = parse_predicate("∃c:block. c↓z < b↓z")
    assert rename(lower, {"b": "c"}) == parse_predicate("∃c':block. c'↓z < c↓z")
    assert rename(lower, {"c": "x"}) == lower
    twice = parse_predicate("∃c:block. c↓z < b↓z ∧ ∃c':block. c'↓z < c↓z")
    assert alpha_equivalent(rename(twice, {"b": "c"}), parse_predicate("∃x:block. x↓z < c↓z ∧ ∃y:block. y↓z < x↓z"))


def test_renaming_a_statement_follows_its_assignments() -> None:
    body = parse_statement("b := get(λb:block. o↓z < b↓z); π_hold(μ, b) until b↓z < o↓z")
    expected = "b' := get(λb':block. b↓z < b'↓z); π_hold(μ, b') until b'↓z < b↓z"
    assert rename(body, {"o": "b"}) == parse_statement(expected)
    assert rename(Proj(Goal(B), "z"), {"b": "v"}) == Proj(Goal(Var("v")), "z")
    renamed = rename(PICK, {"b": "v"})
    assert isinstance(renamed, Run)
    assert renamed.args == (MU, Var("v"))


def test_negations_move_inwards_and_stop_at_atoms_and_quantifiers() -> None:
    p = parse_predicate("¬(a↓z < 1.0 ∧ ¬(b↓z > 2.0 ∨ ¬∃c:block. ¬¬(c ≠ null)))")
    expected = parse_predicate("¬(a↓z < 1.0) ∨ (b↓z > 2.0 ∨ ¬∃c:block. c ≠ null)")
    assert negation_normal_form(p) == expected
    assert negation_normal_form(parse_predicate("¬(true ∨ ¬ψ_R)")) == parse_predicate("¬true ∧ ψ_R")


def test_conjunctions_come_apart_and_together() -> None:
    parts = (HOLD, AT, Truth())
    assert conjuncts(conjunction(parts)) == (HOLD, AT)
    assert conjunction(()) == Truth()
    assert conjuncts(parse_predicate("a ≠ null ∧ (b ≠ null ∧ (c ≠ null ∨ true))"))[1:] == (
        parse_predicate("b ≠ null"),
        parse_predicate("c ≠ null ∨ true"),
    )


def test_alpha_equivalence_ignores_bound_names_only() -> None:
    assert alpha_equivalent(parse_predicate("∃a:block. a↓z < b↓z"), parse_predicate("∃c:block. c↓z < b↓z"))
    assert not alpha_equivalent(parse_predicate("∃a:block. a↓z < b↓z"), parse_predicate("∃b:block. b↓z < b↓z"))
    assert not alpha_equivalent(parse_predicate("∃a:block. true"), parse_predicate("∃a:drawer. true"))
    crossed = parse_predicate("∃a:block. ∃b:block. a↓z < b↓z"), parse_predicate("∃b:block. ∃a:block. b↓z < a↓z")
    assert alpha_equivalent(*crossed)


def test_sequences_stay_flat_and_single_statements_bare() -> None:
    assert seq(PICK) == PICK
    assert seq(PICK, Seq(), seq(PLACE, PICK)) == Seq((PICK, PLACE, PICK))
    assert seq() == Seq()


def test_controllers_come_in_textual_order() -> None:
    text = "def P(μ : EE): if (true) { π_a() until true } else { π_b() until true }; while (true) { π_a() until ψ_R }"
    assert [run.controller for run in controllers(parse_program(text))] == ["a", "b", "a"]
    assert run_variables(Run("x", (MU, Goal(B), Var("a"), B), Truth())) == ("b", "a")


def test_counts_and_the_robot() -> None:
    assert size(Less(Proj(B, "z"), Const(1.0))) == 4
    assert uses_robot(HOLD)
    assert not uses_robot(AT)
