"""GENPROGRAM (Algorithm 5) and conditionals (Sec. 4.5): from an abstract subtask tree to a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations

import numpy as np

from roboscribe.branch_condition import finish_both, order_condition
from roboscribe.branch_threshold import left_behind
from roboscribe.dsl.rewrite import conjunction, free_vars, fresh, rename, seq, walk
from roboscribe.dsl.syntax import (
    Get,
    Goal,
    Greater,
    If,
    Less,
    Not,
    Object,
    Or,
    Predicate,
    Program,
    Robot,
    Run,
    Seq,
    Solved,
    Statement,
    Truth,
    Var,
    While,
)
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.loop_guard import entity_choice, predicate_synthesis
from roboscribe.subtask_tree import ROOT, Node, Tree
from roboscribe.world.layout import IntArray
from roboscribe.world.trajectory import AGREEMENT

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
        repeats = node.circular and not _is_choice(node, self.evidence)
        outside = self.straight.pop(node.role, None) if repeats else None  # a loop's variable is its own
        body = self.predecessors(node.name)
        if isinstance(body, Fail) or (self.done and not repeats):
            return body
        written = self.loop(node, body) if repeats else seq(body, *self.run(node))
        if outside is not None:
            self.straight[node.role] = outside
        self.done = self.done or node.name == self.goal
        return written

    def predecessors(self, psi: str) -> Statement | Fail:
        """Branches in the order in which the demonstrations finish them; conditions where that order has a reason."""
        parts: list[Statement] = []
        nodes = self.tree.predecessors(psi)
        if not nodes:
            return Seq()
        order = branch_order(self.evidence, nodes)
        crossings = self.evidence.crossings(self.tree, psi)
        for group in order.groups:
            if not self.done:
                part = self.group([left_behind(node, crossings, self.evidence) for node in group], order)
                if isinstance(part, Fail):
                    return part
                parts.append(part)
        return seq(*parts)

    def group(self, nodes: Sequence[Node], order: Order) -> Statement | Fail:
        """Write branches whose order varies together: one alone, two as if / else, more as guarded branches.

        Of two branches both are written where the goal is in one of them, for either may come before it; of more, where
        it is what one of them ends with, for a guard asks whether a branch is done. Else they are written up to it, in
        the order that is seen most.
        """
        branches: list[Statement] = []
        for node in nodes:
            reached, self.done = self.done, False
            branch = self.tree2program(node)
            if isinstance(branch, Fail):
                return branch
            branches.append(branch)
            if len(nodes) > 2 and self.done and node.name != self.goal:
                return seq(*branches)
            self.done = self.done or reached
        depending = [_is_choice(node, self.evidence) for node in nodes]
        if all(depending):
            return self.alternatives(nodes, branches)
        branches = [
            self.alternatives([node], [branch]) if depends else branch
            for node, branch, depends in zip(nodes, branches, depending, strict=True)
        ]
        if len(nodes) == 1:
            return branches[0]
        if len(nodes) == 2:
            test = order.conditions[nodes[0].name, nodes[1].name]
            return If(self.about(test), seq(*branches), seq(*reversed(branches)))
        return self.guarded(nodes, branches, order)

    def alternatives(self, nodes: Sequence[Node], branches: Sequence[Statement]) -> Statement:
        """`if (P1) S1 else if (P2) S2 ...`: which branch is taken depends on what the only entity of a type is like.

        Departs: Sec. 4.5 takes every branch in some order.
        """
        pairs = list(zip(nodes, branches, strict=True))
        body: Statement = Seq()
        if len(pairs) == 2 and _are_opposite(nodes[0].only, nodes[1].only):
            _, body = pairs.pop()
        for node, branch in reversed(pairs):
            body = If(self.about(node.only), branch, body)
        return body

    def guarded(self, nodes: Sequence[Node], branches: Sequence[Statement], order: Order) -> Statement:
        """`while (some branch is left) {if (P1) S1 else if (P2) S2 ... else Sn}`, the first that none must precede.

        Departs: Sec. 4.5 has two branches; conditions between pairs order any number of them.
        """
        done = {node.name: node.completed(self.evidence.types) for node in nodes}
        body = branches[-1]
        for node, branch in reversed(list(zip(nodes[:-1], branches[:-1], strict=True))):
            waits = [_waits_for(order, node, other, done) for other in nodes if other != node]
            first = conjunction([Not(done[node.name]), *(p for p in waits if p != Truth())])
            body = If(self.about(first), branch, body)
        return While(self.about(Not(conjunction(list(done.values())))), body)

    def loop(self, node: Node, body: Statement) -> Statement | Fail:
        """`while ((v := get(λv:τ. p)) ≠ null) {body; π_φ[φ]}` for a circular node, lines 13-16.

        Where the goal lies within the loop it is sought for the first entity alone.
        """
        entity = node.role
        guard = predicate_synthesis(self.evidence, self.tree, node)
        if isinstance(guard, Fail):
            return guard
        names = {
            name: self.variable(name) for name in dict.fromkeys((entity, *free_vars(node.predicate), *free_vars(guard)))
        }
        run = self.statement(node, {name: names[name] for name in free_vars(node.predicate)})
        del self.straight[entity]
        get = Get(Var(names[entity]), self.evidence.types[entity], rename(guard, names))
        return seq(get, body) if self.done else While(get, seq(body, run))

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

    def about(self, condition: Predicate) -> Predicate:
        """Say a condition about variables instead of named entities."""
        return rename(condition, {entity: self.variable(entity) for entity in free_vars(condition)})


@dataclass(frozen=True)
class Order:
    """The order of branches.

    Args:
        groups: branches one after the other; those whose order varies with a reason are together.
        conditions: for pairs of names, when the first comes before the second.
    """

    groups: tuple[tuple[Node, ...], ...]
    conditions: Mapping[tuple[str, str], Predicate]


def branch_order(evidence: Evidence, nodes: Sequence[Node]) -> Order:
    """Sort branches by i(D, φ), the step at which each is finished (a circular φ: by its first entity).

    Source:  Algorithm 5, line 10; Sec. 4.5.
    Departs: where the order varies and no condition tells why, any order will do, and the one that most demonstrations
        show is taken. Demonstrations that finish one of two branches alone do not vote; branches of which all do either
        one or the other are together.
    """
    first = {n.name: evidence.first_steps(n.lifted(evidence.types)) for n in nodes}
    ahead = {(a.name, b.name): _ahead(first[a.name], first[b.name]) for a, b in permutations(nodes, 2)}
    ranked = sorted(nodes, key=lambda n: -sum(ahead[n.name, o.name] for o in nodes if o != n))
    varied = [
        (one, other)
        for one, other in combinations(ranked, 2)
        if 1.0 - AGREEMENT < ahead[one.name, other.name] < AGREEMENT
    ]
    conditions: dict[tuple[str, str], Predicate] = {}
    apart = {
        (a.name, b.name)
        for a, b in permutations(nodes, 2)
        if _is_choice(a, evidence) and _is_choice(b, evidence) and not finish_both(first[a.name], first[b.name]).any()
    }
    for one, other in (pair for pair in varied if (pair[0].name, pair[1].name) not in apart):
        chosen = _chosen(first, one.name, other.name)
        there, back = (order_condition(evidence, *pair, chosen) for pair in ((one, other), (other, one)))
        if not isinstance(there, Fail) and not isinstance(back, Fail):
            conditions[one.name, other.name], conditions[other.name, one.name] = there, back
    groups: list[tuple[Node, ...]] = []
    for node in ranked:
        tied = [i for i, g in enumerate(groups) if any((o.name, node.name) in conditions.keys() | apart for o in g)]
        joined = tuple(n for g in groups[tied[0] :] for n in g) if tied else ()
        groups = [*(groups[: tied[0]] if tied else groups), (*joined, node)]
    return Order(tuple(groups), conditions)


def _ahead(one: IntArray, other: IntArray) -> float:
    """Return the share of the demonstrations that finish one of two branches first, among those that finish both."""
    both = finish_both(one, other)
    return float(np.mean(one[both] < other[both])) if both.any() else 0.5


def _is_choice(node: Node, evidence: Evidence) -> bool:
    """Tell whether a circular node is about the only entity of its type: it is done or not, and never again."""
    return node.circular and len(evidence.layout.of_type(evidence.types[node.role])) == 1


def _chosen(first: Mapping[str, IntArray], one: str, other: str) -> IntArray:
    """Return the step of each demonstration (D,) at which the first of two branches is chosen.

    That is when the last of all others that are finished before it is.

    Args:
        first: by branch, the step at which each demonstration finishes it.
        one: a branch.
        other: another one.
    """
    end = np.minimum(first[one], first[other])
    chosen: IntArray = np.max([np.where(steps < end, steps, 0) for steps in first.values()], axis=0)
    return chosen


def _waits_for(order: Order, node: Node, other: Node, done: Mapping[str, Predicate]) -> Predicate:
    """Say when `node` need not wait for `other`: it is done, or comes later."""
    names = [n.name for group in order.groups for n in group]
    earlier = order.conditions.get((node.name, other.name))
    if earlier is not None:
        return Or(done[other.name], earlier)
    return Truth() if names.index(node.name) < names.index(other.name) else done[other.name]


def _are_opposite(one: Predicate, other: Predicate) -> bool:
    """Tell whether two predicates are the two sides of one threshold."""
    match one, other:
        case (Less(term, bound), Greater(left, right)) | (Greater(left, right), Less(term, bound)):
            return (term, bound) == (left, right)
        case _:
            return False


def _arguments(predicate: Predicate) -> tuple[Object, ...]:
    free = free_vars(predicate)
    goals = {n.of.name for n in walk(predicate) if isinstance(n, Goal) and n.of.name in free}
    args: list[Object] = [Robot()]
    for name in free:
        args += [Var(name), Goal(Var(name))] if name in goals else [Var(name)]
    return tuple(args)
