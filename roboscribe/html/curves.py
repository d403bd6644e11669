"""Curves of shares between 0 and 1 over control steps, narrow enough to be read on a phone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from math import floor, log10

from roboscribe.html.style import run_colour

WIDTH, HEIGHT = 420, 230
LEFT, RIGHT, TOP, BOTTOM = 44, 14, 12, 34


@dataclass(frozen=True)
class Point:
    """One measurement.

    Args:
        step: control steps so far.
        value: share, 0 to 1.
        low: lower end of its interval.
        high: upper end.
        told: what it is, for a hover text.
    """

    step: float
    value: float
    low: float
    high: float
    told: str


@dataclass(frozen=True)
class Curve:
    """Measurements of one run.

    Args:
        name: of the run, for the legend.
        points: ascending steps.
        rank: of the run, which decides its colour.
    """

    name: str
    points: tuple[Point, ...]
    rank: int = 0


def curves_html(curves: Sequence[Curve], what: str) -> str:
    """Draw curves over control steps on one pair of axes.

    Args:
        curves: what to draw; curves without points are left out.
        what: what is measured, for the axis.
    """
    drawn = [curve for curve in curves if curve.points]
    most = max((point.step for curve in drawn for point in curve.points), default=1.0) or 1.0
    parts = [_grid(most, what), *(_curve(curve, most) for curve in drawn)]
    size = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH + 100}"'
    legend = "" if len(drawn) < 2 else _legend(drawn)
    return f'<svg class="curves" {size} role="img" aria-label="{escape(what)}">{"".join(parts)}</svg>{legend}'


def _legend(curves: Sequence[Curve]) -> str:
    entries = (f'<span><i style="background:{run_colour(c.rank)}"></i>{escape(c.name)}</span>' for c in curves)
    return f'<div class="legend">{"".join(entries)}</div>'


def _grid(most: float, what: str) -> str:
    """Draw the axes."""
    lines = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = _y(share)
        lines.append(f'<line class="frame" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        lines.append(f'<text class="soft" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{share:.0%}</text>')
    for step in _ticks(most):
        x = _x(step, most)
        lines.append(f'<text class="soft" x="{x:.1f}" y="{HEIGHT - 18}" text-anchor="middle">{_short(step)}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    label = escape(f"{what}, over control steps")
    lines.append(f'<text class="soft" x="{middle}" y="{HEIGHT - 3}" text-anchor="middle">{label}</text>')
    return "".join(lines)


def _ticks(most: float) -> list[float]:
    """Choose three to six round numbers up to the greatest step."""
    unit = 10.0 ** floor(log10(most))
    step = next(unit * part for part in (0.2, 0.5, 1.0, 2.0) if most / (unit * part) <= 5)
    return [step * rank for rank in range(int(most / step) + 1)]


def _short(step: float) -> str:
    return f"{step / 1e6:g}M" if step >= 1e6 else f"{step / 1e3:g}k" if step >= 1e3 else f"{step:g}"


def _x(step: float, most: float) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT - 6) * step / most


def _y(share: float) -> float:
    return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - share)


def _curve(curve: Curve, most: float) -> str:
    """Draw one curve: intervals, a line, and a dot for every measurement."""
    colour = run_colour(curve.rank)
    places = [(_x(point.step, most), point) for point in curve.points]
    line = " ".join(f"{x:.1f},{_y(point.value):.1f}" for x, point in places)
    parts = [f'<polyline points="{line}" fill="none" style="stroke:{colour}" stroke-width="1.5"/>']
    for x, point in places:
        low, high = _y(point.low), _y(point.high)
        bar = f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{low:.1f}" y2="{high:.1f}" style="stroke:{colour}" opacity="0.5"/>'
        dot = f'<circle cx="{x:.1f}" cy="{_y(point.value):.1f}" r="3.5" style="fill:{colour}"/>'
        parts.append(f"<g><title>{escape(point.told)}</title>{bar}{dot}</g>")
    return "".join(parts)
