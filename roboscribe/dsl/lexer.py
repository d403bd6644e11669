"""Program text as tokens that know their place; ASCII spellings become the Unicode ones."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NoReturn

from roboscribe.errors import ProgramError

MAX_CHARACTERS = 100_000
"""Longest text that is read."""

WORDS = {"mu": "μ", "µ": "μ", "lambda": "λ", "exists": "∃", "and": "∧", "or": "∨", "not": "¬"} | {
    "True": "true",
    "psi_R": "ψ_R",
}
"""Canonical spelling of words."""
SYMBOLS = {"\\": "λ", "&&": "∧", "^": "∧", "||": "∨", "!": "¬", "~": "¬", "!=": "≠", "−": "-", "==": "≡", "=": "≡"}
"""Canonical spelling of symbols."""

_NAME = re.compile(r"[^\W\dλ][^\Wλ]*")
_TOKEN = re.compile(
    r"(?P<space>[^\S\n]+)|(?P<newline>\n)|(?P<comment>#[^\n]*)"
    r"|(?P<number>[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<word>[^\W\dλ][^\Wλ]*'*)"
    r"|(?P<symbol>:=|!=|==|&&|\|\||[(){}:;,.<>↓‖λ\\∃∧^∨¬!~≠≡=−-])"
)


def is_name(text: str) -> bool:
    """Whether a text is read as one word, and as itself."""
    return _NAME.fullmatch(text) is not None and text not in WORDS


@dataclass(frozen=True)
class Token:
    """One token.

    Args:
        kind: "word", "number", "symbol" or "end".
        value: canonical spelling.
        line: line, from 1.
        column: column, from 1.
        first: nothing but space stands before it on its line.
    """

    kind: str
    value: str
    line: int
    column: int
    first: bool


@dataclass(frozen=True)
class Source:
    """Program text, for errors that point into it."""

    text: str

    def fail(self, token: Token, problem: str) -> NoReturn:
        """Raise a ProgramError that names line and column and puts a caret under the place."""
        lines = self.text.split("\n")
        start = max(0, token.column - 61)
        shown = lines[token.line - 1][start : start + 120]
        printable = "".join(c if c.isprintable() else " " for c in shown)
        caret = " " * (token.column - 1 - start) + "^"
        msg = f"line {token.line}, column {token.column}: {problem}\n  {printable}\n  {caret}"
        raise ProgramError(msg)


def tokens(text: str) -> list[Token]:
    """Cut text into tokens, the last of kind "end".

    Raises:
        ProgramError: a text that is too long, or a character that is in no token.
    """
    if len(text) > MAX_CHARACTERS:
        msg = f"program text has {len(text)} characters; at most {MAX_CHARACTERS} are read"
        raise ProgramError(msg)
    found: list[Token] = []
    place, line, line_start, first = 0, 1, 0, True
    while place < len(text):
        match = _TOKEN.match(text, place)
        column = place - line_start + 1
        if match is None:
            character = ascii(text[place])
            Source(text).fail(Token("symbol", "", line, column, first), f"unexpected character {character}")
        place = match.end()
        kind, value = str(match.lastgroup), match.group()
        if kind == "newline":
            line, line_start, first = line + 1, place, True
        elif kind not in ("space", "comment"):
            found.append(_token(kind, value, line, column, first))
            first = False
    found.append(Token("end", "end of text", line, place - line_start + 1, True))
    return found


def _token(kind: str, value: str, line: int, column: int, first: bool) -> Token:
    if kind == "word" and value in WORDS:
        value = WORDS[value]
        kind = "symbol" if value in "λ∃∧∨¬" else "word"
    return Token(kind, SYMBOLS.get(value, value) if kind == "symbol" else value, line, column, first)


MAX_NODES = 20_000
"""Most nodes of a program once its definitions are expanded."""
MAX_NESTING = 100
"""Most levels of nesting in the text."""


class Cursor:
    """Walks over the tokens of a text, and counts what it may cost."""

    def __init__(self, text: str) -> None:
        """Cut the text into tokens and stand before the first."""
        self.source = Source(text)
        self.tokens = tokens(text)
        self.position = 0
        self._nodes = 0
        self._nesting = 0

    @property
    def next(self) -> Token:
        """The token ahead."""
        return self.tokens[self.position]

    def ahead(self, count: int = 1) -> Token:
        """Return the token `count` places behind the next one, or the last."""
        return self.tokens[min(self.position + count, len(self.tokens) - 1)]

    def take(self) -> Token:
        """Return the next token and go past it; nothing goes past the end."""
        token = self.next
        self.position = min(self.position + 1, len(self.tokens) - 1)
        return token

    def at(self, value: str) -> bool:
        """Tell whether the next token is this word or symbol."""
        return self.next.value == value and self.next.kind != "end"

    def accept(self, value: str) -> bool:
        """Go past the next token if it is this word or symbol; tell whether it was."""
        here = self.at(value)
        if here:
            self.take()
        return here

    def expect(self, value: str) -> Token:
        """Go past this word or symbol.

        Raises:
            ProgramError: something else stands there.
        """
        if not self.at(value):
            self.fail(f"expected {value!r}")
        return self.take()

    def name(self, what: str, reserved: frozenset[str]) -> str:
        """Go past a name and return it.

        Raises:
            ProgramError: no word stands there, or a reserved one.
        """
        if self.next.kind != "word" or self.next.value in reserved:
            self.fail(f"expected {what}")
        return self.take().value

    def end(self) -> None:
        """Check that everything was read."""
        if self.next.kind != "end":
            self.fail("expected the end of the text")

    def fail(self, problem: str, token: Token | None = None) -> NoReturn:
        """Raise a ProgramError at a token, by default the next one, and say what was found there."""
        token = token or self.next
        found = token.value if len(token.value) <= 40 else f"{token.value[:40]}..."
        self.source.fail(token, f"{problem}, found {found!r}")

    def count(self, nodes: int = 1) -> None:
        """Count nodes of the syntax tree.

        Raises:
            ProgramError: there are too many.
        """
        self._nodes += nodes
        if self._nodes > MAX_NODES:
            self.source.fail(self.next, f"the program expands to more than {MAX_NODES} nodes, which is the limit")

    @contextmanager
    def nested(self) -> Iterator[None]:
        """Go one level deeper.

        Raises:
            ProgramError: that is too deep.
        """
        if self._nesting == MAX_NESTING:
            self.source.fail(self.next, f"nesting deeper than {MAX_NESTING} levels, which is the limit")
        self._nesting += 1
        yield
        self._nesting -= 1
