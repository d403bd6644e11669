"""A drawn stand-in for a rendered scene: from above and from the side, any task whose objects have positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from roboscribe.world.layout import ROBOT, FloatArray, Layout

DPI = 100
COLORS = ("tab:red", "tab:blue", "tab:green", "tab:orange", "tab:purple", "tab:cyan")
MARGIN = 0.1
"""Free space around everything drawn, as a share of the spread."""


def places(layout: Layout, state: FloatArray, goal: bool) -> dict[int, FloatArray]:
    """Positions (..., n), or goal positions, by object index; objects without one are left out."""
    indices = (ROBOT, *range(len(layout.entities)))
    found = {i: layout.columns.get((i, "position", goal)) for i in indices}
    return {i: state[..., columns] for i, columns in found.items() if columns is not None}


def limits(layout: Layout, states: FloatArray) -> FloatArray:
    """Return lower and upper ends (2, n) of axes that show all of an episode (T, F), all of them equally long."""
    shown = [place for goal in (False, True) for place in places(layout, states, goal).values()]
    width = min(place.shape[-1] for place in shown)
    points = np.concatenate([place[..., :width].reshape(-1, width) for place in shown])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, (0.5 + MARGIN) * max(float((high - low).max()), 1e-3)
    return np.stack([middle - half, middle + half])


class Schematic:
    """Draws states on axes that stay as they are: robot a cross, objects squares with their names, goals rings.

    Args:
        layout: meaning of a state.
        bounds: (2, n) what the axes show, see `limits`.
        size: width and height, pixels.
    """

    def __init__(self, layout: Layout, bounds: FloatArray, size: tuple[int, int]) -> None:
        """Draw everything that does not move."""
        self._layout = layout
        figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI, layout="constrained")
        self._canvas = FigureCanvasAgg(figure)
        planes = [(0, 1, "from above"), (0, 2, "from the side")] if bounds.shape[1] > 2 else [(0, 1, "from above")]
        shape = (1, len(planes)) if size[0] > 1.2 * size[1] else (len(planes), 1)
        self._views = [
            _View(figure.add_subplot(*shape, number), layout, bounds, (across, up), title)
            for number, (across, up, title) in enumerate(planes, start=1)
        ]
        self._canvas.draw()  # type: ignore[no-untyped-call]  # matplotlib leaves it without types
        figure.set_layout_engine("none")

    def draw(self, state: FloatArray, pointed: Sequence[FloatArray] = ()) -> NDArray[np.uint8]:
        """Draw one state (F,) as an RGB image (height, width, 3), with a frame around some places (n,)."""
        for view in self._views:
            view.show(state, pointed)
        # matplotlib leaves these two calls without types.
        self._canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(self._canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return pixels[..., :3].copy()


class _View:
    """The objects projected on two axes."""

    def __init__(self, axes: Axes, layout: Layout, bounds: FloatArray, plane: tuple[int, int], title: str) -> None:
        self._layout, (self._across, self._up) = layout, plane
        axes.set_title(title, fontsize=9)
        axes.set_xlabel("xyz"[self._across])
        axes.set_ylabel("xyz"[self._up])
        axes.set_xlim(*bounds[:, self._across])
        axes.set_ylim(*bounds[:, self._up])
        axes.set_aspect("equal", adjustable="box")
        nowhere = np.zeros(layout.size)
        self._goals = {i: _dot(axes, "o", i, hollow=True) for i in places(layout, nowhere, goal=True)}
        self._things = {i: _dot(axes, "+" if i == ROBOT else "s", i) for i in places(layout, nowhere, goal=False)}
        self._names = {i: axes.text(0, 0, layout.names[i], ha="center", va="bottom") for i in self._things if i >= 0}
        for name in self._names.values():
            name.set_in_layout(False)
        (self._pointed,) = axes.plot([], [], linestyle="", marker="s", mfc="none", mec="black", ms=19, mew=1.5)
        self._above = 0.03 * float(np.ptp(bounds[:, self._up]))

    def show(self, state: FloatArray, pointed: Sequence[FloatArray]) -> None:
        """Move everything to where it is."""
        across, up = self._across, self._up
        for dots, goal in ((self._goals, True), (self._things, False)):
            for index, place in places(self._layout, state, goal).items():
                dots[index].set_data([place[across]], [place[up]])
                if not goal and index in self._names:
                    self._names[index].set_position((place[across], place[up] + self._above))
        self._pointed.set_data([place[across] for place in pointed], [place[up] for place in pointed])


def _dot(axes: Axes, marker: str, index: int, hollow: bool = False) -> Line2D:
    """Make the mark of an object or its goal."""
    color = "black" if index == ROBOT else COLORS[index % len(COLORS)]
    look = {"mfc": "none", "ms": 18, "alpha": 0.6} if hollow else {"mfc": color, "ms": 14 if index == ROBOT else 12}
    (dot,) = axes.plot([], [], linestyle="", marker=marker, mec=color, **look)
    return dot
