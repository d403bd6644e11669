"""A picture of a subtask tree."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill

from roboscribe.dsl.printer import text
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree


def places(tree: Tree) -> dict[str, tuple[float, float]]:
    """Place every node: x its longest distance to the root, negated; y its rank among the nodes at that distance."""
    depth = {ROOT: 0}
    for _ in tree.nodes:
        for phi, psi in tree.edges:
            if psi in depth:
                depth[phi] = max(depth.get(phi, 0), depth[psi] + 1)
    columns: dict[int, list[str]] = {}
    for node in tree.nodes:
        columns.setdefault(depth.get(node.name, 0), []).append(node.name)
    return {
        name: (-float(column), (len(names) - 1) / 2 - rank)
        for column, names in columns.items()
        for rank, name in enumerate(names)
    }


def draw_tree(tree: Tree, path: Path) -> None:
    """Write a tree as PNG: edges lead to the right, circular nodes have a double frame."""
    from matplotlib.figure import Figure

    where = places(tree)
    width = 1 + max(-x for x, _ in where.values())
    height = 1 + 2 * max(abs(y) for _, y in where.values())
    figure = Figure(figsize=(3.0 * width, 1.6 * height + 0.4), dpi=110)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(-width + 0.4, 0.6)
    axes.set_ylim(-height / 2, height / 2)
    for phi, psi in tree.edges:
        arrow = {"arrowstyle": "-|>", "color": "0.3", "shrinkA": 42, "shrinkB": 42}
        axes.annotate("", where[psi], where[phi], arrowprops=arrow)
    for node in tree.nodes:
        colour = "#fff3c4" if node.circular else "#e8f0fe"
        box = {"boxstyle": "round,pad=0.5", "facecolor": colour, "linewidth": 1 + 2 * node.circular}
        axes.text(*where[node.name], _label(node), ha="center", va="center", fontsize=9, bbox=box, parse_math=False)
    figure.savefig(path, metadata={"Software": None})


def _label(node: Node) -> str:
    if node.name in (TRUE, ROOT):
        return node.name
    sign = " ⟳" if node.circular else ""
    return f"{node.name}{sign}\n{fill(text(node.predicate), 30)}"
