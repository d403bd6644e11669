"""Rewriting: variables, renaming, normal forms, lifting, building and taking apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import reduce
from typing import TypeAlias, assert_never, overload

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

Node: TypeAlias = Object | Term | Predicate | Statement | Program
Renaming: TypeAlias = Mapping[str, str]


def children(node: Node) -> tuple[Node, ...]:
    """Return the direct parts of a node, in textual order."""
    match node:
        case Robot() | Var() | Const() | Truth() | Solved():
            return ()
        case Goal(of) | Proj(of) | Norm(of) | Arctan2(of) | NotNull(of) | Not(of):
            return (of,)
        case Diff(left, right) | Less(left, right) | Greater(left, right) | And(left, right) | Or(left, right):
            return (left, right)
        case Exists(var, _, body) | Get(var, _, body):
            return (var, body)
        case While(guard, body):
            return (guard, body)
        case If(test, then, otherwise):
            return (test, then, otherwise)
        case Seq(parts):
            return parts
        case Run(_, args, until):
            return (*args, until)
        case Program(_, body):
            return (body,)
        case _:
            assert_never(node)


def walk(node: Node) -> Iterator[Node]:
    """Yield a node and everything below it, parents first, in textual order; no recursion, so any depth will do."""
    waiting = [node]
    while waiting:
        current = waiting.pop()
        yield current
        waiting.extend(reversed(children(current)))


def size(node: Node) -> int:
    """Count the nodes of a syntax tree."""
    return sum(1 for _ in walk(node))


def depth(node: Node) -> int:
    """Count the nodes on the longest way down a syntax tree; no recursion, so any depth will do."""
    level: list[Node] = [node]
    deep = 0
    while level:
        deep += 1
        level = [child for parent in level for child in children(parent)]
    return deep


def uses_robot(node: Node) -> bool:
    """Tell whether μ occurs."""
    return any(isinstance(part, Robot) for part in walk(node))


def free_vars(node: Node) -> tuple[str, ...]:
    """Return the variables that need a binding from outside, in order of first occurrence.

    ∃ binds in its body; get binds in its predicate and in everything that runs after it.
    """
    found: dict[str, None] = {}
    _free(node, frozenset(), found)
    return tuple(found)


def _free(node: Node, bound: frozenset[str], found: dict[str, None]) -> frozenset[str]:
    """Add the free variables of `node` to `found`; return what is bound after it has run."""
    match node:
        case Var(name):
            if name not in bound:
                found.setdefault(name)
            return bound
        case Exists(var, _, body):
            _free(body, bound | {var.name}, found)
            return bound
        case Get(var, _, where):
            _free(where, bound | {var.name}, found)
            return bound | {var.name}
        case While(guard, body):
            after = _free(guard, bound, found)
            _free(body, after, found)
            return after
        case If(test, then, otherwise):
            _free(test, bound, found)
            return _free(then, bound, found) & _free(otherwise, bound, found)
        case Robot() | Goal() | Proj() | Diff() | Norm() | Arctan2() | Const() | Seq() | Run() | Program():
            pass
        case Less() | Greater() | NotNull() | Not() | And() | Or() | Truth() | Solved():
            pass
        case _:
            assert_never(node)
    for child in children(node):
        bound = _free(child, bound, found)
    return bound


def assigned(node: Statement | Program) -> tuple[str, ...]:
    """Return the variables that some get assigns, in order of first occurrence."""
    return tuple(dict.fromkeys(_assigned(node)))


def _assigned(node: Statement | Program) -> Iterator[str]:
    match node:
        case Get(var):
            yield var.name
        case While(guard, body):
            yield from _assigned(guard) if isinstance(guard, Get) else ()
            yield from _assigned(body)
        case If(_, then, otherwise):
            yield from _assigned(then)
            yield from _assigned(otherwise)
        case Seq(parts):
            for part in parts:
                yield from _assigned(part)
        case Program(_, body):
            yield from _assigned(body)
        case Run():
            pass
        case _:
            assert_never(node)


@overload
def rename(node: Predicate, mapping: Renaming) -> Predicate: ...
@overload
def rename(node: Term, mapping: Renaming) -> Term: ...
@overload
def rename(node: Object, mapping: Renaming) -> Object: ...
@overload
def rename(node: Statement, mapping: Renaming) -> Statement: ...
def rename(node: Predicate | Term | Object | Statement, mapping: Renaming) -> Predicate | Term | Object | Statement:
    """Rename variables, all at once (so names can be swapped), without capture.

    In a predicate the free variables are renamed; a bound one that would capture a new name takes primes. In a
    statement a variable is renamed wherever it is used or assigned; one assigned there that would clash takes primes.
    """
    if isinstance(node, Statement):
        return _rename_statement(node, _avoid(node, mapping))
    if isinstance(node, Object):
        return _rename_object(node, mapping)
    if isinstance(node, Term):
        return _rename_term(node, mapping)
    return _rename_predicate(node, mapping)


def _avoid(statement: Statement, mapping: Renaming) -> Renaming:
    clashing = [name for name in assigned(statement) if name not in mapping and name in mapping.values()]
    taken = {*mapping.values(), *mapping, *assigned(statement), *free_vars(statement)}
    extended = dict(mapping)
    for name in clashing:
        extended[name] = fresh(name, taken)
        taken.add(extended[name])
    return extended


def fresh(name: str, taken: set[str]) -> str:
    """Add primes to a name until it is not taken."""
    while name in taken:
        name += "'"
    return name


def _rename_var(var: Var, mapping: Renaming) -> Var:
    return Var(mapping.get(var.name, var.name))


def _rename_object(item: Object, mapping: Renaming) -> Object:
    match item:
        case Robot():
            return item
        case Var():
            return _rename_var(item, mapping)
        case Goal(of):
            return Goal(_rename_var(of, mapping))
        case _:
            assert_never(item)


def _rename_term(term: Term, mapping: Renaming) -> Term:
    match term:
        case Proj(of, field):
            return Proj(_rename_object(of, mapping), field)
        case Diff(left, right):
            return Diff(_rename_term(left, mapping), _rename_term(right, mapping))
        case Norm(of):
            return Norm(_rename_term(of, mapping))
        case Arctan2(of):
            return Arctan2(_rename_term(of, mapping))
        case Const():
            return term
        case _:
            assert_never(term)


def _rename_predicate(p: Predicate, mapping: Renaming) -> Predicate:
    match p:
        case Truth() | Solved():
            return p
        case Less(left, right):
            return Less(_rename_term(left, mapping), _rename_term(right, mapping))
        case Greater(left, right):
            return Greater(_rename_term(left, mapping), right)
        case NotNull(of):
            return NotNull(_rename_var(of, mapping))
        case Not(of):
            return Not(_rename_predicate(of, mapping))
        case And(left, right):
            return And(_rename_predicate(left, mapping), _rename_predicate(right, mapping))
        case Or(left, right):
            return Or(_rename_predicate(left, mapping), _rename_predicate(right, mapping))
        case Exists(var, kind, body):
            name, inner = _under_binder(var.name, body, mapping)
            return Exists(Var(name), kind, _rename_predicate(body, inner))
        case _:
            assert_never(p)


def _under_binder(name: str, body: Predicate, mapping: Renaming) -> tuple[str, Renaming]:
    """Return the bound variable's new name and the renaming of the body."""
    others = [free for free in free_vars(body) if free != name]
    arriving = {mapping.get(free, free) for free in others}
    kept = {free: mapping[free] for free in others if free in mapping}
    if name not in arriving:
        return name, kept
    new = fresh(name, arriving | set(others))
    return new, {**kept, name: new}


