"""Printing: `text` on one line, `pretty` indented with named predicates; the parser reads both back unchanged."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias, assert_never

from roboscribe.dsl.rewrite import Node, children, controllers, free_vars, rename, size, uses_robot
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

STATEMENT_WORDS = frozenset(["def", "while", "if", "else", "get", "until", "where", "skip"])
TERM_WORDS = frozenset(["null", "mu", "μ", "g", "norm", "arctan2"])
PREDICATE_WORDS = frozenset(["true", "True", "ψ_R", "psi_R", "lambda", "exists", "not", "and", "or"])
RESERVED = STATEMENT_WORDS | TERM_WORDS | PREDICATE_WORDS
"""Words with a meaning of their own, which therefore name no variable and no predicate (`g` may name a variable)."""
Namer: TypeAlias = Callable[[Predicate], str | None]
"""Name of a predicate with its arguments, or None to spell it out."""


def _nameless(_: Predicate) -> str | None:
    return None


def text(node: Node) -> str:
    """Print any node canonically, on one line."""
    match node:
        case Program(name, body):
            return f"def {name}(μ : EE): {_statement(body)}"
        case Seq() | While() | If() | Get() | Run():
            return _statement(node)
        case Robot() | Var() | Goal():
            return _object(node)
        case Proj() | Diff() | Norm() | Arctan2() | Const():
            return _term(node)
        case Less() | Greater() | NotNull() | Not() | And() | Or() | Exists() | Truth() | Solved():
            return _predicate(node, _nameless)
        case _:
            assert_never(node)


def _object(item: Object) -> str:
    match item:
        case Robot():
            return "μ"
        case Var(name):
            return name
        case Goal(of):
            return f"g({of.name})"
        case _:
            assert_never(item)


def _term(term: Term) -> str:
    match term:
        case Proj(of, field):
            return f"{_object(of)}↓{field}"
        case Diff(left, right):
            subtrahend = f"({_term(right)})" if isinstance(right, Diff) else _term(right)
            return f"{_term(left)} − {subtrahend}"
        case Norm(of):
            return f"‖{_term(of)}‖"
        case Arctan2(of):
            return f"arctan2({_term(of)})"
        case Const(value):
            return repr(float(value))
        case _:
            assert_never(term)


def _predicate(p: Predicate, named: Namer, last: bool = True) -> str:
    """Print a predicate.

    Args:
        p: the predicate.
        named: names to use.
        last: nothing follows at this level, so ∃, which reaches as far as it can, needs no parentheses.
    """
    name = named(p)
    if name is not None:
        return name
    match p:
        case Not(of):
            return f"¬{_operand(of, _Level.WHOLE, named, last)}"
        case And(left, right):
            return f"{_operand(left, _Level.AND, named, False)} ∧ {_operand(right, _Level.COMPARED, named, last)}"
        case Or(left, right):
            return f"{_operand(left, _Level.OR, named, False)} ∨ {_operand(right, _Level.AND, named, last)}"
        case Exists(var, kind, body):
            whole = f"∃{var.name}:{kind}. {_predicate(body, named)}"
            return whole if last else f"({whole})"
        case Less() | Greater() | NotNull() | Truth() | Solved():
            return _leaf(p)
        case _:
            assert_never(p)


def _leaf(p: Less | Greater | NotNull | Truth | Solved) -> str:
    match p:
        case Truth():
            return "true"
        case Solved():
            return "ψ_R"
        case Less(left, right):
            return f"{_term(left)} < {_term(right)}"
        case Greater(left, right):
            return f"{_term(left)} > {_term(right)}"
        case NotNull(of):
            return f"{of.name} ≠ null"
        case _:
            assert_never(p)


class _Level(IntEnum):
    """How tightly a predicate holds together; where a tighter one is needed, it takes parentheses."""

    OR = 1
    AND = 2
    COMPARED = 3
    WHOLE = 4


def _level(p: Predicate) -> _Level:
    match p:
        case Or():
            return _Level.OR
        case And():
            return _Level.AND
        case Less() | Greater() | NotNull():
            return _Level.COMPARED
        case Not() | Exists() | Truth() | Solved():
            return _Level.WHOLE
        case _:
            assert_never(p)


def _operand(p: Predicate, needed: _Level, named: Namer, last: bool) -> str:
    """Print an operand, in parentheses where its own operator binds less tightly than needed."""
    if _level(p) < needed and named(p) is None:
        return f"({_predicate(p, named)})"
    return _predicate(p, named, last)


def _get(get: Get, named: Namer) -> str:
    return f"{get.var.name} := get(λ{get.var.name}:{get.type}. {_predicate(get.where, named)})"


def _guard(guard: Get | Predicate, named: Namer) -> str:
    return f"({_get(guard, named)}) ≠ null" if isinstance(guard, Get) else _predicate(guard, named)


def _run(run: Run, named: Namer) -> str:
    return f"π_{run.controller}({', '.join(map(_object, run.args))}) until {_predicate(run.until, named)}"


def _statement(statement: Statement) -> str:
    match statement:
        case Seq(()):
            return "skip"
        case Seq((only,)):
            return f"{_statement(only)};"
        case Seq(parts):
            return "; ".join(map(_statement, parts))
        case Get():
            return _get(statement, _nameless)
        case While(guard, body):
            return f"while ({_guard(guard, _nameless)}) {{ {_statement(body)} }}"
        case If(test, then, otherwise):
            branch = "" if otherwise == Seq() else f" else {{ {_statement(otherwise)} }}"
            return f"if ({_predicate(test, _nameless)}) {{ {_statement(then)} }}{branch}"
        case Run():
            return _run(statement, _nameless)
        case _:
            assert_never(statement)


@dataclass(frozen=True)
class Definition:
    """One line under `where`: name(μ, params) ≡ body."""

    name: str
    params: tuple[str, ...]
    body: Predicate

    def call(self, p: Predicate) -> str | None:
        """Print `p` as a use of this definition; None when it is none."""
        mapping: dict[str, str] = {}
        if not _match(self.body, p, frozenset(), mapping) or rename(self.body, mapping) != p:
            return None
        return self.head([mapping[param] for param in self.params])

    def head(self, args: list[str] | tuple[str, ...]) -> str:
        """Print the name with arguments."""
        return f"{self.name}({', '.join((['μ'] if uses_robot(self.body) else []) + list(args))})"


def _match(pattern: Node, node: Node, bound: frozenset[str], mapping: dict[str, str]) -> bool:
    """Collect which variable of `node` stands for which free variable of `pattern`; False where they cannot agree."""
    if isinstance(pattern, Var) and isinstance(node, Var) and pattern.name not in bound:
        return mapping.setdefault(pattern.name, node.name) == node.name
    if type(pattern) is not type(node):
        return False
    inner = bound | _bound_by(pattern)
    return all(_match(a, b, inner, mapping) for a, b in zip(children(pattern), children(node), strict=True))


def _bound_by(node: Node) -> frozenset[str]:
    """Return the variables that a node binds in its own parts."""
    match node:
        case Exists(var) | Get(var):
            return frozenset([var.name])
        case Robot() | Var() | Goal() | Proj() | Diff() | Norm() | Arctan2() | Const():
            return frozenset()
        case Less() | Greater() | NotNull() | Not() | And() | Or() | Truth() | Solved():
            return frozenset()
        case Seq() | While() | If() | Run() | Program():
            return frozenset()
        case _:
            assert_never(node)


def definitions(program: Program) -> tuple[Definition, ...]:
    """Return what `pretty` defines under `where`: each controller's `until`, once up to renaming of variables.

    true and ψ_R stay as they are. A name that is taken or reserved gets a number.
    """
    found: list[Definition] = []
    for run in controllers(program):
        if not isinstance(run.until, Truth | Solved) and all(known.call(run.until) is None for known in found):
            taken = {known.name for known in found} | RESERVED
            found.append(Definition(_unused(run.controller, taken), free_vars(run.until), run.until))
    return tuple(found)


def _unused(name: str, taken: set[str] | frozenset[str]) -> str:
    candidate, number = name, 2
    while candidate in taken:
        candidate, number = f"{name}_{number}", number + 1
    return candidate


def _namer(known: tuple[Definition, ...]) -> Namer:
    return lambda p: next((call for each in known if (call := each.call(p)) is not None), None)


def pretty(program: Program) -> str:
    """Print a program indented, each learned predicate defined once under `where`."""
    known = definitions(program)
    lines = [f"def {program.name}(μ : EE):", *_indent(_lines(program.body, _namer(known)))]
    if known:
        smaller = {each.name: tuple(k for k in known if size(k.body) < size(each.body)) for each in known}
        bodies = [f"{k.head(k.params)} ≡ {_predicate(k.body, _namer(smaller[k.name]))}" for k in known]
        lines += ["where", *_indent(bodies)]
    return "\n".join(lines) + "\n"


def program_text(program: Program) -> str:
    """Print a program; its text parses back to the same program."""
    return pretty(program).rstrip() + "\n"


def _indent(lines: list[str] | Iterator[str]) -> list[str]:
    return [f"  {line}" for line in lines]


def _lines(statement: Statement, named: Namer) -> list[str]:
    match statement:
        case Seq(()):
            return ["skip"]
        case Seq((only,)):
            lines = _lines(only, named)
            return [f"{lines[0]};"] if isinstance(only, Get | Run) else [*lines, ";"]
        case Seq(parts):
            return [line for part in parts for line in _lines(part, named)]
        case Get():
            return [_get(statement, named)]
        case While(guard, body):
            return [f"while {_guard(guard, named)}:", *_indent(_lines(body, named))]
        case If(test, then, otherwise):
            branch = [] if otherwise == Seq() else ["else:", *_indent(_lines(otherwise, named))]
            return [f"if {_predicate(test, named)}:", *_indent(_lines(then, named)), *branch]
        case Run():
            return [_run(statement, named)]
        case _:
            assert_never(statement)
