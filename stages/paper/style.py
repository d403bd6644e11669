"""One style for every figure: colours for all eyes, labels at the lines, the same bytes each time."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "roboscribe, actions": "#0072B2",
    "roboscribe, states": "#56B4E9",
    "roboscribe, paper": "#332288",
    "roboscribe, scripted": "#117733",
    "bc": "#E69F00",
    "chunked-bc": "#D55E00",
    "deepset": "#009E73",
    "gail": "#CC79A7",
    "goalgail": "#882255",
    "rlpd": "#999933",
}
"""By the name of a method in reports; after Okabe and Ito, and Tol, whose colours differ for all kinds of eyes."""
ORDER = tuple(COLOURS)
OTHER = "#777777"
SETTINGS = {
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "svg.hashsalt": "roboscribe",
    "svg.fonttype": "none",
    "path.simplify": False,
}
QUICK = "quick: not a result"
PAPER = "#000000"
"""Colour of what the paper reports, where no method has one."""
GAP = 0.055
"""Least distance of two labels, in heights of the panel."""


def colour(line: str) -> str:
    """Return a method's colour."""
    return COLOURS.get(line, OTHER)


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the style of all figures, and not in a user's own."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        for name, value in SETTINGS.items():
            mpl.rcParams[name] = value  # type: ignore[index]  # names are listed as literals
        yield


def pictures(figure: Figure, name: str) -> dict[str, bytes]:
    """Return a figure as PNG and SVG by file name; to be called within `styled`."""
    made = {"png": {"Software": None}, "svg": {"Date": None}}
    return {f"{name}.{kind}": _saved(figure, kind, metadata) for kind, metadata in made.items()}


def _saved(figure: Figure, kind: str, metadata: dict[str, None]) -> bytes:
    picture = io.BytesIO()
    figure.savefig(picture, format=kind, dpi=150, metadata=metadata)
    return picture.getvalue()


def label_lines(axes: Axes, ends: Sequence[tuple[str, float, str]]) -> None:
    """Write names right of a panel at the heights where lines end, moved apart where they would overlap.

    Args:
        axes: the panel; its vertical limits are set.
        ends: name, height and colour of each line.
    """
    low, high = axes.get_ylim()
    ordered = sorted(ends, key=lambda end: end[1])
    places = _apart([(height - low) / (high - low) for _, height, _ in ordered])
    for (name, _, shade), at in zip(ordered, places, strict=True):
        axes.text(1.01, at, name, transform=axes.transAxes, color=shade, fontsize=7, va="center", clip_on=False)


def _apart(heights: Sequence[float]) -> list[float]:
    """Move heights, in order, apart by `GAP` at least, none above the top."""
    places: list[float] = []
    for height in heights:
        places.append(max([height, *(place + GAP for place in places[-1:])]))
    top = 1.0
    for i in reversed(range(len(places))):
        places[i] = min(places[i], top)
        top = places[i] - GAP
    return places


def rate_axis(axes: Axes) -> None:
    """Make the vertical axis one of success in per cent."""
    axes.set_ylim(-3, 103)
    axes.set_ylabel("success, %")


def label_heading(figure: Figure, keys: Sequence[tuple[str, str]], title: str = "") -> None:
    """Write what colours mean above all panels, each in its colour.

    Args:
        figure: the whole figure.
        keys: text and colour.
        title: what comes first.
    """
    figure.suptitle(title or " ", fontsize=9, x=0.01, ha="left")
    start = 0.01 + (0.2 if title else 0.0)
    for i, (text, shade) in enumerate(keys):
        figure.text(start + 0.1 * i, 0.995, text, color=shade, fontsize=8, va="top")