def _rename_statement(statement: Statement, mapping: Renaming) -> Statement:
    match statement:
        case Seq(parts):
            return Seq(tuple(_rename_statement(part, mapping) for part in parts))
        case Get():
            return _rename_get(statement, mapping)
        case While(guard, body):
            test = _rename_get(guard, mapping) if isinstance(guard, Get) else _rename_predicate(guard, mapping)
            return While(test, _rename_statement(body, mapping))
        case If(test, then, otherwise):
            branches = _rename_statement(then, mapping), _rename_statement(otherwise, mapping)
            return If(_rename_predicate(test, mapping), *branches)
        case Run(controller, args, until):
            renamed = tuple(_rename_object(arg, mapping) for arg in args)
            return Run(controller, renamed, _rename_predicate(until, mapping))
        case _:
            assert_never(statement)


def _rename_get(get: Get, mapping: Renaming) -> Get:
    return Get(_rename_var(get.var, mapping), get.type, _rename_predicate(get.where, mapping))


def negation_normal_form(p: Predicate) -> Predicate:
    """Push negations inwards by De Morgan's laws and remove double ones.

    ¬ is left only directly around comparisons, ∃, v ≠ null, ψ_R and true: the grammar has neither ≥ nor ∀.
    """
    match p:
        case And(left, right):
            return And(negation_normal_form(left), negation_normal_form(right))
        case Or(left, right):
            return Or(negation_normal_form(left), negation_normal_form(right))
        case Exists(var, kind, body):
            return Exists(var, kind, negation_normal_form(body))
        case Not(of):
            return _negated(of)
        case Less() | Greater() | NotNull() | Truth() | Solved():
            return p
        case _:
            assert_never(p)


