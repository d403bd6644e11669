"""A drawn stand-in for a rendered scene: from above and from the side, any task whose objects have positions."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from roboscribe.world.layout import ROBOT, FloatArray, Layout

DPI = 100
COLORS = ("tab:red", "tab:blue", "tab:green", "tab:orange", "tab:purple", "tab:cyan")
MARGIN = 0.1
"""Free space around everything drawn, as a share of the spread."""


def places(layout: Layout, state: FloatArray, goal: bool) -> dict[int, FloatArray]:
    """Positions, or goal positions, by object index; objects without one are left out."""
    indices = (ROBOT, *range(len(layout.entities)))
    found = {i: layout.columns.get((i, "position", goal)) for i in indices}
    return {i: state[columns] for i, columns in found.items() if columns is not None}


def draw(layout: Layout, state: FloatArray, width: int, height: int) -> NDArray[np.uint8]:
    """Draw one state (F,) as an RGB image (height, width, 3): robot a cross, objects squares, goals rings."""
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    solid = min(len(place) for place in places(layout, state, goal=False).values()) > 2
    views = [(0, 1, "from above"), (0, 2, "from the side")] if solid else [(0, 1, "from above")]
    for number, (across, up, title) in enumerate(views, start=1):
        axes = figure.add_subplot(1, len(views), number)
        axes.set_title(title, fontsize=9)
        _view(axes, layout, state, (across, up))
    # matplotlib leaves these two calls without types.
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    return pixels[..., :3].copy()


def _view(axes: Axes, layout: Layout, state: FloatArray, plane: tuple[int, int]) -> None:
    """Draw the objects projected on two axes."""
    across, up = plane
    for index, place in places(layout, state, goal=True).items():
        color = COLORS[index % len(COLORS)]
        axes.plot(place[across], place[up], "o", mfc="none", mec=color, ms=18, alpha=0.6)
    for index, place in places(layout, state, goal=False).items():
        style = {"marker": "+", "color": "black", "ms": 14} if index == ROBOT else _square(index)
        axes.plot(place[across], place[up], **style)
    axes.set_xlabel("xyz"[across])
    axes.set_ylabel("xyz"[up])
    axes.margins(MARGIN)
    axes.set_aspect("equal", adjustable="datalim")


def _square(index: int) -> dict[str, str | int]:
    """Marker of an entity."""
    return {"marker": "s", "color": COLORS[index % len(COLORS)], "ms": 12}
