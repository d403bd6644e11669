"""Adapting a program to demonstrations of another order: its loops choose other entities next, nothing else changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

from roboscribe.dsl.rewrite import controllers, free_vars, rename, seq
from roboscribe.dsl.syntax import Get, If, Predicate, Program, Run, Seq, Statement, While
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.loop_guard import predicate_synthesis
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree


@dataclass(frozen=True)
class Adapted:
    """A program with new guards.

    Args:
        program: P.
        guards: old and new guard of every loop over entities, in textual order.
    """

    program: Program
    guards: tuple[tuple[Get, Get], ...]


def adapt(program: Program, evidence: Evidence) -> Adapted | Fail:
    """Learn the guards of a program's loops again; bodies, predicates and controllers stay as they are.

    Args:
        program: P.
        evidence: demonstrations of the order that is wanted, of the objects that P speaks of.

    Returns:
        The program; Fail where it has no loop over entities, the demonstrations lack its objects, or no guard explains
        them.

    Source: Sec. 5.3, Push-Multi Confined: Algorithm 6 on the demonstrations of the other task.
    """
    guards: list[tuple[Get, Get]] = []

    def relearned(loop: While, get: Get) -> While | Fail:
        guard = loop_guard(loop, get, evidence)
        if isinstance(guard, Fail):
            return guard
        guards.append((get, replace(get, where=guard)))
        return replace(loop, guard=guards[-1][1])

    body = _with_loops(program.body, relearned)
    if isinstance(body, Fail):
        return body
    if not guards:
        return Fail(f"program {program.name} has no loop over entities: there is no guard to learn again")
    return Adapted(replace(program, body=body), tuple(guards))


def loop_guard(loop: While, get: Get, evidence: Evidence) -> Predicate | Fail:
    """Find the guard of one loop of a program: its last line says when an entity is done with.

    Returns:
        A predicate over the loop's variable.
    """
    names = [name for name, kind in evidence.types.items() if kind == get.type]
    runs = controllers(loop.body)
    if not names:
        return Fail(f"the loop over {get.var.name}:{get.type} has no object of this type in the demonstrations")
    if not runs or free_vars(runs[-1].until) != (get.var.name,):
        return Fail(f"the loop over {get.var.name}:{get.type} does not end by reaching something about it alone")
    role = {get.var.name: names[0]}
    nodes = [_node(run, role) for run in runs if free_vars(run.until) == (get.var.name,)]
    last = replace(nodes[-1], circular=True, over=names[0])
    chain = (*nodes[:-1], last)
    ranks = [TRUE, *(node.name for node in chain), ROOT]
    tree = Tree((*Tree().nodes, *chain), tuple(pairwise(ranks)))
    guard = predicate_synthesis(evidence, tree, last)
    return guard if isinstance(guard, Fail) else rename(guard, {names[0]: get.var.name})


def _node(run: Run, role: dict[str, str]) -> Node:
    """Return what a line reaches as a node about the entity that stands for the loop's variable."""
    return Node(run.controller, rename(run.until, role))


def _with_loops(statement: Statement, change: Callable[[While, Get], While | Fail]) -> Statement | Fail:
    """Return a statement with every outermost loop over entities changed."""
    match statement:
        case While(Get() as get, _):
            return change(statement, get)
        case While(_, body):
            inner = _with_loops(body, change)
            return inner if isinstance(inner, Fail) else replace(statement, body=inner)
        case If(_, then, otherwise):
            first, second = _with_loops(then, change), _with_loops(otherwise, change)
            if isinstance(first, Fail) or isinstance(second, Fail):
                return first if isinstance(first, Fail) else second
            return replace(statement, then=first, otherwise=second)
        case Seq(parts):
            changed: list[Statement] = []
            for part in parts:
                new = _with_loops(part, change)
                if isinstance(new, Fail):
                    return new
                changed.append(new)
            return seq(*changed)
        case Get() | Run():
            return statement
