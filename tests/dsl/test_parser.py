"""Reading both printed forms, ASCII and mistakes."""

from __future__ import annotations

import pytest

from roboscribe.dsl.parser import parse_predicate, parse_program, parse_statement
from roboscribe.dsl.printer import pretty, text
from roboscribe.dsl.syntax import (
    And,
    Const,
    Diff,
    Exists,
    Goal,
    If,
    Less,
    Norm,
    Not,
    NotNull,
    Or,
    Program,
    Proj,
    Robot,
    Run,
    Seq,
    Solved,
    Truth,
    Var,
    While,
)
from roboscribe.errors import ProgramError
from tests.dsl.kinematic import HOLD, MU, PICK, PLACE, TOWER, B, near

ONE_LINE = (
    "def Tower(μ : EE): while ((b := get(λb:block. ¬(‖b↓xyz − g(b)↓xyz‖ < 0.05) ∧ "
    "¬∃b':block. g(b')↓z < g(b)↓z ∧ ¬(‖b'↓xyz − g(b')↓xyz‖ < 0.05))) ≠ null) "
    "{ π_hold(μ, b) until ‖μ↓xyz − b↓xyz‖ < 0.021; π_at(μ, b, g(b)) until ‖b↓xyz − g(b)↓xyz‖ < 0.05 }"
)
PRETTY = """\
def Tower(μ : EE):
  while (b := get(λb:block. ¬at(b) ∧ ¬∃b':block. g(b')↓z < g(b)↓z ∧ ¬at(b'))) ≠ null:
    π_hold(μ, b) until hold(μ, b)
    π_at(μ, b, g(b)) until at(b)
where
  hold(μ, b) ≡ ‖μ↓xyz − b↓xyz‖ < 0.021
  at(b) ≡ ‖b↓xyz − g(b)↓xyz‖ < 0.05
"""
ASCII = r"""
# the same in ASCII, with another layout
def Tower(mu : EE):
    while ((b := get(\b:block. not at(b) and
                     ! exists b':block. g(b').z < g(b).z && ~at(b'))) != null) {
        pi_hold(mu, b) until hold(mu, b);
        pi_at(mu, b, g(b)) until at(b);
    }
where
    at(v) = norm(v.xyz - g(v).xyz) < 5e-2
    hold(mu, x) == ‖mu.xyz - x.xyz‖ < 0.021
"""


def test_the_tower_prints_on_one_line_and_reads_back() -> None:
    assert text(TOWER) == str(TOWER) == ONE_LINE
    assert parse_program(ONE_LINE) == TOWER


def test_the_tower_reads_back_from_pretty_and_from_ascii() -> None:
    assert pretty(TOWER) == PRETTY
    assert parse_program(PRETTY) == TOWER
    assert parse_program(ASCII) == TOWER


def test_precedence() -> None:
    a, b, c = (NotNull(Var(name)) for name in "abc")
    assert parse_predicate("a ≠ null ∨ b ≠ null ∧ ¬c ≠ null") == Or(a, And(b, Not(c)))
    assert parse_predicate("(a ≠ null ∨ b ≠ null) ∧ c ≠ null") == And(Or(a, b), c)
    assert parse_predicate("a ≠ null or b ≠ null || c ≠ null") == Or(Or(a, b), c)
    reaching = parse_predicate("∃a:block. a ≠ null ∧ b ≠ null")
    assert reaching == Exists(Var("a"), "block", And(a, b))
    assert parse_predicate("(∃a:block. a ≠ null) ∧ b ≠ null") == And(Exists(Var("a"), "block", a), b)


def test_terms_nest_to_the_left_and_norms_into_each_other() -> None:
    x, y, z = (Proj(B, name) for name in "xyz")
    assert parse_predicate("b↓x − b↓y − b↓z < -0.5") == Less(Diff(Diff(x, y), z), Const(-0.5))
    assert parse_predicate("(b↓x − (b↓y − b↓z)) < 1e-9") == Less(Diff(x, Diff(y, z)), Const(1e-9))
    assert parse_predicate("‖‖b↓xy‖ − ‖b↓z‖‖ < 1.0") == Less(Norm(Diff(Norm(Proj(B, "xy")), Norm(z))), Const(1.0))


def test_a_variable_may_be_called_g() -> None:
    assert parse_predicate("g(g)↓z < g↓z") == Less(Proj(Goal(Var("g")), "z"), Proj(Var("g"), "z"))


