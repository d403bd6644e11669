"""PREDICATESYNTHESIS (Algorithm 6): which entity a loop must take next, read off the demonstrations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from roboscribe.dsl.fields import components, same_measure
from roboscribe.dsl.rewrite import conjunction, free_vars, negation_normal_form, rename, walk
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import (
    Goal,
    Less,
    Norm,
    Object,
    Predicate,
    Proj,
    Term,
    Truth,
    Var,
)
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.search.differences import differences, landmarks
from roboscribe.search.topdown import (
    Atoms,
    Literal,
    Situations,
    enumerate_conjunctions,
    strictest_literal,
    top_down_enum,
)
from roboscribe.subtask_tree import Node, Tree
from roboscribe.world.layout import Attribute, BoolArray, FloatArray, IntArray, ObjectType
from roboscribe.world.trajectory import AGREEMENT, NEVER

TOLERANCE = 0.02
"""Share of positive, and of negative, examples on which a guard may err: a subgoal flickers while it is reached."""
CHOICE_TOLERANCE = 1.0 - AGREEMENT
"""The same for choices: now and then a demonstrator brushes another entity first."""
MOST_EXAMPLES = 6_000
"""Examples beyond this many are thinned evenly."""
MOST_SITUATIONS = 400
"""The same of situations in which somebody has to be admitted."""
BROKEN = 20.0
"""A sign of order counts where entities taken at random would have broken it this often, and hardly any did."""


@dataclass(frozen=True, eq=False)
class Examples:
    """(s_t, e_i) pairs of all demonstrations.

    Args:
        source: (S, F) all states.
        frames: (X,) row of s_t in `source`.
        entities: (X,) index of e_i.
        positive: (X,) e_i is being handled in s_t.
        done: (X,) e_i was handled before s_t; of the negatives, those that show termination.
        choice: (X,) in s_t the demonstrator turns to another entity, and e_i is it or could have been; also where it is
            the last one and nobody waits, for a guard has to admit it.
    """

    source: FloatArray
    frames: IntArray
    entities: IntArray
    positive: BoolArray
    done: BoolArray
    choice: BoolArray

    @cached_property
    def states(self) -> FloatArray:
        """Every s_t, (X, F); gathered only when asked for, since a state stands in as many examples as entities."""
        return self.source[self.frames]

    def __getitem__(self, rows: BoolArray | IntArray) -> Examples:
        """Select examples."""
        return Examples(
            self.source,
            self.frames[rows],
            self.entities[rows],
            self.positive[rows],
            self.done[rows],
            self.choice[rows],
        )

    def with_others(self, frames: IntArray, entities: IntArray) -> Examples:
        """Add pairs (W,) of which nothing is said."""
        nothing = np.zeros(len(frames), dtype=np.bool_)
        labels = (np.concatenate([label, nothing]) for label in (self.positive, self.done, self.choice))
        return Examples(
            self.source, np.concatenate([self.frames, frames]), np.concatenate([self.entities, entities]), *labels
        )

    def thinned(self) -> Examples:
        """Leave out examples evenly, but for choices, where there are too many."""
        kept = self.choice.copy()
        kept[:: len(kept) // MOST_EXAMPLES + 1] = True
        return self[kept]


def predicate_synthesis(evidence: Evidence, tree: Tree, node: Node) -> Predicate | Fail:
    """Find the guard of a loop over the entities of a circular node.

    Args:
        evidence: demonstrations.
        tree: T, whose learned predicates about one entity are atoms of the search.
        node: the circular node ∃o.φ.

    Returns:
        A predicate over φ's free entity, true of those that may be handled now; Fail when nothing in the grammar
        tells even the handled from the unhandled.

    Source:  Algorithm 6.
    Departs: examples come from all demonstrations and every e_i is explained by one predicate over the variable,
        so that the guard does not fit one demonstration's accidents. Where no predicate explains the whole order, the
        guard encodes termination and as much order as the demonstrations show.
    """
    begins = evidence.turns_to_loop(tree, node)
    examples = loop_examples(evidence, node.served, node.role, begins).thinned()
    if not examples.positive.any():
        return Fail(f"no demonstration handles entities one after another until {node.name}")
    if examples.positive.all():
        return Truth()
    entity, nodes = node.role, (node, *tree.below(node.name))
    learned = tuple(dict.fromkeys(n.served for n in nodes if entity in free_vars(n.predicate)))
    ended = examples[examples.positive | examples.done]
    termination = top_down_enum(guard_atoms(ended, evidence, entity, learned), ended.positive, TOLERANCE)
    if termination is None:
        return Fail(f"no loop guard separates handled entities from unhandled ones for {node.name}")
    guard = conjunction([termination, *order_of(examples, evidence, node, learned)])
    return guard if node.only == Truth() else negation_normal_form(guard)


def order_of(examples: Examples, evidence: Evidence, node: Node, learned: Sequence[Predicate]) -> tuple[Predicate, ...]:
    """Find what tells the entity that demonstrators turn to next from those that wait.

    Args:
        examples: labelled pairs.
        evidence: demonstrations.
        node: the circular node, whose role an example's entity plays.
        learned: predicates about it alone.

    Returns:
        A predicate that explains the choices, where it is shorter, its exceptions included, than a list of them would
        be, else what `partial_order` finds; nothing where the demonstrations show no order.

    Departs: an order has to admit somebody whenever anybody waits, not only where demonstrators chose: a program that
        finds nobody ends.
    """
    shown = examples[examples.choice]
    if shown.positive.all():
        return ()
    waiting = _waiting(examples, evidence, node)
    several, situations = _beside_others(shown, waiting)
    of_each = np.unique(shown.frames, return_counts=True)[1]
    found = enumerate_conjunctions(
        guard_atoms(several, evidence, node.role, learned, moving=True),
        several.positive,
        CHOICE_TOLERANCE,
        exception_bits=float(np.log2((of_each > 1).sum())) / 2,  # whoever chooses otherwise leaves one and takes one
        most_bits=float(np.log2(of_each).sum()),
        situations=situations,
    )
    return partial_order(examples, waiting, evidence, node.role, learned) if found.best is None else (found.best,)


def _beside_others(shown: Examples, waiting: tuple[IntArray, IntArray]) -> tuple[Examples, Situations]:
    """Add those who wait, frames and entities (W,), which are no examples, and tell who stands side by side."""
    several = shown.with_others(*waiting)
    ranks = np.unique(several.frames, return_inverse=True)[1]
    return several, Situations(ranks, np.arange(len(ranks)) < len(shown.frames), TOLERANCE)


def _waiting(examples: Examples, evidence: Evidence, node: Node) -> tuple[IntArray, IntArray]:
    """Return who waits in some of the situations of the examples, taken evenly: frames and entities, (W,) each.

    What was done and is undone again waits, too, though it is no example of an order.
    """
    frames = np.unique(examples.frames[~examples.done])
    frames = frames[:: len(frames) // MOST_SITUATIONS + 1]
    members = np.array(evidence.layout.of_type(evidence.types[node.role]))
    frames, entities = np.repeat(frames, len(members)), np.tile(members, len(frames))
    binding = {node.role: entities}
    waits = ~holds(node.served, examples.source[frames], binding, evidence.layout, evidence.solved)
    return frames[waits], entities[waits]


def partial_order(
    examples: Examples,
    waiting: tuple[IntArray, IntArray],
    evidence: Evidence,
    entity: str,
    learned: Sequence[Predicate],
) -> tuple[Predicate, ...]:
    """Find what demonstrators heed whenever they turn to another entity, where it leaves some of them to chance.

    Args:
        examples: labelled pairs.
        waiting: frames and entities (W,) of whom somebody has to be admitted.
        evidence: demonstrations, for layout and types.
        entity: v, the name that stands for the entity that an example is about.
        learned: predicates about it alone.

    Returns:
        The literal true of all that are handled and false of the most that wait; none where choices by lot would
        hardly ever have broken it.
    """
    shown = examples[examples.positive | examples.choice]
    several, situations = _beside_others(shown, waiting)
    atoms = guard_atoms(several, evidence, entity, learned)
    order = strictest_literal(atoms, several.positive, TOLERANCE, situations, several.positive & several.choice)
    turns = np.unique(shown.frames[shown.choice & ~shown.positive]).size
    broken = turns * order.refused
    return (order.predicate,) if broken >= BROKEN else ()


def entity_choice(evidence: Evidence, entity: str) -> Predicate:
    """Find what tells the entity that plays a role from the others of its type at the start of a demonstration.

    Args:
        evidence: demonstrations, in which `entity` names the same role.
        entity: its name.

    Returns:
        A predicate over `entity`; True where it is the only one, or nothing in the grammar tells it apart.

    Departs: the paper's straight-line programs take any entity, with which the demonstrations need not have begun.
    """
    layout, starts = evidence.layout, evidence.states[evidence.starts]
    members = np.array(layout.of_type(evidence.types[entity]), dtype=np.int64)
    entities = np.tile(members, len(starts))
    positive = entities == layout.names.index(entity)
    frames = np.repeat(np.arange(len(starts)), len(members))
    shown = Examples(starts, frames, entities, positive, ~positive, np.ones_like(positive))
    if positive.all():
        return Truth()
    atoms = guard_atoms(shown, evidence, entity, ())
    alike = replace(atoms, outer=tuple(filter(_alike, atoms.outer)), inner=tuple(filter(_alike, atoms.inner)))
    return top_down_enum(alike, positive, CHOICE_TOLERANCE) or Truth()


def _alike(literal: Literal) -> bool:
    """Whether goals are compared with goals, and objects with objects: at rest the others differ by noise alone."""
    return len({type(part.of) for part in walk(literal.predicate) if isinstance(part, Proj)}) == 1


def loop_examples(evidence: Evidence, phi: Predicate, name: str, begins: IntArray) -> Examples:
    """Label every (state, entity of the type of `name`): positive while it is handled, negative before and after.

    Segment S_i ends when e_i first satisfies φ and begins where S_{i-1} ended, the first where the demonstration turns
    to the loop, at `begins` (D,): of what comes before that nothing is said. Entities that satisfy φ from the
    start are never handled; one that never satisfies φ is being handled when the demonstration ends; demonstrations
    in which several do not show nothing and are left out. Where what was done is undone again, by a push in passing,
    the entity is no example, and no choice is made: whoever goes on to another one has not seen it.

    Source: Algorithm 6, lines 3-12.
    """
    members = evidence.layout.of_type(evidence.types[name])
    first = evidence.each_first_steps(phi, name).T
    counts = np.array([len(t) for t in evidence.trajectories])
    unserved = (first == NEVER).sum(axis=0)
    first = np.where((first == NEVER) & (unserved == 1), counts, first)
    lengths = [n if max(f) < NEVER else 0 for n, f in zip(counts.tolist(), first.T, strict=True)]
    shown = zip(evidence.starts, begins, lengths, first.T, strict=True)
    parts = [_label(*each, members) for each in shown]
    frames, entities, positive, done, choice = (np.concatenate(column) for column in zip(*parts, strict=True))
    examples = Examples(evidence.states, frames, entities, positive, done, choice)
    undone = done & ~holds(phi, examples.states, {name: entities}, evidence.layout, evidence.solved)
    settled = ~np.isin(frames, frames[undone])
    return replace(examples, choice=choice & settled)[~undone]


def _label(
    start: int, turned: int, length: int, first: IntArray, members: tuple[int, ...]
) -> tuple[IntArray, IntArray, BoolArray, BoolArray, BoolArray]:
    """Label every frame of a demonstration, once it has `turned` to the loop, with every entity.

    Args:
        start: row of its first frame.
        turned: step at which it turns to the loop.
        length: how many frames are labelled; 0 where it shows nothing.
        first: (N,) when each entity satisfied φ.
        members: index of each.

    Returns:
        Frame, entity, "is being handled", "was handled" and "could be chosen" of every pair.
    """
    ends = np.sort(first)
    begins = np.maximum(turned, [0, *ends[:-1]])
    shown = np.arange(min(turned, length), length)
    steps = np.tile(shown, len(members))
    begin, end = (np.repeat(x, len(shown)) for x in (begins[np.searchsorted(ends, first)], first))
    choice = np.isin(steps, begins) & (steps < end)
    return start + steps, np.repeat(members, len(shown)), (steps >= begin) & (steps < end), steps >= end, choice


LEARNED_COST = 1
COMPARISON_COST = 2
RELATION_COST = 3
"""Costs of a learned predicate, of a comparison of two numbers of objects, and of two distances."""


def guard_atoms(
    examples: Examples, evidence: Evidence, entity: str, learned: Sequence[Predicate], *, moving: bool = False
) -> Atoms:
    """Tabulate the atoms of a guard: learned predicates, and comparisons of attributes of entities and goals.

    Args:
        examples: where the atoms are evaluated.
        evidence: demonstrations, for layout and types.
        entity: v, the name that stands for the entity that an example is about.
        learned: predicates about it alone.
        moving: whether distances to the robot, to goals and to what has no like are compared, too, which only matter
            where a choice is made.

    Returns:
        Atoms about v, and, for every entity v' of its type, about v' and about both.
    """
    kind, layout = evidence.types[entity], evidence.layout
    other = f"{layout.letter(kind)}'"
    own = [(p, LEARNED_COST) for p in learned] + [(p, COMPARISON_COST) for p in _comparisons(evidence, (entity,))]
    both = [(p, COMPARISON_COST) for p in _comparisons(evidence, (entity, other)) if len(free_vars(p)) == 2]
    both += [(p, RELATION_COST) for p in _relations(evidence, entity, other)] if moving else []

    def truth(p: Predicate, others: int | None = None) -> BoolArray:
        binding: dict[str, IntArray | int] = {entity: examples.entities}
        if others is not None:
            binding[other] = others
        return holds(p, examples.states, binding, layout)

    members = layout.of_type(kind)
    inner = [(rename(p, {entity: other}), cost) for p, cost in own] + both
    return Atoms(
        outer=tuple(Literal(p, cost, truth(p)) for p, cost in own),
        inner=tuple(Literal(p, cost, np.stack([truth(p, e) for e in members])) for p, cost in inner),
        var=Var(other),
        kind=kind,
    )


def _comparisons(evidence: Evidence, names: tuple[str, ...]) -> Iterator[Predicate]:
    """α < α over single numbers of one attribute of the entities `names` (all of one type) and of their goals."""
    kind = evidence.layout.types[evidence.types[names[0]]]
    for attribute in (a for a in kind.attributes if a.is_place):
        ends: list[tuple[Object, Attribute]] = [
            (Goal(Var(n)), g) for n in names for g in kind.goal if same_measure(g, attribute)
        ]
        ends += [(Var(n), attribute) for n in names]
        for (one, of_one), (two, of_two) in product(ends, repeat=2):
            if one != two:
                pairs = zip(components(one, kind, of_one), components(two, kind, of_two), strict=True)
                yield from (Less(a, b) for a, b in pairs)


def _relations(evidence: Evidence, entity: str, other: str) -> Iterator[Predicate]:
    """One entity, or its goal, is nearer than the other to the robot, to its goal, or to an entity without like."""
    kind = evidence.layout.types[evidence.types[entity]]
    nearness = (_distances(evidence, Var(name), kind) for name in (entity, other))
    for near, far in zip(*nearness, strict=True):
        yield from (Less(near, far), Less(far, near))


def _distances(evidence: Evidence, entity: Var, kind: ObjectType) -> Iterator[Term]:
    """Yield how far an entity is from its goal, and how far either is from the robot and from what has no like."""
    ends: tuple[Object, ...] = (entity, Goal(entity))
    yield from map(Norm, differences(ends[0], kind, ends[1], kind))
    for landmark, its in landmarks(evidence.layout, evidence.types):
        for end in ends:
            yield from map(Norm, differences(landmark, its, end, kind))
