"""Readable names for learned predicates. Names are for people: no algorithm looks at them."""

from __future__ import annotations

from roboscribe.dsl.rewrite import Node, conjuncts, free_vars, uses_robot, walk
from roboscribe.dsl.syntax import Arctan2, Diff, Exists, Goal, Greater, Norm, Not, Object, Predicate, Proj, Robot, Var


def name_predicate(predicate: Predicate, taken: set[str]) -> str:
    """Name a predicate by its shape: hold, at, reach, align, leave, open, or phi; numbered where taken."""
    name = _shape(predicate)
    numbered = (f"{name}{i}" for i in range(2, len(taken) + 3))
    return name if name not in taken else next(n for n in numbered if n not in taken)


def _shape(predicate: Predicate) -> str:
    """Look at the last conjunct: that is what a conjunction adds to a predecessor."""
    predicate = (predicate, *conjuncts(predicate))[-1]
    nodes = list(walk(predicate))
    if any(isinstance(n, Arctan2) for n in nodes):
        return "align"
    away = isinstance(predicate, Not) and isinstance(predicate.of, Exists)
    if uses_robot(predicate) and (away or (isinstance(predicate, Greater) and isinstance(predicate.left, Norm))):
        return "leave"
    pairs = [_compared(n) for n in nodes]
    for pair, name in (({Robot, Var}, "hold"), ({Var, Goal}, "at"), ({Robot, Goal}, "reach")):
        if pair in pairs and len(free_vars(predicate)) <= 1:
            return name
    fields = {n.field for n in nodes if isinstance(n, Proj) and isinstance(n.of, Var)}
    return "open" if "opening" in fields else "phi"


def _compared(node: Node) -> set[type[Object]]:
    """Kinds of the two objects whose distance a node is; empty for other nodes."""
    match node:
        case Norm(Diff(Proj(one, _), Proj(other, _))):
            return {type(one), type(other)}
        case _:
            return set()
