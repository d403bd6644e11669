"""GENPROGRAM (Algorithm 5) and conditionals (Sec. 4.5): from an abstract subtask tree to a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from roboscribe.dsl.rewrite import free_vars, fresh, rename, seq, walk
from roboscribe.dsl.syntax import (
    Get,
    Goal,
    If,
    Object,
    Predicate,
    Program,
    Robot,
    Run,
    Solved,
    Statement,
    Var,
    While,
)
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.loop_guard import entity_choice, order_condition, predicate_synthesis
from roboscribe.subtask_tree import ROOT, Node, Tree

OPAQUE = "R"
"""Name of the controller that is asked to reach ψ_R without any subgoal."""


def gen_program(goal: str, evidence: Evidence, tree: Tree, name: str = "P") -> Program | Fail:
    """Synthesize the program that reaches a goal node.

    Args:
        goal: name of the node ψ to reach.
        evidence: demonstrations, which decide the order of branches, loop guards and conditions.
        tree: T.
        name: what the program is called.

    Returns:
        Everything the tree asks for up to and including ψ; its controllers are named after the nodes they reach.
        Fail when no order, loop guard or condition explains the demonstrations.

    Source:  Algorithm 5, lines 1-4 (line 5, TRAINPROGRAM, is a step of its own in `synthesize`).
    Departs: the goal is an argument, and branches that the demonstrations finish before it are part of its program,
        for they are part of how it is reached. ψ_R gets a controller of its own only while it has no learned
        predecessor; afterwards the last controller acts on, as in Fig. 8 and 11.
    """
    writer = _Writer(evidence, tree, goal)
    body = writer.tree2program(tree.node(ROOT))
    if isinstance(body, Fail):
        return body
    gets = [
        Get(Var(v), kind, rename(entity_choice(evidence, entity), {entity: v}))
        for entity, (v, kind) in writer.straight.items()
        if v in free_vars(body)
    ]
    return Program(name, seq(*gets, body))


@dataclass
class _Writer:
    """Walks the tree once; knows which variable stands for which named entity and when the goal has been written."""

    evidence: Evidence
    tree: Tree
    goal: str
    straight: dict[str, tuple[str, str]] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    done: bool = False

    def tree2program(self, node: Node) -> Statement | Fail:
        """TREE2PROGRAM: the statements that reach a node.

        Source: Algorithm 5, lines 8-19.
        """
        body = self.predecessors(self.tree.predecessors(node.name))
        if isinstance(body, Fail) or (self.done and not node.circular):
            return body
        written = self.loop(node, body) if node.circular else seq(body, *self.run(node))
        self.done = self.done or node.name == self.goal
        return written

    def predecessors(self, nodes: Sequence[Node]) -> Statement | Fail:
        """Branches in the order in which the demonstrations finish them, or a condition where that order varies."""
        ordered = self.ordered(nodes)
        if ordered is None and len(nodes) == 2:
            return self.conditional(nodes[0], nodes[1])
        if ordered is None:
            names = ", ".join(node.name for node in nodes)
            return Fail(f"the demonstrations reach {names} in no consistent order, and only two can be told apart")
        parts: list[Statement] = []
        for node in ordered:
            if not self.done:
                part = self.tree2program(node)
                if isinstance(part, Fail):
                    return part
                parts.append(part)
        return seq(*parts)

    def ordered(self, nodes: Sequence[Node]) -> list[Node] | None:
        """Sort by i(D, φ), the step at which φ is reached (a circular φ: by its first entity); None if it varies."""
        first = {n.name: self.evidence.first_steps(n.lifted(self.evidence.types)) for n in nodes}
        ranked = sorted(nodes, key=lambda n: float(np.median(first[n.name])))
        pairs = pairwise(ranked)
        consistent = all(np.mean(first[a.name] < first[b.name]) >= 0.95 for a, b in pairs)
        return ranked if consistent else None

    def conditional(self, one: Node, other: Node) -> Statement | Fail:
        """`if (P) {one; other} else {other; one}` for two branches of varying order.

        Source: Sec. 4.5.
        """
        test = order_condition(self.evidence, one, other)
        if isinstance(test, Fail):
            return test
        both: list[Statement] = []
        reached = self.done
        for node in (one, other):
            self.done = False
            part = self.tree2program(node)
            if isinstance(part, Fail):
                return part
            both.append(part)
            reached = reached or self.done
        self.done = reached
        return If(rename(test, self.variables()), seq(both[0], both[1]), seq(both[1], both[0]))

    def loop(self, node: Node, body: Statement) -> Statement | Fail:
        """`while ((v := get(λv:τ. p)) ≠ null) {body; π_φ[φ]}` for a circular node, lines 13-16."""
        (entity,) = free_vars(node.predicate)
        guard = predicate_synthesis(self.evidence, self.tree, node)
        if isinstance(guard, Fail):
            return guard
        variable = self.variable(entity)
        kind = self.evidence.types[entity]
        del self.straight[entity]
        run = self.statement(node, {entity: variable})
        get = Get(Var(variable), kind, rename(guard, {entity: variable}))
        return While(get, seq(body, run))

    def run(self, node: Node) -> tuple[Statement, ...]:
        """`π_φ[φ]`, line 18; nothing for ψ_R once it has a predecessor."""
        if node.name == ROOT:
            return () if self.tree.predecessors(ROOT) else (self.opaque(),)
        return (self.statement(node, {e: self.variable(e) for e in free_vars(node.predicate)}),)

    def statement(self, node: Node, names: dict[str, str]) -> Run:
        """Build the controller statement; the controller may look at μ, the entities of φ and the goals in φ."""
        predicate = rename(node.predicate, names)
        return Run(node.name, _arguments(predicate), predicate)

    def opaque(self) -> Run:
        """Ask one controller for ψ_R at once; it sees μ and one entity of each type with its goal."""
        args: list[Object] = [Robot()]
        for kind in self.evidence.layout.types.values():
            entity = next(n for n, k in self.evidence.types.items() if k == kind.name)
            var = Var(self.variable(entity))
            args += [var, Goal(var)] if kind.goal else [var]
        return Run(OPAQUE, tuple(args), Solved())

    def variable(self, entity: str) -> str:
        """Name the variable that stands for a named entity."""
        if entity not in self.straight:
            kind = self.evidence.types[entity]
            name = fresh(self.evidence.layout.letter(kind), self.taken)
            self.taken.add(name)
            self.straight[entity] = (name, kind)
        return self.straight[entity][0]

    def variables(self) -> dict[str, str]:
        """Variable of every entity that has one."""
        return {entity: name for entity, (name, _) in self.straight.items()}


def _arguments(predicate: Predicate) -> tuple[Object, ...]:
    free = free_vars(predicate)
    goals = {n.of.name for n in walk(predicate) if isinstance(n, Goal) and n.of.name in free}
    args: list[Object] = [Robot()]
    for name in free:
        args += [Var(name), Goal(Var(name))] if name in goals else [Var(name)]
    return tuple(args)
