"""A subtask tree as a drawing: what has to be reached first stands at the top, the task itself at the bottom."""

from __future__ import annotations

from html import escape
from textwrap import wrap

from roboscribe.dsl.printer import text
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree

CHARACTER, LINE = 7.3, 17.0
"""Width of a character of a formula and height of a line, pixels."""
LETTERS = 36
"""Characters of a predicate on one line."""
GAP = 34.0
"""Between two rows of boxes, pixels."""


def tree_html(tree: Tree) -> str:
    """Draw a tree as SVG; loops have a frame of their own colour and say so."""
    boxes = {node.name: _Box(node) for node in tree.nodes}
    rows = _rows(tree)
    width = max(sum(boxes[name].width + GAP for name in row) for row in rows)
    top, places = 6.0, {}
    for row in rows:
        left = (width - sum(boxes[name].width + GAP for name in row) + GAP) / 2
        for name in row:
            places[name] = (left, top)
            left += boxes[name].width + GAP
        top += max(boxes[name].height for name in row) + GAP
    edges = "".join(_edge(boxes, places, phi, psi) for phi, psi in tree.edges)
    drawn = "".join(boxes[name].draw(*place) for name, place in places.items())
    size = f'viewBox="0 0 {width:.0f} {top - GAP + 6:.0f}" width="{width:.0f}"'
    return f'<svg class="tree" {size} role="img" aria-label="subtask tree">{edges}{drawn}</svg>'


class _Box:
    """One node: its name, and its predicate below."""

    def __init__(self, node: Node) -> None:
        self.node = node
        plain = node.name in (TRUE, ROOT)
        self.name = {TRUE: "start", ROOT: "ψ_R, the task"}.get(node.name, node.name)
        self.formula = [] if plain else wrap(text(node.predicate), LETTERS, break_long_words=False)
        self.note = f"for every {node.role[:1]} in a loop" if node.circular and not plain else ""
        longest = max([len(self.name) + 2, *map(len, self.formula), len(self.note)])
        self.width = longest * CHARACTER + 20
        self.height = LINE * (1 + len(self.formula) + bool(self.note)) + 12

    def draw(self, left: float, top: float) -> str:
        """Draw it with its upper left corner at a place."""
        middle, kind = left + self.width / 2, "box loop" if self.node.circular else "box"
        shape = f'x="{left:.1f}" y="{top:.1f}" width="{self.width:.1f}" height="{self.height:.1f}" rx="8"'
        lines = [("", self.name), *(("formula", part) for part in self.formula)]
        lines += [("soft", self.note)] if self.note else []
        words = "".join(
            f'<text class="{style}" x="{middle:.1f}" y="{top + LINE * (rank + 1):.1f}" text-anchor="middle">'
            f"{escape(words)}</text>"
            for rank, (style, words) in enumerate(lines)
        )
        return f'<g><rect class="{kind}" {shape}/>{words}</g>'


def _rows(tree: Tree) -> list[list[str]]:
    """Sort nodes by their longest distance to the root, the farthest first."""
    depth = {ROOT: 0}
    for _ in tree.nodes:
        for phi, psi in tree.edges:
            if psi in depth:
                depth[phi] = max(depth.get(phi, 0), depth[psi] + 1)
    levels = sorted(set(depth.values()), reverse=True)
    return [[node.name for node in tree.nodes if depth.get(node.name) == level] for level in levels]


def _edge(boxes: dict[str, _Box], places: dict[str, tuple[float, float]], phi: str, psi: str) -> str:
    """Draw an arrow from the lower edge of one box to the upper edge of another."""
    if phi not in places or psi not in places:
        return ""
    x, y = places[phi][0] + boxes[phi].width / 2, places[phi][1] + boxes[phi].height
    u, v = places[psi][0] + boxes[psi].width / 2, places[psi][1]
    bend = f"M{x:.1f} {y:.1f} C{x:.1f} {y + GAP / 2:.1f} {u:.1f} {v - GAP / 2:.1f} {u:.1f} {v - 7:.1f}"
    head = f"{u - 5:.1f},{v - 8:.1f} {u + 5:.1f},{v - 8:.1f} {u:.1f},{v:.1f}"
    return f'<path class="edge" d="{bend}"/><polygon class="tip" points="{head}"/>'
