r"""Parsing of predicates, statements and programs, in the one-line form and in the pretty one.

Grammar (EBNF; `indented` means lines that all start in one column, further right than the line before):

    program    = "def" NAME "(" "μ" ":" "EE" ")" ":" body [ "where" { definition } ]
    body       = indented lines of statement [ ";" ] | inline
    inline     = [ statement { ";" statement } [ ";" ] ]
    block      = "{" inline "}" | ":" body
    statement  = "skip" | get | run
               | "while" guard block
               | "if" predicate block [ "else" block ]
    get        = NAME ":=" "get" "(" "λ" NAME ":" NAME "." predicate ")"         both NAMEs of the variable alike
    guard      = "(" get ")" "≠" "null" | predicate                             either in further parentheses
    run        = "π_"NAME "(" [ object { "," object } ] ")" "until" predicate
    object     = "μ" | NAME | "g" "(" NAME ")"
    predicate  = conjunct { "∨" conjunct }                                      ∨ and ∧ nest to the left
    conjunct   = literal { "∧" literal }
    literal    = "¬" literal | "∃" NAME ":" NAME "." predicate                  ∃ reaches as far right as it can
               | term "<" term | term ">" [ "-" ] NUMBER
               | NAME "≠" "null" | "true" | "ψ_R" | "(" predicate ")"
               | NAME "(" [ argument { "," argument } ] ")"                     a predicate defined under where
    term       = factor { "−" factor }
    factor     = object "↓" NAME | "‖" term "‖" | "arctan2" "(" term ")" | [ "-" ] NUMBER | "(" term ")"
    definition = NAME "(" [ argument { "," argument } ] ")" "≡" predicate [ ";" ]
    argument   = "μ" | NAME

A single statement followed by ";" is a sequence of one; nothing between braces, and "skip", the empty sequence. A
missing "else" is an empty one. NAME is a letter or "_", then letters, digits and "_", then primes; words of the
grammar are no names. "#" starts a comment. ASCII spellings: mu, pi_NAME, psi_R, lambda or \ for λ, exists,
and && ^, or ||, not ! ~, != for ≠, - for −, = or == for ≡, "." for ↓, norm(term) for ‖term‖.

Text is never evaluated as Python. Its size, its nesting and what its definitions expand to are limited.
"""

from __future__ import annotations

from typing import TypeAlias

from roboscribe.dsl.expressions import NAMES_NO_VARIABLE, Expressions
from roboscribe.dsl.lexer import Cursor, Token
from roboscribe.dsl.printer import RESERVED
from roboscribe.dsl.syntax import Get, If, Object, Predicate, Program, Run, Seq, Statement, Var, While

Column: TypeAlias = int | None
"""Column of the lines of an indented block; None within braces, 0 for one line behind a colon."""
_ENDS = frozenset(["}", "where", "else"])


def parse_program(text: str) -> Program:
    """Read a whole program, in either printed form, and expand its definitions.

    Raises:
        ProgramError: text that is no program, with line, column and a caret; or one beyond the limits.
    """
    cursor = Cursor(text)
    expressions = Expressions(cursor)
    expressions.find_definitions()
    program = _Statements(cursor, expressions).program()
    if cursor.accept("where"):
        expressions.definitions()
    cursor.end()
    return program


def parse_statement(text: str) -> Statement:
    """Read a statement as `str` prints it.

    Raises:
        ProgramError: as in `parse_program`.
    """
    cursor = Cursor(text)
    statement = _Statements(cursor, Expressions(cursor)).inline()
    cursor.end()
    return statement


def parse_predicate(text: str) -> Predicate:
    """Read a predicate as `str` prints it.

    Raises:
        ProgramError: as in `parse_program`.
    """
    cursor = Cursor(text)
    predicate = Expressions(cursor).predicate()
    cursor.end()
    return predicate