def test_blocks_by_braces_by_colons_and_mixed() -> None:
    run = Run("a", (Robot(),), Solved())
    wanted = If(Truth(), While(Not(Truth()), run), Seq((run, run)))
    one = "if (true) { while (¬true) { π_a(μ) until ψ_R } } else { π_a(μ) until ψ_R; π_a(μ) until ψ_R }"
    assert parse_statement(one) == wanted
    lines = "def P(μ : EE):\n if true:\n    while not true: pi_a(mu) until psi_R\n else: {}\n"
    with pytest.raises(ProgramError, match="line 4, column 8"):
        parse_program(lines)
    mixed = "def P(μ:EE):\n if true:\n  while not true { pi_a(mu) until psi_R }\n else:\n" + "  π_a(μ) until ψ_R\n" * 2
    assert parse_program(mixed) == Program("P", wanted)


def test_sequences_of_none_one_and_many_differ() -> None:
    assert parse_statement("") == parse_statement("skip") == Seq()
    assert parse_statement("while (true) {}") == While(Truth(), Seq())
    one = Program("P", While(Truth(), Seq((While(Truth(), Seq((PICK,))),))))
    assert parse_program(text(one)) == one
    assert parse_program(pretty(one)) == one
    assert parse_statement(f"{PICK}; {PLACE};") == Seq((PICK, PLACE))


def test_definitions_may_use_each_other_in_any_order() -> None:
    found = parse_program(
        "def P(μ : EE): π_a(c) until p(μ, c) where p(μ, x) ≡ ¬q(μ, x); q(μ, b) ≡ ‖μ↓xyz − b↓xyz‖ < 0.021"
    )
    assert found.body == Run("a", (Var("c"),), Not(near(MU, Var("c"), 0.021)))
    lifted = parse_program("def P(μ : EE): π_a(c) until p(c) where p(x) ≡ ∃c:block. c↓z < x↓z")
    assert text(lifted.body) == "π_a(c) until ∃c':block. c'↓z < c↓z", "the bound variable gives way"
    held = parse_program("def P(μ : EE): π_a(b) until h(μ, b) where h(μ, v) ≡ ‖μ↓xyz − v↓xyz‖ < 0.021")
    assert held.body == Run("a", (B,), HOLD)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("def P(μ : EE):\n  π_a(μ) until ‖μ↓xyz‖ < \n", "line 3, column 1: expected a predicate or a term"),
        ("def P(μ : EE):\n  b := get(λc:block. true)", "line 2, column 13: expected 'b'"),
        ("def P(μ : EE):\nskip", "line 2, column 1: expected an indented block"),
        ("def P(μ : EE):\n  skip\n   skip", "line 3, column 4: expected a line that starts in column 3"),
        (
            "def P(μ : EE):\n  while true:\n    skip\n   skip",
            "line 4, column 4: expected a line that starts in column 3",
        ),
        ("def P(v : EE): skip", "line 1, column 7: expected 'μ', found 'v'"),
        ("def while(μ : EE): skip", "line 1, column 5: expected a name for the program, found 'while'"),
        ("def P(μ : EE): π_a(μ until true", "line 1, column 22: expected ','"),
        ("def P(μ : EE): while ((b := get(λb:block. true))) { }", "expected '≠', found '{'"),
        ("def P(μ : EE): π_a() until b↓x", "column 28: expected a predicate, not a term"),
        ("def P(μ : EE): π_a() until true < 1.0", "column 28: expected a term, not a predicate"),
        ("def P(μ : EE): π_a() until 1 < 2 < 3", "column 28: expected a term, not a predicate"),
        ("def P(μ : EE): π_a() until b↓x > b↓y", "column 34: expected a number on the right of '>'"),
        ("def P(μ : EE): π_a() until b↓x < 1e999", "column 34: expected a number that fits"),
        ("def P(μ : EE): π_a() until near(b)", "column 28: 'near' is defined nowhere"),
        ("def P(μ : EE): π_a() until p(b) where p(μ) ≡ true", "takes the arguments .μ."),
        ("def P(μ : EE): π_a() until p(b) where p(b) ≡ c ≠ null", "include all that is used: c"),
        ("def P(μ : EE): π_a() until p(b) where p(b) ≡ p(b)", "'p' is defined by itself: p → p"),
        ("def P(μ : EE): skip where p() ≡ true p() ≡ true", "column 38: 'p' is defined twice"),
        ("def P(μ : EE): skip skip", "column 21: expected the end of the text, found 'skip'"),
        ("def P(μ : EE): skip @", "column 21: unexpected character '@'"),
    ],
)
def test_mistakes_are_shown_where_they_are(source: str, message: str) -> None:
    with pytest.raises(ProgramError, match=message) as caught:
        parse_program(source)
    assert str(caught.value).splitlines()[-1].strip() == "^"


def test_the_caret_stands_under_the_place() -> None:
    with pytest.raises(ProgramError) as caught:
        parse_predicate("b↓z << 1.0")
    _, line, caret = str(caught.value).splitlines()
    assert line[caret.index("^")] == "<"
    assert caret.index("^") == line.index("<<") + 1
