"""Tables: what was ranked and what was passed over, and figures with their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from roboscribe.classifier import Refinement
from roboscribe.dsl.printer import text
from roboscribe.html.code import formula_html
from roboscribe.search.candidates import Candidate

_COLUMNS = (
    ("predicate", ""),
    ("failures", "share of the failing states on which it holds; fewer is better"),
    ("first", "where on the way to the goal it is first reached, median: 0 % is the start, 100 % the goal"),
    ("kept", "share of the rest of the way on which it stays true"),
    ("start", "share of the demonstrations that begin with it satisfied"),
    ("bits", "how much it says: each bit halves what is possible"),
    ("margin", "gap from its threshold to the nearest failing state, in spreads"),
    ("why not", ""),
)


ROWS = 8
"""Rows of a ranked table that are shown at once; the others are folded away."""


def refinement_html(refinement: Refinement) -> str:
    """Show the ranked table of a refinement: the chosen predicate marked, the others with what spoke against them."""
    reasons = dict(refinement.passed_over)
    chosen = text(refinement.node.predicate)
    rows = [
        _candidate(rank, row, chosen, reasons.get(text(row.predicate), ""))
        for rank, row in enumerate(refinement.table, start=1)
    ]
    taken = next((rank for rank, row in enumerate(refinement.table) if text(row.predicate) == chosen), 0)
    first = max(ROWS, taken + 1)
    more = f"<details><summary>{len(rows) - first} more</summary>{_table(rows[first:])}</details>"
    return _table(rows[:first]) + (more if len(rows) > first else "")


def _table(rows: Sequence[str]) -> str:
    head = "".join(_title(name, tip) for name, tip in _COLUMNS)
    body = f"<thead><tr><th></th>{head}</tr></thead><tbody>{''.join(rows)}</tbody>"
    return f'<div class="wide ranked"><table>{body}</table></div>'


def _title(name: str, tip: str) -> str:
    right = "" if name in ("predicate", "why not") else ' class="right"'
    return f"<th{right}>" + (f'<abbr title="{escape(tip)}">{escape(name)}</abbr>' if tip else escape(name)) + "</th>"


def _candidate(rank: int, row: Candidate, chosen: str, why_not: str) -> str:
    """Show one predicate that was considered."""
    mine = text(row.predicate) == chosen
    kind = ' class="chosen"' if mine else ' class="passed"' if why_not else ""
    shares = (f"{row.accepted:.1%}", f"{row.first:.0%}", f"{row.kept:.0%}", f"{row.initial:.0%}")
    numbers = "".join(f'<td class="right">{each}</td>' for each in (*shares, f"{row.bits:.1f}", f"{row.margin:.2f}"))
    said = "taken" if mine else why_not or "ranked lower, not needed"
    first = f'<td class="right">{rank}</td><td>{formula_html(text(row.predicate))}</td>'
    return f'<tr{kind}>{first}{numbers}<td class="why">{escape(said)}</td></tr>'


def figures_html(rows: Iterable[tuple[str, Sequence[str]]], titles: Sequence[str] = ()) -> str:
    """Show named figures, a column for each run; what differs between columns is pointed out."""
    head = "".join(f"<th>{escape(title)}</th>" for title in titles)
    above = f"<thead><tr><th></th>{head}</tr></thead>" if titles else ""
    body = "".join(_figure(name, values) for name, values in rows)
    return f'<div class="wide"><table>{above}<tbody>{body}</tbody></table></div>'


def _figure(name: str, values: Sequence[str]) -> str:
    kind = ' class="chosen"' if len(set(values)) > 1 else ""
    return f"<tr{kind}><th>{escape(name)}</th>" + "".join(f"<td>{escape(value)}</td>" for value in values) + "</tr>"


def pairs_html(pairs: Mapping[str, str]) -> str:
    """Show named figures of one run."""
    return figures_html((name, (value,)) for name, value in pairs.items())
