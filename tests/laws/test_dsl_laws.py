"""Laws of the language, over generated predicates, programs and states."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from roboscribe.dsl.interpreter import Machine
from roboscribe.dsl.parser import parse_predicate, parse_program, parse_statement
from roboscribe.dsl.printer import pretty, text
from roboscribe.dsl.rewrite import (
    Node,
    alpha_equivalent,
    conjunction,
    conjuncts,
    free_vars,
    negation_normal_form,
    rename,
    walk,
)
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import (
    And,
    Arctan2,
    Const,
    Diff,
    Exists,
    Get,
    Goal,
    Greater,
    If,
    Less,
    Norm,
    Not,
    NotNull,
    Object,
    Or,
    Predicate,
    Program,
    Proj,
    Robot,
    Run,
    Seq,
    Solved,
    Statement,
    Term,
    Truth,
    Var,
    While,
)
from roboscribe.dsl.types import check_predicate
from roboscribe.world import Attribute, Layout, ObjectType
from roboscribe.world.layout import NULL

POSITION = Attribute("position", ("x", "y", "z"))
ANGLE = Attribute("angle", ("angle",), "rad")
LAYOUT = Layout(
    ObjectType("gripper", (POSITION, Attribute("opening", ("opening",)))),
    (ObjectType("block", (POSITION, ANGLE), (POSITION, ANGLE)),) * 3,
)
STATES = np.random.default_rng(5).normal(size=(40, LAYOUT.size)) * 2

names = st.sampled_from(["b", "b'", "c", "g", "π_x", "block_1"])
variables = names.map(Var)
constants = st.floats(allow_nan=False, allow_infinity=False).map(Const)
objects: SearchStrategy[Object] = st.one_of(st.just(Robot()), variables, variables.map(Goal))
fields = st.sampled_from(["x", "xy", "xyz", "position", "opening", "g"])

# Any tree that the grammar allows, well typed or not: what printing and parsing must keep.
terms: SearchStrategy[Term] = st.recursive(
    st.one_of(constants, st.builds(Proj, objects, fields)),
    lambda inner: st.one_of(st.builds(Diff, inner, inner), inner.map(Norm), inner.map(Arctan2)),
    max_leaves=4,
)


def combined(inner: SearchStrategy[Predicate]) -> SearchStrategy[Predicate]:
    """Connect predicates in every way."""
    quantified = st.builds(Exists, variables, st.just("block"), inner)
    return st.one_of(inner.map(Not), st.builds(And, inner, inner), st.builds(Or, inner, inner), quantified)


leaves: SearchStrategy[Predicate] = st.one_of(
    st.just(Truth()),
    st.just(Solved()),
    variables.map(NotNull),
    st.builds(Less, terms, terms),
    st.builds(Greater, terms, constants),
)
# Every quantifier is over few leaves, so that none exceeds the parser's limit on quantifiers inside each other.
predicates = st.recursive(leaves, combined, max_leaves=6).filter(
    lambda p: sum(isinstance(part, Exists) for part in walk(p)) <= 4
)
runs = st.builds(
    Run, st.sampled_from(["hold", "at", "g", "while"]), st.lists(objects, max_size=3).map(tuple), predicates
)
gets = st.builds(Get, variables, st.just("block"), predicates)


def compound(inner: SearchStrategy[Statement]) -> SearchStrategy[Statement]:
    """Nest statements in every way; sequences stay flat."""
    flat = st.lists(inner.filter(lambda s: not isinstance(s, Seq)), max_size=3).map(lambda parts: Seq(tuple(parts)))
    guards: SearchStrategy[Get | Predicate] = st.one_of(gets, predicates)
    return st.one_of(flat, st.builds(While, guards, inner), st.builds(If, predicates, inner, inner))


statements: SearchStrategy[Statement] = st.recursive(st.one_of(runs, gets, st.just(Seq())), compound, max_leaves=5)
programs = st.builds(Program, st.sampled_from(["Tower", "P_1"]), statements)


# Well-typed predicates over the free variables b and c: what has a meaning.
@st.composite
def scalars(draw: st.DrawFn, scope: tuple[str, ...]) -> Term:
    """Give a number that depends on the state."""
    places = st.one_of(
        st.just(Robot()), st.sampled_from(scope).map(Var), st.sampled_from(scope).map(lambda v: Goal(Var(v)))
    )
    entities = st.one_of(st.sampled_from(scope).map(Var), st.sampled_from(scope).map(lambda v: Goal(Var(v))))
    left, right = draw(places), draw(places)
    kind = draw(st.sampled_from(["component", "difference", "distance", "heading", "angle"]))
    if kind == "component":
        return Proj(left, draw(st.sampled_from("xyz")))
    if kind == "difference":
        return Diff(Proj(left, "z"), Proj(right, "z"))
    if kind == "distance":
        field = draw(st.sampled_from(["xyz", "xy", "xz"]))
        return Norm(Diff(Proj(left, field), Proj(right, field)))
    if kind == "heading":
        return Diff(Arctan2(Diff(Proj(left, "xy"), Proj(right, "xy"))), Proj(draw(entities), "angle"))
    return Norm(Diff(Proj(draw(entities), "angle"), Proj(draw(entities), "angle")))


@st.composite
def meaningful(draw: st.DrawFn, scope: tuple[str, ...] = ("b", "c"), depth: int = 3) -> Predicate:
    """Draw a well-typed predicate over the variables in scope."""
    small = st.floats(-3, 3).map(Const)
    kind = draw(
        st.sampled_from(["less", "greater", "null", "not", "and", "or", "exists"] if depth else ["less", "greater"])
    )
    inner = meaningful(scope, depth - 1) if depth else st.nothing()
    match kind:
        case "less":
            return Less(draw(scalars(scope)), draw(small))
        case "greater":
            return Greater(draw(scalars(scope)), draw(small))
        case "null":
            return NotNull(Var(draw(st.sampled_from(scope))))
        case "not":
            return Not(draw(inner))
        case "and":
            return And(draw(inner), draw(inner))
        case "or":
            return Or(draw(inner), draw(inner))
        case _:
            name = draw(st.sampled_from(["b", "d", "d'"]))
            return Exists(Var(name), "block", draw(meaningful((*scope, name), min(depth - 1, 1))))


bindings = st.fixed_dictionaries({name: st.integers(NULL, 2) for name in ("b", "c")})


@given(predicates)
@settings(deadline=None)
def test_what_prints_of_a_predicate_is_what_is_read(p: Predicate) -> None:
    assert parse_predicate(text(p)) == p


@given(statements)
@settings(deadline=None)
def test_what_prints_of_a_statement_is_what_is_read(s: Statement) -> None:
    assert parse_statement(str(s)) == s


@given(programs)
@settings(deadline=None)
def test_both_printed_forms_of_a_program_are_read_back(p: Program) -> None:
    assert parse_program(text(p)) == p
    assert parse_program(pretty(p)) == p
    assert "\n" not in text(p)


@given(st.one_of(predicates, statements, programs))
@settings(deadline=None)
def test_ascii_spellings_read_the_same(node: Node) -> None:
    table = {"μ": "mu", "λ": "\\", "∃": "exists ", "∧": "and", "∨": "or", "¬": "not ", "≠": "!=", "−": "-", "↓": "."}
    plain = text(node)
    for symbol, ascii_spelling in table.items():
        plain = plain.replace(symbol, ascii_spelling)
    statement = isinstance(node, Seq | While | If | Get | Run)
    read: Callable[[str], Node] = parse_statement if statement else parse_predicate
    read = parse_program if isinstance(node, Program) else read
    assert read(plain.replace("π_", "pi_").replace("pi_x", "π_x").replace("ψ_R", "psi_R")) == node


@given(meaningful(), bindings)
@settings(deadline=None)
def test_generated_predicates_type_check_and_negation_normal_form_keeps_meaning(
    p: Predicate, binding: dict[str, int]
) -> None:
    check_predicate(p, LAYOUT, {"b": "block", "c": "block"})
    normal = negation_normal_form(p)
    assert np.array_equal(holds(p, STATES, binding, LAYOUT), holds(normal, STATES, binding, LAYOUT))
    negated = [part.of for part in walk(normal) if isinstance(part, Not)]
    assert all(isinstance(of, Less | Greater | NotNull | Exists) for of in negated)


@given(meaningful(), bindings, st.permutations(["b", "c", "d", "d'"]))
@settings(deadline=None)
def test_renaming_free_variables_keeps_meaning(p: Predicate, binding: dict[str, int], order: list[str]) -> None:
    mapping = dict(zip(["b", "c", "d", "d'"], order, strict=True))
    renamed = rename(p, mapping)
    moved = {mapping[name]: entity for name, entity in binding.items()}
    assert np.array_equal(holds(p, STATES, binding, LAYOUT), holds(renamed, STATES, moved, LAYOUT))
    assert free_vars(renamed) == tuple(mapping[name] for name in free_vars(p))
    back = rename(renamed, {new: old for old, new in mapping.items()})
    assert alpha_equivalent(back, p)


@given(meaningful(), bindings)
@settings(deadline=None)
def test_conjuncts_together_mean_the_whole(p: Predicate, binding: dict[str, int]) -> None:
    joined = conjunction(conjuncts(p))
    assert np.array_equal(holds(p, STATES, binding, LAYOUT), holds(joined, STATES, binding, LAYOUT))


@given(meaningful(), st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_a_batch_is_decided_as_its_rows_one_by_one(p: Predicate, seed: int) -> None:
    rng = np.random.default_rng(seed)
    binding = {name: rng.integers(NULL, 3, size=len(STATES)) for name in ("b", "c")}
    together = holds(p, STATES, binding, LAYOUT)
    alone = [
        bool(holds(p, state, {name: int(entities[row]) for name, entities in binding.items()}, LAYOUT))
        for row, state in enumerate(STATES)
    ]
    assert together.tolist() == alone
    folded = {name: entities.reshape(8, 5) for name, entities in binding.items()}
    assert np.array_equal(holds(p, STATES.reshape(8, 5, -1), folded, LAYOUT).ravel(), together)


@st.composite
def runnable(draw: st.DrawFn) -> Program:
    """Draw a well-typed program with a loop, a branch and straight-line code."""
    where, test, guard = (draw(meaningful(("b",), 2)) for _ in range(3))
    untils = [draw(meaningful(("b",), 1)) for _ in range(3)]
    acts = [Run(f"r{rank}", (Robot(), Var("b")), until) for rank, until in enumerate(untils)]
    loop = While(Get(Var("b"), "block", guard), Seq((acts[0], If(test, acts[1], Seq()))))
    return Program("P", Seq((Get(Var("b"), "block", where), loop, acts[2])))


@given(runnable(), st.integers(1, 3), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_a_batch_of_rows_runs_as_one_by_one(program: Program, confirm: int, seed: int) -> None:
    limits = {"r0": 2, "r1": 3}
    rng = np.random.default_rng(seed)
    walks = np.cumsum(rng.normal(size=(6, 5, LAYOUT.size)), axis=0)
    together = Machine(program, LAYOUT, 5, limits=limits, confirm=confirm)
    alone = [Machine(program, LAYOUT, 1, limits=limits, confirm=confirm) for _ in range(5)]
    for states in walks:
        order = rng.permutation(5)
        together.advance(order, states[order])
        for row, machine in enumerate(alone):
            machine.advance(np.zeros(1, dtype=np.int64), states[row : row + 1])
        for name in ("run_index", "ended", "stuck", "visit"):
            assert getattr(together, name).tolist() == [getattr(machine, name)[0] for machine in alone]
        assert together.entities(np.arange(5)).tolist() == [
            machine.entities(np.zeros(1, dtype=np.int64))[0].tolist() for machine in alone
        ]
        assert together.bound == [machine.bound[0] for machine in alone]
