"""Program text with colours and hover texts that say what every word means."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from html import escape

from roboscribe.dsl.printer import STATEMENT_WORDS, definitions, pretty, text
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Predicate, Program

_TOKEN = re.compile(
    r"(?P<comment>#.*)|(?P<field>↓\s*\w+)|(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)"
    r"|(?P<word>[^\W\dλ][^\Wλ]*'*)|(?P<operator>:=|≠|≡|[λ∃¬∧∨‖<>−])|(?P<plain>\s+|.)"
)
_MEANINGS = {
    "def": "the program's name; μ is the robot's end effector",
    "while": "repeated as long as an entity is found, or the condition holds",
    "if": "done only where the condition holds",
    "else": "done where the condition does not hold",
    "get": "an entity for which the condition holds; null where there is none",
    "until": "the controller acts until this holds",
    "where": "what the names of predicates stand for",
    "skip": "nothing is done",
    "null": "no entity",
    "μ": "the robot's end effector",
    "mu": "the robot's end effector",
    "g": "the goal of an entity",
    "true": "holds always",
    "True": "holds always",
    "ψ_R": "the task's own test of success",
    "psi_R": "the task's own test of success",
    ":=": "binds a variable to an entity",
    "≠": "is not",
    "≡": "stands for",
    "λ": "the entity that is sought",
    "∃": "there is an entity such that",
    "¬": "not",
    "∧": "and",
    "∨": "or",
    "‖": "Euclidean length",
    "<": "is less than",
    ">": "is greater than",
    "−": "minus; of angles the difference within half a turn",
}


def program_html(program: Program, notes: Mapping[str, str] | None = None) -> str:
    """Show a program as it prints.

    Args:
        program: what to show.
        notes: more to say about names, for instance how a controller (π_hold) was learned.
    """
    return code_html(pretty(program), {**meanings(program), **(notes or {})})


def meanings(program: Program) -> dict[str, str]:
    """Say what a program's own names mean: predicates by their definitions, controllers by what ends them."""
    found = {each.name: f"{each.head(each.params)} ≡ {text(each.body)}" for each in definitions(program)}
    runs = {f"π_{run.controller}": f"learned controller; acts until {text(run.until)}" for run in controllers(program)}
    return {**found, **runs}


def code_html(source: str, notes: Mapping[str, str] | None = None, marked: Collection[int] = ()) -> str:
    """Show program text, be it right or wrong, in colours; long lines wrap.

    Args:
        source: the text.
        notes: hover texts by word, besides those of the language.
        marked: lines to point out, from 0.
    """
    lines = source.rstrip("\n").split("\n")
    rows = (_row(line, notes or {}, number in marked) for number, line in enumerate(lines))
    return f'<div class="code">{"".join(rows)}</div>'


def predicate_html(predicate: Predicate) -> str:
    """Show a predicate within a line of text."""
    return formula_html(text(predicate))


def formula_html(source: str) -> str:
    """Show the text of a predicate within a line of text."""
    return f'<span class="formula">{_coloured(source, {})}</span>'


def _row(line: str, notes: Mapping[str, str], marked: bool) -> str:
    """Show one line, indented as it is."""
    indent = len(line) - len(line.lstrip())
    kind = "row marked" if marked else "row"
    return f'<code class="{kind}" style="--in:{indent}">{_coloured(line.lstrip(), notes)}</code>'


def _coloured(line: str, notes: Mapping[str, str]) -> str:
    return "".join(_token(str(match.lastgroup), match.group(), notes) for match in _TOKEN.finditer(line))


def _token(group: str, word: str, notes: Mapping[str, str]) -> str:
    kind = _kind(group, word, notes)
    tip = notes.get(word) or _meaning(group, word)
    if not kind and not tip:
        return escape(word)
    told = f' data-tip="{escape(tip)}"' if tip else ""
    focus = ' tabindex="0"' if word in notes else ""
    return f'<span class="{kind}"{told}{focus}>{escape(word)}</span>'


def _kind(group: str, word: str, notes: Mapping[str, str]) -> str:
    """Choose the class of a token."""
    if group != "word":
        return "" if group == "plain" else group
    if word.startswith("π_"):
        return "controller"
    if word in STATEMENT_WORDS:
        return "keyword"
    if word in notes or word in ("ψ_R", "psi_R"):
        return "predicate"
    return "robot" if word in ("μ", "mu") else ""


def _meaning(group: str, word: str) -> str:
    match group:
        case "number":
            return "a learned threshold, in SI units; edit it and run again"
        case "field":
            return f"attribute {word[1:].strip()}"
        case _:
            return _MEANINGS.get(word, "")
