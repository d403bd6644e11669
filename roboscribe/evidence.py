"""Demonstrations as the algorithms use them: once for every entity that plays a role, from takeover to crossing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from roboscribe.dsl.rewrite import free_vars, rename, uses_robot
from roboscribe.dsl.semantics import SolvedTest, holds
from roboscribe.dsl.syntax import Predicate, Solved
from roboscribe.dsl.types import named_entities
from roboscribe.subtask_tree import ROOT, Node, Tree
from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.naming import by_displacement
from roboscribe.world.trajectory import AGREEMENT, NEVER, Trajectory, first_true, restored

JITTER = 8.0
"""Times its usual step that a reading ranges over where it is more than noise about one place: a thousand readings of
noise range over seven."""


@dataclass(frozen=True)
class Passage:
    """A part of a demonstration in which one entity plays a role, perhaps under another name.

    Args:
        demonstration: index into `Evidence.trajectories`.
        begin: first frame: where the demonstration begins, or where the entity served before was finished.
        end: frame after the last one.
        order: entity `order[i]` is called i here, see `Layout.permute`.
    """

    demonstration: int
    begin: int
    end: int
    order: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Every time that demonstrations go from not ψ to ψ, whichever entity plays ψ's role.

    Args:
        frames: (S, F) frames of each crossing, from takeover to the first one on which ψ holds, one after the other.
        starts: (C,) where each crossing begins in `frames`.
        passages: which part of which demonstration each is.
    """

    frames: FloatArray
    starts: IntArray
    passages: tuple[Passage, ...]

    @property
    def lengths(self) -> IntArray:
        """Frames of each crossing, (C,)."""
        return np.diff(np.append(self.starts, len(self.frames)))

    @property
    def reached(self) -> FloatArray:
        """The states on which ψ first holds, (C, F)."""
        states: FloatArray = self.frames[self.starts + self.lengths - 1]
        return states

    @property
    def before(self) -> FloatArray:
        """P_s: the states right before, (C, F)."""
        states: FloatArray = self.frames[self.starts + self.lengths - 2]
        return states

    def first_steps(self, predicate: Predicate, layout: Layout, solved: SolvedTest) -> IntArray:
        """Step of each crossing, counted from takeover, on which a predicate first holds, (C,); NEVER where none."""
        return brought_about(predicate, holds(predicate, self.frames, {}, layout, solved), self.starts)


