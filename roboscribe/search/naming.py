"""Readable names for learned predicates. Names are for people: no algorithm looks at them."""

from __future__ import annotations

from roboscribe.dsl.rewrite import free_vars, uses_robot, walk
from roboscribe.dsl.syntax import Arctan2, Diff, Exists, Goal, Norm, Not, Predicate, Proj, Robot, Var


def name_predicate(predicate: Predicate, taken: set[str]) -> str:
    """Name a predicate by its shape: hold, at, reach, align, leave, open, or phi; numbered where taken."""
    name = _shape(predicate)
    numbered = (f"{name}{i}" for i in range(2, len(taken) + 3))
    return name if name not in taken else next(n for n in numbered if n not in taken)


def _shape(predicate: Predicate) -> str:
    nodes = list(walk(predicate))
    if any(isinstance(n, Arctan2) for n in nodes):
        return "align"
    if isinstance(predicate, Not) and isinstance(predicate.of, Exists) and uses_robot(predicate):
        return "leave"
    pairs = [{type(n.of.left.of), type(n.of.right.of)} for n in nodes if _compares_objects(n)]
    for pair, name in (({Robot, Var}, "hold"), ({Var, Goal}, "at"), ({Robot, Goal}, "reach")):
        if pair in pairs and len(free_vars(predicate)) <= 1:
            return name
    fields = {n.field for n in nodes if isinstance(n, Proj) and isinstance(n.of, Var)}
    return "open" if "opening" in fields else "phi"


def _compares_objects(node: object) -> bool:
    return (
        isinstance(node, Norm)
        and isinstance(node.of, Diff)
        and isinstance(node.of.left, Proj)
        and isinstance(node.of.right, Proj)
    )
