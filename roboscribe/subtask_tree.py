"""Abstract subtask trees: Definition 4.1, Algorithm 4 (UPDATETREE) and VALIDATE (Sec. 4.4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from roboscribe.dsl.rewrite import alpha_equivalent, exist_quant, free_vars
from roboscribe.dsl.syntax import Not, Predicate, Solved, Truth
from roboscribe.errors import Fail
from roboscribe.world.layout import IntArray

TRUE = "True"
ROOT = "ψ_R"


@dataclass(frozen=True)
class Node:
    """A node u_φ.

    Args:
        name: what programs call the controller that reaches it, for instance "hold".
        predicate: φ over named entities (b1); the entity stays free in circular nodes, see `lifted`.
        circular: whether the node marks a repetition (Sec. 4.2.2).
        scales: per term of φ, the spread that makes its margins comparable in the reward (Sec. 4.3.3).
    """

    name: str
    predicate: Predicate
    circular: bool = False
    scales: Mapping[str, float] = field(default_factory=dict)

    @property
    def entities(self) -> tuple[str, ...]:
        """Entities(φ): named entities that occur free; none once the node is circular, for then φ is quantified."""
        return () if self.circular else free_vars(self.predicate)

    def lifted(self, types: Mapping[str, str]) -> Predicate:
        """φ as it stands in the tree: existentially quantified in circular nodes."""
        return exist_quant(self.predicate, types) if self.circular else self.predicate

    def completed(self, types: Mapping[str, str]) -> Predicate:
        """Return what holds when the program has dealt with the node: φ, in circular nodes of every entity."""
        return Not(exist_quant(Not(self.predicate), types)) if self.circular else self.predicate


@dataclass(frozen=True)
class Tree:
    """T = (N, E, ψ_R), inverted: edges lead towards the root. Edges are (φ, ψ) by node name, oldest first."""

    nodes: tuple[Node, ...] = (Node(TRUE, Truth()), Node(ROOT, Solved()))
    edges: tuple[tuple[str, str], ...] = ((TRUE, ROOT),)

    def node(self, name: str) -> Node:
        """Node by name; KeyError when there is none."""
        return {node.name: node for node in self.nodes}[name]

    def predecessors(self, name: str) -> tuple[Node, ...]:
        """Learned predecessors of a node, oldest first (`True` is left out)."""
        return tuple(self.node(a) for a, b in self.edges if b == name and a != TRUE)

    def below(self, name: str) -> Iterator[Node]:
        """Every learned node from which `name` is reached, nearest first."""
        for node in self.predecessors(name):
            yield node
            yield from self.below(node.name)


def update_tree(tree: Tree, phi: Node, psi: str, moved: Sequence[Node] = ()) -> Tree:
    """Refine a tree with φ as a subgoal of ψ.

    Args:
        tree: T.
        phi: the new node; a φ equivalent to a predecessor of ψ, or of its name, marks that predecessor as circular.
        psi: name of the goal ψ.
        moved: nodes of the tree whose predicates changed with φ.

    Returns:
        T[True ~φ~> ψ].

    Source:  Algorithm 4.
    Departs: the edge True → ψ is removed once ψ has a learned predecessor, for True is then reached through it.
    """
    for old in tree.predecessors(psi):
        if old.name == phi.name or alpha_equivalent(old.predicate, phi.predicate):
            again = replace(phi if old.name == phi.name else old, circular=True)
            changed = {node.name: node for node in (*moved, again)}
            return replace(tree, nodes=tuple(changed.get(n.name, n) for n in tree.nodes))
    nodes = (*tree.nodes, phi)
    kept = tuple(edge for edge in tree.edges if edge != (TRUE, psi))
    for old in tree.predecessors(psi):
        if set(old.entities) == set(phi.entities):
            rerouted = tuple((old.name, phi.name) if edge == (old.name, psi) else edge for edge in kept)
            return Tree(nodes, (*rerouted, (phi.name, psi)))
    return Tree(nodes, (*kept, (TRUE, phi.name), (phi.name, psi)))


NEVER = np.iinfo(np.int64).max
"""First step of a predicate that a demonstration never satisfies."""


def validate(tree: Tree, first_steps: Mapping[str, IntArray], share: float = 0.95) -> Fail | None:
    """Check every edge of a tree against the demonstrations.

    Args:
        tree: T.
        first_steps: for every node but True, the step at which its predicate first holds in each demonstration,
            shape (D,), NEVER where it does not; quantifiers instantiated over all entities of their type.
        share: part of the demonstrations that must agree with an edge.

    Returns:
        None when every edge advances the task, otherwise the reason.

    Source:  Sec. 4.4.
    Departs: φ ~> ψ is valid when φ first holds strictly before ψ first holds; the paper compares with φ's last step,
        which rejects its own Eq. 2. Demonstrations that begin with ψ satisfied say nothing about what leads to ψ
        and do not vote (unless they are more than a quarter).
    """
    for phi, psi in tree.edges:
        reached = first_steps[psi]
        if np.mean(reached == 0) > max(0.25, 1.0 - share):
            return Fail(f"{psi} already holds at the start of {np.mean(reached == 0):.0%} of the demonstrations")
        if np.mean(reached == NEVER) > 1.0 - share:
            return Fail(f"{psi} is never reached in {np.mean(reached == NEVER):.0%} of the demonstrations")
        votes = reached > 0
        if phi != TRUE and np.mean(first_steps[phi][votes] < reached[votes]) < share:
            agree = np.mean(first_steps[phi][votes] < reached[votes])
            return Fail(f"{phi} precedes {psi} in only {agree:.0%} of the demonstrations, expected {share:.0%}")
    return None