def _negated(p: Predicate) -> Predicate:
    match p:
        case Not(of):
            return negation_normal_form(of)
        case And(left, right):
            return Or(_negated(left), _negated(right))
        case Or(left, right):
            return And(_negated(left), _negated(right))
        case Less() | Greater() | NotNull() | Exists() | Truth() | Solved():
            return Not(negation_normal_form(p))
        case _:
            assert_never(p)


def conjuncts(p: Predicate) -> tuple[Predicate, ...]:
    """Take a conjunction apart, left to right; true has no conjuncts."""
    match p:
        case And(left, right):
            return (*conjuncts(left), *conjuncts(right))
        case Truth():
            return ()
        case Less() | Greater() | NotNull() | Not() | Or() | Exists() | Solved():
            return (p,)
        case _:
            assert_never(p)


def conjunction(predicates: tuple[Predicate, ...] | list[Predicate]) -> Predicate:
    """Join predicates with ∧, nested to the left as the parser does; none give true."""
    return reduce(And, predicates) if predicates else Truth()


def alpha_equivalent(p: Predicate, q: Predicate) -> bool:
    """Tell whether two predicates are equal up to the names of bound variables."""
    return _anonymous(p, 0) == _anonymous(q, 0)


def _anonymous(p: Predicate, level: int) -> Predicate:
    """Name bound variables by their depth; digits cannot start a variable that was written by anyone."""
    match p:
        case Exists(var, kind, body):
            inner = _rename_predicate(body, {var.name: f"{level}"})
            return Exists(Var(f"{level}"), kind, _anonymous(inner, level + 1))
        case Not(of):
            return Not(_anonymous(of, level))
        case And(left, right):
            return And(_anonymous(left, level), _anonymous(right, level))
        case Or(left, right):
            return Or(_anonymous(left, level), _anonymous(right, level))
        case Less() | Greater() | NotNull() | Truth() | Solved():
            return p
        case _:
            assert_never(p)


def seq(*statements: Statement) -> Statement:
    """Join statements into one, without nesting sequences; a single one stays as it is."""
    parts: list[Statement] = []
    for statement in statements:
        parts.extend(statement.parts if isinstance(statement, Seq) else (statement,))
    return parts[0] if len(parts) == 1 else Seq(tuple(parts))


def controllers(program: Program | Statement) -> tuple[Run, ...]:
    """Return every controller statement in textual order."""
    return tuple(part for part in walk(program) if isinstance(part, Run))


def run_variables(run: Run) -> tuple[str, ...]:
    """Return the distinct variables among a controller's arguments, in order of first occurrence."""
    return free_vars(Run(run.controller, run.args, Truth()))
