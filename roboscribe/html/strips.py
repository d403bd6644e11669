"""Time strips: one row per demonstration, coloured where a predicate holds."""

from __future__ import annotations

from html import escape

from roboscribe.strips import Strip, Strips

ROW, BAR = 8, 6
"""Height of a row and of its bar, pixels."""
MOST_ROWS = 80
"""Rows beyond which only every second, third, ... demonstration is drawn."""


def strips_html(strips: Strips, predicate: str, goal: str) -> str:
    """Draw strips with their axis and legend.

    Args:
        strips: the rows.
        predicate: name of what holds, for hover texts and the legend.
        goal: name of what it leads to.
    """
    longest = max((row.frames for row in strips.rows), default=1)
    every = max(1, -(-len(strips.rows) // MOST_ROWS))
    shown = list(enumerate(strips.rows))[::every]
    rows = "".join(_row(place, rank, row, strips, predicate, goal) for place, (rank, row) in enumerate(shown))
    size = f'viewBox="0 0 {longest} {ROW * len(shown) + 2}" preserveAspectRatio="none"'
    height = f"height:{ROW * len(shown) + 2}px"
    label = escape(f"where {predicate} is true in {len(strips.rows)} demonstrations")
    svg = f'<svg class="strips" {size} style="{height}" role="img" aria-label="{label}">{rows}</svg>'
    half, whole = longest / 2 / strips.frequency, longest / strips.frequency
    axis = f'<div class="axis"><span>0 s</span><span>{half:.1f} s</span><span>{whole:.1f} s</span></div>'
    which = "one row per demonstration" if every == 1 else f"{len(shown)} of {len(strips.rows)} demonstrations"
    return svg + axis + _legend(strips, predicate, goal, which)


def _legend(strips: Strips, predicate: str, goal: str, which: str) -> str:
    """Say what the colours mean."""
    holds = f"{predicate} is true" + (f" (darker: of more of {strips.most})" if strips.most > 1 else "")
    entries = (("accent", holds), ("line", "it is not"), ("bad", f"{goal} is first reached"))
    items = "".join(f'<span><i style="background:var(--{kind})"></i>{escape(said)}</span>' for kind, said in entries)
    return f'<div class="legend">{items}<span>{which}</span></div>'


def _row(place: int, rank: int, row: Strip, strips: Strips, predicate: str, goal: str) -> str:
    """Draw one demonstration."""
    top = ROW * place + 2
    shown = f'<rect class="shown" x="0" y="{top}" width="{row.frames}" height="{BAR}"/>'
    bars = "".join(
        f'<rect class="holds" x="{begin}" y="{top}" width="{end - begin}" height="{BAR}"'
        f' opacity="{0.35 + 0.65 * count / strips.most:.2f}"/>'
        for begin, end, count in row.spans
    )
    width = max(1.0, 0.008 * max(each.frames for each in strips.rows))
    mark = f'<rect class="goal" x="{row.goal}" y="{top}" width="{width:.2f}" height="{BAR}"/>' if row.goal >= 0 else ""
    return f"<g><title>{escape(_told(rank, row, strips, predicate, goal))}</title>{shown}{bars}{mark}</g>"


def _told(rank: int, row: Strip, strips: Strips, predicate: str, goal: str) -> str:
    """Say what a row shows."""
    parts = [
        f"{begin / strips.frequency:.1f} to {end / strips.frequency:.1f} s"
        + (f" of {count}" if strips.most > 1 else "")
        for begin, end, count in row.spans
    ]
    held = f"{predicate} is true {', '.join(parts)}" if parts else f"{predicate} is never true"
    reached = f"{goal} first reached at {row.goal / strips.frequency:.1f} s" if row.goal >= 0 else f"never {goal}"
    return f"demonstration {rank + 1}: {held}; {reached}"
