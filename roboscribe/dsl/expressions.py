"""Parsing of predicates and terms, and of the definitions under `where`, which are expanded where they are used."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TypeAlias, assert_never

from roboscribe.dsl.lexer import Cursor, Token
from roboscribe.dsl.printer import RESERVED
from roboscribe.dsl.rewrite import depth, free_vars, rename, size, uses_robot
from roboscribe.dsl.syntax import (
    And,
    Arctan2,
    Const,
    Diff,
    Exists,
    Goal,
    Greater,
    Less,
    Norm,
    Not,
    NotNull,
    Object,
    Or,
    Predicate,
    Proj,
    Robot,
    Solved,
    Term,
    Truth,
    Var,
)

MAX_DEPTH = 200
"""Most levels of the syntax tree of one predicate."""
MAX_QUANTIFIERS = 6
"""Most quantifiers, get included, inside each other: the work of deciding them is a power of this."""
NAMES_NO_VARIABLE = RESERVED - {"g"}
"""Words that name no variable; `g` is a function only before a parenthesis."""

_Expression: TypeAlias = Predicate | Term
_LEVELS = {"∨": 1, "∧": 2, "<": 3, ">": 3, "-": 4}
_BELOW_NOT = 3


@dataclass(frozen=True)
class _Definition:
    robot: bool
    params: tuple[str, ...]
    body: Predicate
    end: int


class Expressions:
    """Recursive descent over predicates and terms.

    Both are read as one kind of expression with binding strengths and told apart afterwards, so that an opening
    parenthesis never has to be read twice.
    """

    def __init__(self, cursor: Cursor) -> None:
        """Read from a cursor; nothing is defined yet."""
        self._cursor = cursor
        self._starts: dict[str, int] = {}
        self._known: dict[str, _Definition] = {}
        self._open: list[str] = []

    def predicate(self, quantifiers: int = 0) -> Predicate:
        """Read a predicate.

        Args:
            quantifiers: how many quantifiers it already stands in.

        Raises:
            ProgramError: no predicate stands here, or one beyond the limits.
        """
        start = self._cursor.next
        found = self._as_predicate(self._expression(0), start)
        if depth(found) > MAX_DEPTH:
            self._cursor.source.fail(start, f"this predicate is more than {MAX_DEPTH} levels deep, which is the limit")
        if quantifiers + _quantifiers(found) > MAX_QUANTIFIERS:
            self._cursor.source.fail(start, f"more than {MAX_QUANTIFIERS} quantifiers inside each other, the limit")
        return found

    def object(self) -> Object:
        """Read μ, a variable or the goal of one."""
        cursor = self._cursor
        cursor.count()
        if cursor.accept("μ"):
            return Robot()
        if cursor.at("g") and cursor.ahead().value == "(":
            cursor.take()
            cursor.take()
            goal = Goal(self._variable())
            cursor.expect(")")
            return goal
        return self._variable()

    def find_definitions(self) -> None:
        """Note where each definition under `where` starts, so that it can be read when it is first used."""
        values = [token.value for token in self._cursor.tokens]
        where = values.index("where") if "where" in values else len(values)
        for place in (i for i in range(where, len(values)) if values[i] == "≡"):
            start = place - 1
            while start > where and values[start] != "(":
                start -= 1
            name = self._cursor.tokens[start - 1]
            if name.value in self._starts:
                self._cursor.source.fail(name, f"{name.value!r} is defined twice")
            self._starts[name.value] = start - 1

    def definitions(self) -> None:
        """Read every definition in turn, used or not."""
        while self._cursor.next.kind == "word":
            self._definition()
            self._cursor.accept(";")

    def _definition(self) -> _Definition:
        cursor = self._cursor
        start = cursor.next
        name = cursor.name("the name of a definition", RESERVED)
        if name in self._known:
            cursor.position = self._known[name].end
            return self._known[name]
        robot, params = self._arguments()
        cursor.expect("≡")
        self._open.append(name)
        body = self.predicate()
        self._open.pop()
        if set(free_vars(body)) - set(params) or (uses_robot(body) and not robot) or len(set(params)) < len(params):
            used = (["μ"] if uses_robot(body) else []) + list(free_vars(body))
            cursor.source.fail(
                start, f"the parameters must be distinct and include all that is used: {', '.join(used)}"
            )
        self._known[name] = _Definition(robot, params, body, cursor.position)
        return self._known[name]

    def _arguments(self) -> tuple[bool, tuple[str, ...]]:
        """Read (μ, v, ...): whether μ stands first, and the variables."""
        cursor = self._cursor
        cursor.expect("(")
        robot = cursor.accept("μ")
        names: list[str] = []
        while not cursor.at(")") and ((not robot and not names) or cursor.expect(",")):
            names.append(self._variable().name)
        cursor.expect(")")
        return robot, tuple(names)

    def _call(self) -> Predicate:
        """Read the use of a definition and expand it."""
        token = self._cursor.take()
        definition = self._look_up(token)
        robot, args = self._arguments()
        if robot != definition.robot or len(args) != len(definition.params):
            expected = ", ".join((["μ"] if definition.robot else []) + list(definition.params))
            self._cursor.source.fail(token, f"{token.value} takes the arguments ({expected})")
        self._cursor.count(size(definition.body))
        return rename(definition.body, dict(zip(definition.params, args, strict=True)))

    def _look_up(self, token: Token) -> _Definition:
        name = token.value
        if name not in self._starts:
            self._cursor.source.fail(token, f"{name!r} is defined nowhere under where")
        if name in self._open:
            self._cursor.source.fail(token, f"{name!r} is defined by itself: {' → '.join([*self._open, name])[:200]}")
        if name not in self._known:
            here, self._cursor.position = self._cursor.position, self._starts[name]
            with self._cursor.nested():
                self._definition()
            self._cursor.position = here
        return self._known[name]

    def _expression(self, weakest: int) -> _Expression:
        """Read operands joined by operators that bind at least as tightly as `weakest`."""
        cursor = self._cursor
        with cursor.nested():
            start = cursor.next
            left = self._operand()
            while cursor.next.kind == "symbol" and _LEVELS.get(cursor.next.value, -1) >= weakest:
                operator, place = cursor.take(), cursor.next
                right = self._expression(_LEVELS[operator.value] + 1)
                cursor.count()
                left = self._join(operator, (left, start), (right, place))
            return left

    def _join(self, operator: Token, left: tuple[_Expression, Token], right: tuple[_Expression, Token]) -> _Expression:
        match operator.value:
            case "∧":
                return And(self._as_predicate(*left), self._as_predicate(*right))
            case "∨":
                return Or(self._as_predicate(*left), self._as_predicate(*right))
            case "<":
                return Less(self._as_term(*left), self._as_term(*right))
            case "-":
                return Diff(self._as_term(*left), self._as_term(*right))
            case ">":
                bound = self._as_term(*right)
                if not isinstance(bound, Const):
                    self._cursor.fail("expected a number on the right of '>' (write a < b instead of b > a)", right[1])
                return Greater(self._as_term(*left), bound)
            case unknown:
                msg = f"{unknown!r} stands in _LEVELS, but how it joins two operands is written nowhere"
                raise AssertionError(msg)

    def _operand(self) -> _Expression:
        cursor = self._cursor
        token = cursor.next
        cursor.count()
        if token.kind == "word":
            return self._word(token)
        if token.kind == "number" or token.value == "-":
            return self._number()
        cursor.take()
        match token.value:
            case "¬":
                return Not(self._as_predicate(self._expression(_BELOW_NOT), token))
            case "∃":
                return self._exists()
            case "(":
                return self._enclosed(")")
            case "‖":
                return Norm(self._as_term(self._enclosed("‖"), token))
            case _:
                return cursor.fail("expected a predicate or a term", token)

    def _word(self, token: Token) -> _Expression:
        cursor = self._cursor
        calls = cursor.ahead().value == "("
        if token.value in ("norm", "arctan2"):
            cursor.take()
            cursor.expect("(")
            inner = self._as_term(self._enclosed(")"), token)
            return Norm(inner) if token.value == "norm" else Arctan2(inner)
        if token.value in ("true", "ψ_R"):
            cursor.take()
            return Truth() if token.value == "true" else Solved()
        if calls and token.value not in RESERVED:
            return self._call()
        return self._attribute(self.object())

    def _attribute(self, owner: Object) -> _Expression:
        cursor = self._cursor
        if isinstance(owner, Var) and cursor.accept("≠"):
            cursor.expect("null")
            return NotNull(owner)
        if not cursor.accept("↓") and not cursor.accept("."):
            cursor.fail("expected '↓' and a field")
        return Proj(owner, cursor.name("a field", frozenset()))

    def _enclosed(self, closing: str) -> _Expression:
        inner = self._expression(0)
        self._cursor.expect(closing)
        return inner

    def _exists(self) -> Exists:
        cursor = self._cursor
        var = self._variable()
        cursor.expect(":")
        kind = cursor.name("a type", RESERVED)
        cursor.expect(".")
        start = cursor.next
        return Exists(var, kind, self._as_predicate(self._expression(0), start))

    def _number(self) -> Const:
        sign = -1.0 if self._cursor.accept("-") else 1.0
        token = self._cursor.next
        if token.kind != "number":
            self._cursor.fail("expected a number")
        value = float(self._cursor.take().value)
        if not isfinite(value):
            self._cursor.fail("expected a number that fits into 64 bits", token)
        return Const(sign * value)

    def _variable(self) -> Var:
        self._cursor.count()
        return Var(self._cursor.name("a variable", NAMES_NO_VARIABLE))

    def _as_predicate(self, found: _Expression, start: Token) -> Predicate:
        if isinstance(found, Term):
            self._cursor.fail("expected a predicate, not a term that stands alone", start)
        return found

    def _as_term(self, found: _Expression, start: Token) -> Term:
        if not isinstance(found, Term):
            self._cursor.fail("expected a term, not a predicate", start)
        return found


def _quantifiers(p: Predicate) -> int:
    """Count the quantifiers on the way down that has most of them."""
    match p:
        case Exists(_, _, body):
            return 1 + _quantifiers(body)
        case Not(of):
            return _quantifiers(of)
        case And(left, right) | Or(left, right):
            return max(_quantifiers(left), _quantifiers(right))
        case Less() | Greater() | NotNull() | Truth() | Solved():
            return 0
        case _:
            assert_never(p)
