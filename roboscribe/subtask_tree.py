"""Abstract subtask trees: Definition 4.1, Algorithm 4 (UPDATETREE) and VALIDATE (Sec. 4.4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from roboscribe.dsl.rewrite import conjunction, free_vars
from roboscribe.dsl.syntax import Exists, Not, Or, Predicate, Solved, Truth, Var
from roboscribe.errors import Fail
from roboscribe.world.layout import IntArray
from roboscribe.world.trajectory import AGREEMENT

TRUE = "True"
ROOT = "ψ_R"


@dataclass(frozen=True)
class Node:
    """A node u_φ.

    Args:
        name: what programs call the controller that reaches it, for instance "hold".
        predicate: φ over named entities (b1); the entity stays free in circular nodes, see `lifted`.
        circular: whether the node marks a repetition (Sec. 4.2.2).
        scales: per term of φ, its spread over positives and negatives; scripted controllers take it for the unit of
            their margins, learned ones the spread over what they are shown, see `ProgramTraining.scales`.
        over: of circular nodes, the entity whose place all of its type take; "" for the only one.
        only: of circular nodes, which entities are meant.
        afterwards: whether it is turned to when all before it is done, wherever the robot has been till then: leaving.
    """

    name: str
    predicate: Predicate
    circular: bool = False
    scales: Mapping[str, float] = field(default_factory=dict)
    over: str = ""
    only: Predicate = field(default_factory=Truth)
    afterwards: bool = False

    @property
    def served(self) -> Predicate:
        """When nothing is left to do about an entity: φ holds, or it is not meant."""
        return self.predicate if self.only == Truth() else Or(self.predicate, Not(self.only))

    @property
    def role(self) -> str:
        """The entity that φ is about, of circular nodes the one whose place all of its type take."""
        return self.over or free_vars(self.predicate)[0]

    @property
    def entities(self) -> tuple[str, ...]:
        """Entities(φ): named entities that occur free; not that over which a circular node is quantified."""
        named = free_vars(self.predicate)
        return tuple(name for name in named if not (self.circular and name == self.role))

    def lifted(self, types: Mapping[str, str]) -> Predicate:
        """φ as it stands in the tree: existentially quantified in circular nodes."""
        if not self.circular:
            return self.predicate
        parts = [part for part in (self.only, self.predicate) if part != Truth()]
        return Exists(Var(self.role), types[self.role], conjunction(parts))

    def completed(self, types: Mapping[str, str]) -> Predicate:
        """Return what holds when the program has dealt with the node: φ, in circular nodes of every entity."""
        left = Not(self.served)
        return Not(Exists(Var(self.role), types[self.role], left)) if self.circular else self.predicate


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

    def successors(self, name: str) -> tuple[Node, ...]:
        """Nodes that a node leads to."""
        return tuple(self.node(b) for a, b in self.edges if a == name)

    def below(self, name: str) -> Iterator[Node]:
        """Every learned node from which `name` is reached, nearest first."""
        for node in self.predecessors(name):
            yield node
            yield from self.below(node.name)

    def above(self, name: str) -> Iterator[Node]:
        """Yield a node and every node that it leads to, nearest first."""
        yield self.node(name)
        for node in self.successors(name):
            yield from self.above(node.name)

    def loop_around(self, name: str) -> Node | None:
        """Return the circular node that `name` is, or that repeats `name` for each of its entities."""
        node = self.node(name)
        if node.circular:
            return node
        for loop in (n for n in self.nodes if n.circular):
            if loop.role in node.entities and any(n.name == name for n in self.below(loop.name)):
                return loop
        return None

    def replacing(self, node: Node) -> Tree:
        """Return the tree with another node in the place of the one of its name."""
        return Tree(tuple(node if old.name == node.name else old for old in self.nodes), self.edges)

    def without(self, name: str) -> Tree:
        """Return the tree without a node; what led to it leads to where it led."""
        into = [a for a, b in self.edges if b == name]
        out = [b for a, b in self.edges if a == name]
        kept = [edge for edge in self.edges if name not in edge]
        for psi in out:
            others = [a for a, b in kept if b == psi]
            new = [a for a in into if a != TRUE] or ([] if others else [TRUE])
            kept += [(a, psi) for a in new if a not in others]
        return Tree(tuple(node for node in self.nodes if node.name != name), tuple(kept))


@dataclass(frozen=True)
class Place:
    """Where a new node stands among the predecessors of its goal; found from the demonstrations.

    Args:
        before: the predecessor of the goal, or node below one, that the new node comes before; "" where it comes last.
        apart: whether the new node's loop is another phase than a loop over the same type that is there already.
    """

    before: str = ""
    apart: bool = False


def update_tree(tree: Tree, phi: Node, psi: str, place: Place | None = None) -> Tree:
    """Refine a tree with φ as a subgoal of ψ.

    Args:
        tree: T.
        phi: the new node; circular where it recurs for the entities of a type.
        psi: name of the goal ψ.
        place: where it stands among the subgoals that are there already.

    Returns:
        T[True ~φ~> ψ].

    Source:  Algorithm 4.
    Departs: the edge True → ψ is removed once ψ has a learned predecessor, for True is then reached through it. A φ
        about the entities of a predecessor stands before or after it, whichever the demonstrations show; φ is
        circular from the start where several entities satisfy it, and takes a predecessor's loop over; it takes no
        predecessor over that such a loop is about. What a loop needs but does not do for each of its entities precedes
        the loop; leaving comes after all that is there.
    """
    place = place or Place()
    loop = tree.loop_around(psi)
    if loop is not None and free_vars(phi.predicate) and loop.role not in free_vars(phi.predicate):
        return update_tree(tree, phi, tree.successors(loop.name)[0].name)
    nodes = (*tree.nodes, phi)
    if place.before:
        inserted = tuple((a, phi.name) if b == place.before else (a, b) for a, b in tree.edges)
        single = tuple(replace(n, circular=False) if n.name == phi.name else n for n in nodes)
        return Tree(single, (*inserted, (phi.name, place.before)))
    kept = tuple(edge for edge in tree.edges if edge != (TRUE, psi))
    if phi.afterwards or (not free_vars(phi.predicate) and any(old.circular for old in tree.predecessors(psi))):
        after_all = tuple((a, phi.name) if b == psi else (a, b) for a, b in kept)
        return Tree(nodes, (*after_all, (phi.name, psi)))
    for old in tree.predecessors(psi):
        if _alike(old, phi) and not place.apart and not _serves_a_loop(tree, old, phi, psi):
            plain = replace(old, circular=False) if phi.circular else old
            single = tuple(plain if n.name == old.name else n for n in nodes)
            rerouted = tuple((old.name, phi.name) if edge == (old.name, psi) else edge for edge in kept)
            return Tree(single, (*rerouted, (phi.name, psi)))
    return Tree(nodes, (*kept, (TRUE, phi.name), (phi.name, psi)))


def _alike(old: Node, phi: Node) -> bool:
    """Whether φ is about the entities of a predecessor."""
    mine = set(free_vars(phi.predicate))
    if phi.circular and old.circular:
        return phi.role == old.role
    return mine == set(free_vars(old.predicate)) or (old.circular and old.role in mine)


def _serves_a_loop(tree: Tree, old: Node, phi: Node, psi: str) -> bool:
    """Whether a loop before ψ is about what a predecessor brings about, a tool in the hand, say, which φ puts away."""
    loops = [node for node in tree.predecessors(psi) if node.circular]
    services = [part for loop in loops for part in (loop, *tree.below(loop.name))]
    mine = set(free_vars(old.predicate))
    return not (old.circular or phi.circular) and any(mine & set(free_vars(part.predicate)) for part in services)


def validate(tree: Tree, first_steps: Callable[[Node, str], tuple[IntArray, IntArray]]) -> Fail | None:
    """Check every edge of a tree against the demonstrations.

    Args:
        tree: T.
        first_steps: for φ and the name of ψ, the steps at which they first hold in each crossing into ψ, (C,) each.

    Returns:
        None when every edge advances the task, otherwise the reason.

    Source:  Sec. 4.4.
    Departs: φ ~> ψ is valid when φ holds once ψ first holds; the paper compares with φ's last step, which rejects its
        own Eq. 2. Entities that begin with ψ satisfied say nothing about what leads to ψ and do not vote.
    """
    for phi, psi in tree.edges:
        first, reached = first_steps(tree.node(phi), psi)
        if not len(reached):
            return Fail(f"no demonstration goes from not {psi} to {psi}")
        if np.mean(first <= reached) < AGREEMENT:
            return Fail(f"{phi} precedes {psi} in only {np.mean(first <= reached):.0%} of the demonstrations")
    return None