@dataclass(frozen=True, eq=False)
class Evidence:
    """D, the demonstrations, with the black box ψ_R.

    Args:
        trajectories: demonstrations in which one name plays one role, see `of`.
        solved: ψ_R.
        left_out: indices, among those given, of demonstrations that never reach ψ_R and are no evidence.
    """

    trajectories: tuple[Trajectory, ...]
    solved: SolvedTest
    left_out: tuple[int, ...] = ()

    @classmethod
    def of(cls, trajectories: Iterable[Trajectory], solved: SolvedTest) -> Evidence:
        """Name the entities of each demonstration by the order in which they are first displaced.

        Demonstrations that never reach ψ_R are left out, unless none does.
        """
        given = tuple(trajectories)
        failed = tuple(i for i, t in enumerate(given) if not solved(t.states).any())
        failed = () if len(failed) == len(given) else failed
        kept = (t for i, t in enumerate(given) if i not in failed)
        return cls(tuple(t.renamed(by_displacement(t)) for t in kept), solved, failed)

    @property
    def layout(self) -> Layout:
        """Meaning of the states."""
        return self.trajectories[0].layout

    @cached_property
    def types(self) -> dict[str, str]:
        """Type of every named entity."""
        return named_entities(self.layout)

    @cached_property
    def states(self) -> FloatArray:
        """All frames (S, F), one demonstration after the other."""
        return np.concatenate([t.states for t in self.trajectories])

    @cached_property
    def starts(self) -> IntArray:
        """Where each demonstration begins in `states`, (D,)."""
        lengths = [len(t) for t in self.trajectories]
        return np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64)

    @cached_property
    def moved(self) -> frozenset[str]:
        """Names of the entities of which some demonstration changes anything but the goal, by more than it jitters."""
        own = [(e, c) for (e, _, goal), c in self.layout.columns.items() if e != ROBOT and not goal]
        changed = np.any([_goes_places(t.states) for t in self.trajectories], axis=0)
        return frozenset(self.layout.names[e] for e, columns in own if changed[columns].any())

    @cached_property
    def solved_at(self) -> IntArray:
        """Step at which each demonstration first reaches ψ_R, (D,); NEVER where it does not."""
        return self.first_steps(Solved())

    def turns(self, node: Node) -> int:
        """Return for how many entities a node is brought about: all of a type where it is a loop's, else one."""
        return len(self.layout.of_type(self.types[node.role])) if node.circular else 1

    def truth(self, predicate: Predicate) -> BoolArray:
        """Whether a predicate about named entities holds, (S,)."""
        return holds(predicate, self.states, {}, self.layout, self.solved)

    def first_steps(self, predicate: Predicate) -> IntArray:
        """Step at which a predicate first holds in each demonstration, (D,); NEVER where it does not."""
        return brought_about(predicate, self.truth(predicate), self.starts)

    def each_first_steps(self, predicate: Predicate, name: str) -> IntArray:
        """Step at which a predicate about the entity `name` first holds of every entity of its type, (D, N)."""
        members = self.layout.of_type(self.types[name])
        found = [self.first_steps(rename(predicate, {name: self.layout.names[e]})) for e in members]
        return np.stack(found, axis=1)

    def passages(self, tree: Tree, name: str) -> tuple[Passage, ...]:
        """Return the parts of the demonstrations in which a node's entity plays its role.

        What a loop does for one entity it does for each: inside loops every entity that is served gives a passage, in
        which it goes by the name that the tree uses. Elsewhere every demonstration is one passage.
        """
        same = tuple(range(len(self.layout.entities)))
        loop = tree.loop_around(name)
        if loop is None:
            begins = np.maximum(self._when_all_before_is_done(tree, name), self._after_branches(tree, name))
            return tuple(
                Passage(d, int(b), len(t), same) for d, (b, t) in enumerate(zip(begins, self.trajectories, strict=True))
            )
        role, members = self.layout.names.index(loop.role), self.layout.of_type(self.types[loop.role])
        found = []
        for d, first in enumerate(self.each_first_steps(loop.served, loop.role)):
            begin = 0
            for rank in np.argsort(first, kind="stable"):
                if 0 < first[rank] < NEVER:
                    order = _swapped(same, role, members[rank])
                    found.append(Passage(d, begin, int(first[rank]) + 1, order))
                    begin = int(first[rank])
        return tuple(found)

    def _when_all_before_is_done(self, tree: Tree, name: str) -> IntArray:
        """Step at which each demonstration turns to a node, (D,); to leaving when all before it is done.

        What is said of no entity by name may be true by chance while a loop is under way.
        """
        begins, goal = np.zeros(len(self.trajectories), dtype=np.int64), tree.node(name)
        nameless = name != ROOT and not free_vars(goal.predicate) and any(node.circular for node in tree.below(name))
        before = tree.predecessors(name) if goal.afterwards or nameless else ()
        for node in before:
            over = self.first_steps(node.completed(self.types))
            begins = np.maximum(begins, np.where(over == NEVER, 0, over))
        return begins

    def _after_branches(self, tree: Tree, name: str) -> IntArray:
        """Step at which each demonstration turns to what restores a first state, (D,); 0 where nothing is restored.

        A drawer that is shut in the end was shut at first; whoever shuts it turns to it when all that comes before is
        done, and was at its handle long before.
        """
        begins = np.zeros(len(self.trajectories), dtype=np.int64)
        for node in tree.above(name):
            if node.name != ROOT and not node.circular and self.restores(node.predicate):
                begins = np.maximum(begins, self._done_beside(tree, node, self.first_steps(node.predicate)))
        return begins

    def turns_to_loop(self, tree: Tree, loop: Node) -> IntArray:
        """Step at which each demonstration turns to a loop, (D,): the branches that come before it are done."""
        begins = np.zeros(len(self.trajectories), dtype=np.int64)
        first = self.each_first_steps(loop.served, loop.role)
        own = np.where(first > 0, first, NEVER).min(axis=1)
        for node in tree.above(loop.name):
            begins = np.maximum(begins, self._done_beside(tree, node, own))
        return begins

    def _done_beside(self, tree: Tree, node: Node, own: IntArray) -> IntArray:
        """Step at which the last branch beside a node that is done before step `own` (D,) is done; 0 where none is."""
        begins = np.zeros(len(self.trajectories), dtype=np.int64)
        branches = (b for psi in tree.successors(node.name) for b in tree.predecessors(psi.name) if b != node)
        for over in (self.first_steps(branch.completed(self.types)) for branch in branches):
            begins = np.maximum(begins, np.where(over < own, over, 0))
        return begins

    def restores(self, predicate: Predicate) -> bool:
        """Whether what a predicate says of the world holds at first, is undone, and is brought about again."""
        at_first = self.truth(predicate)[self.starts]
        first = self.first_steps(predicate)
        return bool(np.mean(at_first & (first > 0) & (first < NEVER)) >= AGREEMENT)

    def crossings(self, tree: Tree, name: str) -> Crossings:
        """Return where the demonstrations go from not ψ to ψ; entities that satisfy ψ at takeover show nothing.

        Source:  P_s of Algorithm 2, line 6.
        Departs: only the first crossing of a passage counts, for noise makes later ones; in loops every entity counts.
        """
        predicate = tree.node(name).predicate
        parts: list[FloatArray] = []
        kept: list[Passage] = []
        for passage in self.passages(tree, name):
            states = self.states_of(passage)
            truth = holds(predicate, states, {}, self.layout, self.solved)
            if truth.any() and not truth[0]:
                parts.append(states[: int(truth.argmax()) + 1])
                kept.append(passage)
        lengths = [len(part) for part in parts]
        starts = np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64) if parts else np.empty(0, np.int64)
        frames = np.concatenate(parts) if parts else np.empty((0, self.layout.size))
        return Crossings(frames, starts, tuple(kept))

    def cut(self, crossings: Crossings, begins: IntArray) -> Crossings:
        """Return crossings from `begins` (C,) on, counted from takeover; those that are over by then are left out."""
        kept = np.flatnonzero(begins < crossings.lengths - 1)
        parts = [crossings.frames[crossings.starts[c] :][begins[c] : crossings.lengths[c]] for c in kept]
        lengths = np.array([len(part) for part in parts], dtype=np.int64)
        frames = np.concatenate(parts) if parts else crossings.frames[:0]
        return Crossings(frames, np.cumsum(lengths) - lengths, tuple(crossings.passages[c] for c in kept))

    def lasts(self, crossings: Crossings) -> FloatArray:
        """Return the last state of the passage that each crossing is part of, (C, F)."""
        states = [self.states_of(passage)[-1] for passage in crossings.passages]
        return np.stack(states) if states else crossings.reached

    def states_of(self, passage: Passage) -> FloatArray:
        """Return the frames of a passage (T, F), under its names."""
        states = self.trajectories[passage.demonstration].states[passage.begin : passage.end]
        return self.layout.permute(states, passage.order)

    def edge_steps(self, tree: Tree, phi: Node, psi: str) -> tuple[IntArray, IntArray]:
        """Return when φ and when ψ first hold in each crossing into ψ, as VALIDATE compares them; (C,) each.

        What was done when a demonstration turned to ψ comes before it, even if it has been undone: a drawer that was
        opened is shut when the hand leaves.
        """
        crossings = self.crossings(tree, psi)
        first = crossings.first_steps(phi.lifted(self.types), self.layout, self.solved)
        if tree.loop_around(psi) is None:
            over = self.first_steps(phi.completed(self.types))
            turned = [over[p.demonstration] <= p.begin for p in crossings.passages]
            first = np.where(turned, 0, first)
        return first, crossings.lengths - 1


def brought_about(predicate: Predicate, truth: BoolArray, starts: IntArray) -> IntArray:
    """Step at which a predicate with `truth` (S,) is brought about in each part from `starts` (C,) on; NEVER where not.

    What is said of the world and holds at first, but is undone on the way, may have to be restored; a hand only happens
    to be back.
    """
    return (first_true if uses_robot(predicate) else restored)(truth, starts)


def _swapped(order: Sequence[int], one: int, other: int) -> tuple[int, ...]:
    """Exchange two entities."""
    swapped = list(order)
    swapped[one], swapped[other] = order[other], order[one]
    return tuple(swapped)


def _goes_places(states: FloatArray) -> BoolArray:
    """Tell which numbers of a demonstration (T, F) do more than jitter about one place, (F,)."""
    steps = np.abs(np.diff(states, axis=0))
    usual = np.median(steps, axis=0) if len(steps) else np.zeros(states.shape[1])
    return np.asarray(np.ptp(states, axis=0) > JITTER * usual, np.bool_)
