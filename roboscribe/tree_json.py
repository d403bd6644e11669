"""Subtask trees as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.printer import text
from roboscribe.errors import ArtifactError, RoboScribeError
from roboscribe.io.atomic import Json
from roboscribe.subtask_tree import Node, Tree


def tree_to_json(tree: Tree) -> dict[str, Json]:
    """Describe a tree; predicates are text."""
    return {"nodes": [node_to_json(node) for node in tree.nodes], "edges": [list(edge) for edge in tree.edges]}


def tree_from_json(value: Any, where: str = "tree") -> Tree:  # noqa: ANN401 - whatever JSON is found
    """Read what `tree_to_json` wrote.

    Raises:
        ArtifactError: it is something else.
    """
    try:
        nodes = tuple(node_from_json(node) for node in value["nodes"])
        edges = tuple((str(phi), str(psi)) for phi, psi in value["edges"])
    except (KeyError, TypeError, ValueError, RoboScribeError) as error:
        msg = f"{where}: found no subtask tree ({error}), expected nodes and edges"
        raise ArtifactError(msg) from error
    return Tree(nodes, edges)


def node_to_json(node: Node) -> dict[str, Json]:
    """Describe a node; its predicate is text."""
    return {
        "name": node.name,
        "predicate": text(node.predicate),
        "circular": node.circular,
        "scales": dict(node.scales),
        "over": node.over,
        "only": text(node.only),
        "afterwards": node.afterwards,
    }


def node_from_json(value: Mapping[str, Any]) -> Node:
    """Read what `node_to_json` wrote; whatever is wrong with it raises."""
    scales = {str(term): float(scale) for term, scale in value["scales"].items()}
    predicate, over = parse_predicate(value["predicate"]), str(value.get("over", ""))
    only = parse_predicate(value.get("only", "true"))
    afterwards = bool(value.get("afterwards", False))
    return Node(str(value["name"]), predicate, bool(value["circular"]), scales, over, only, afterwards)