class _Statements:
    """Recursive descent over statements."""

    def __init__(self, cursor: Cursor, expressions: Expressions) -> None:
        self._cursor = cursor
        self._expressions = expressions

    def program(self) -> Program:
        cursor = self._cursor
        start = cursor.expect("def")
        name = cursor.name("a name for the program", RESERVED)
        for part in ("(", "μ", ":", "EE", ")", ":"):
            cursor.expect(part)
        cursor.count()
        return Program(name, self._body(start.column))

    def inline(self) -> Statement:
        """Read statements separated by semicolons, up to a closing brace, a new line after a colon, or the end."""
        return self._sequence(None)

    def _block(self, head: Token) -> Statement:
        """Read the block of a `while`, `if` or `else` that started at `head`."""
        with self._cursor.nested():
            if self._cursor.accept("{"):
                body = self._sequence(None)
                self._cursor.expect("}")
                return body
            self._cursor.expect(":")
            return self._body(head.column)

    def _body(self, column: int) -> Statement:
        token = self._cursor.next
        if not token.first:
            return self._sequence(None, one_line=True)
        if token.kind != "end" and token.column <= column:
            self._cursor.fail(f"expected an indented block, further right than column {column}")
        return self._sequence(token.column)

    def _sequence(self, column: Column, one_line: bool = False) -> Statement:
        """Read statements: one per line in `column`, or separated by semicolons where there is no column."""
        parts: list[Statement] = []
        separated = True
        while separated and not self._over(column, one_line):
            parts.append(self._statement(0 if one_line else column))
            self._cursor.count()
            separated = not self._outside(column, one_line) and self._cursor.accept(";")
            if column is not None and self._cursor.next.first and not self._over(column, one_line):
                separated = self._aligned(column)
        if len(parts) == 1 and not separated:
            return parts[0]
        return Seq(tuple(part for part in parts if part != Seq()))

    def _over(self, column: Column, one_line: bool) -> bool:
        token = self._cursor.next
        return token.kind == "end" or token.value in _ENDS or self._outside(column, one_line)

    def _outside(self, column: Column, one_line: bool) -> bool:
        """Tell whether the next token starts a line that belongs to a block further out."""
        token = self._cursor.next
        return token.first and (one_line or (column is not None and token.column < column))

    def _aligned(self, column: int) -> bool:
        if self._cursor.next.column != column:
            self._cursor.fail(f"expected a line that starts in column {column}")
        return True

    def _statement(self, column: Column) -> Statement:
        token = self._cursor.next
        with self._cursor.nested():
            match token.value:
                case "skip":
                    self._cursor.take()
                    return Seq()
                case "while":
                    self._cursor.take()
                    return While(self._guard(), self._block(token))
                case "if":
                    self._cursor.take()
                    return self._if(token, column)
                case _:
                    return self._get() if self._cursor.ahead().value == ":=" else self._run()

    def _if(self, head: Token, column: Column) -> If:
        test = self._expressions.predicate()
        then = self._block(head)
        token = self._cursor.next
        mine = column is None or not token.first or token.column == head.column
        otherwise = self._block(head) if mine and self._cursor.accept("else") else Seq()
        return If(test, then, otherwise)

    def _guard(self) -> Get | Predicate:
        """Read a guard; a get among the opening parentheses tells which kind it is."""
        opening = 0
        while self._cursor.ahead(opening).value == "(" and opening < len(self._cursor.tokens):
            opening += 1
        if not opening or self._cursor.ahead(opening + 1).value != ":=":
            return self._expressions.predicate()
        for _ in range(opening):
            self._cursor.expect("(")
        get = self._get()
        compared = False
        for _ in range(opening):
            self._cursor.expect(")")
            if not compared and self._cursor.accept("≠"):
                self._cursor.expect("null")
                compared = True
        if not compared:
            self._cursor.fail("expected '≠'")
        return get

    def _get(self) -> Get:
        cursor = self._cursor
        name = cursor.name("a variable", NAMES_NO_VARIABLE)
        for part in (":=", "get", "(", "λ"):
            cursor.expect(part)
        place = cursor.next
        if cursor.name("a variable", NAMES_NO_VARIABLE) != name:
            cursor.fail(f"expected {name!r}, the variable that is assigned", place)
        cursor.expect(":")
        kind = cursor.name("a type", RESERVED)
        cursor.expect(".")
        cursor.count(2)
        get = Get(Var(name), kind, self._expressions.predicate(quantifiers=1))
        cursor.expect(")")
        return get

    def _run(self) -> Run:
        cursor = self._cursor
        token = cursor.next
        controller = token.value.removeprefix("π_").removeprefix("pi_")
        if token.kind != "word" or controller == token.value or not controller:
            cursor.fail("expected a statement: π_name(...) until P, v := get(...), while, if or skip")
        cursor.take()
        args = self._arguments()
        cursor.expect("until")
        return Run(controller, args, self._expressions.predicate())

    def _arguments(self) -> tuple[Object, ...]:
        self._cursor.expect("(")
        args: list[Object] = []
        while not self._cursor.at(")") and (not args or self._cursor.expect(",")):
            args.append(self._expressions.object())
        self._cursor.expect(")")
        return tuple(args)
