"""LEARNCLASSIFIER (Algorithm 3): what must hold before a goal can be reached."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from roboscribe.dsl.rewrite import free_vars, rename, uses_robot, walk
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Term, Truth
from roboscribe.errors import Fail
from roboscribe.evidence import Crossings, Evidence
from roboscribe.search.candidates import Anchor, Candidate, Samples
from roboscribe.search.decision_tree import learn_decision_tree
from roboscribe.search.features import Feature, enumerate_features, relations
from roboscribe.search.loop_entities import Pairs, is_lasting
from roboscribe.search.naming import name_predicate
from roboscribe.search.predicates import rank_predicates
from roboscribe.search.recurring import recurring_candidates
from roboscribe.subtask_tree import ROOT, Node, Place, Tree
from roboscribe.world.layout import FloatArray, IntArray
from roboscribe.world.trajectory import AGREEMENT, NEVER
from roboscribe.world.units import is_length

MOST_NEGATIVES = 6_000
"""Negatives beyond this many are thinned evenly."""
LEAST_NEGATIVES = 50
"""Negatives on which a predecessor holds, from which on the others do not count."""


@dataclass(frozen=True)
class Refinement:
    """The outcome of one comparison of demonstrations with failures.

    Args:
        psi: name of the goal that could not be reached.
        node: the subgoal φ, circular where it is a loop's.
        table: every predicate considered, best first.
        positives: count of P_s.
        negatives: count of N_s.
        place: where φ stands among the subgoals that lead to ψ.
        passed_over: better-ranked predicates that were not taken, and why.
    """

    psi: str
    node: Node
    table: tuple[Candidate, ...]
    positives: int
    negatives: int
    place: Place = field(default_factory=Place)
    passed_over: tuple[tuple[str, str], ...] = ()


def learn_classifier(negatives: FloatArray, evidence: Evidence, tree: Tree, psi: str) -> Refinement | Fail:
    """Learn a predicate φ that holds when ψ is reached in the demonstrations and never in failing rollouts.

    Args:
        negatives: (M, F), N_s, states of failing rollouts, named as in the tree.
        evidence: demonstrations, from which P_s is taken.
        tree: T.
        psi: name of the goal ψ.

    Returns:
        The refinement with the best φ; its table lists the others, see `alternative`. Fail when no predicate of the
        grammar separates the samples.

    Source:  Algorithm 3.
    Departs: evidence is every (demonstration, entity) pair that plays ψ's role, so that a loop is found at once and
        not when a predicate recurs (line 2); an exact ranked search over single atoms, over what one atom adds to a
        predecessor, and over pairs comes before the decision tree; negatives on which the learned predecessor does
        not hold are told apart by it already and do not count.
    """
    crossings = evidence.crossings(tree, psi)
    if not len(crossings.starts):
        return Fail(f"no demonstration reaches {psi}, so there is nothing to compare failures with")
    comparable = _comparable(negatives[:: len(negatives) // MOST_NEGATIVES + 1], evidence, tree, psi)
    if isinstance(comparable, Fail):
        return comparable
    negatives = comparable
    features = _changing(enumerate_features(evidence.layout, _nameable(evidence, tree, psi)), crossings, evidence)
    found: list[Candidate] = []
    for part in _parts(crossings, features, evidence, tree, psi):
        samples = _samples(part, negatives, evidence, tree, psi, features)
        recurring = [] if found else list(_recurring(samples, evidence, tree, psi, several=True))
        others = {str(c.predicate) for c in found if c.possible}
        found += [c for c in rank_predicates(part.features, samples, recurring) if str(c.predicate) not in others]
    if not any(c.possible for c in found):
        samples = _samples(_Part(crossings, features, tuple(tree.below(psi))), negatives, evidence, tree, psi, features)
        depending = [c for c in _recurring(samples, evidence, tree, psi, several=False) if c.possible]
        found += depending or learn_decision_tree(features, samples)
    table = tuple(sorted((c for c in found if c.possible), key=lambda c: c.rank))
    if not table:
        return Fail(
            f"no predicate of the declared attributes holds in the {len(crossings.starts)} demonstrated states before "
            f"{psi} and fails in the {len(negatives)} failing ones; an attribute that tells them apart is missing, or "
            f"the demonstrations show several ways"
        )
    return alternative(Refinement(psi, tree.node(psi), table, len(crossings.starts), len(negatives)), 0, evidence, tree)


def _changing(features: Sequence[Feature], crossings: Crossings, evidence: Evidence) -> tuple[Feature, ...]:
    """Leave out what no crossing changes, but for moving goals: a goal that moves rides on something that is moved."""
    still = _with_goals_at_rest(crossings, evidence)
    return tuple(
        feature for feature in features if not is_lasting(feature.values(still, evidence.layout), crossings.starts)
    )


def _with_goals_at_rest(crossings: Crossings, evidence: Evidence) -> FloatArray:
    """Return the frames of crossings (S, F) with every goal where it is when its crossing begins."""
    places = [place for (_, _, goal), place in evidence.layout.columns.items() if goal]
    goals = [column for place in places for column in range(place.start, place.stop)]
    still = crossings.frames.copy()
    still[:, goals] = np.repeat(crossings.frames[crossings.starts], crossings.lengths, axis=0)[:, goals]
    return still


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of the demonstrations on which some features are judged.

    Args:
        crossings: the part.
        features: what is judged on it.
        known: subgoals that must not be repeated.
        whole: what it was cut out of, if it was.
        afterwards: whether it begins when all that comes before the goal is done.
    """

    crossings: Crossings
    features: Sequence[Feature]
    known: tuple[Node, ...]
    whole: Crossings | None = None
    afterwards: bool = False


def _parts(
    crossings: Crossings, features: Sequence[Feature], evidence: Evidence, tree: Tree, psi: str
) -> Iterator[_Part]:
    """Say on which part of the demonstrations each feature is to be judged, and which subgoals it must not repeat.

    Within a loop, what is not about the entity that it serves is brought about once, before or while the first one is
    served. After a loop, what speaks of no entity by name is brought about by leaving, so it is judged from where all
    that comes before is done; to be far from every block is no copy of having been near to each. What is about the
    robot and something by name may be brought about by leaving, too, wherever the robot was before.
    """
    loop, below = tree.loop_around(psi), tuple(tree.below(psi))
    once = [f for f in features if loop is not None and free_vars(f.term) and _named(f) and loop.role not in _named(f)]
    before = tree.predecessors(psi) if psi == ROOT else ()
    done = [crossings.first_steps(n.completed(evidence.types), evidence.layout, evidence.solved) for n in before]
    late = evidence.cut(crossings, np.max(done, axis=0)) if done else crossings
    seen = bool(done) and len(late.starts) >= AGREEMENT * len(crossings.starts)
    left = [f for f in features if seen and not _named(f) and any(node.circular for node in before)]
    yield _Part(crossings, [f for f in features if f not in once and f not in left], below)
    if once:
        first = np.array([0 if p.begin == 0 else len(crossings.frames) for p in crossings.passages], dtype=np.int64)
        yield _Part(evidence.cut(crossings, first), once, below, crossings)
    left += [f for f in features if seen and _named(f) and uses_robot(f.term) and is_length(f.unit)]
    if left:
        yield _Part(late, left, before, crossings, afterwards=True)


def _named(feature: Feature) -> set[str]:
    """Entities that a feature mentions by name."""
    bound = set() if feature.over is None else {feature.over[0].name}
    return set(free_vars(feature.term)) - bound


def alternative(refinement: Refinement, rank: int, evidence: Evidence, tree: Tree) -> Refinement:
    """Take the predicate at a rank of the table for the subgoal."""
    candidate = refinement.table[rank]
    name = name_predicate(candidate.predicate, {node.name for node in tree.nodes})
    over = next((n for n in evidence.types if n in free_vars(candidate.predicate) and _several(n, evidence)), "")
    over = over if candidate.each else ""
    node = Node(
        name,
        candidate.predicate,
        candidate.each,
        dict(candidate.scales),
        over,
        candidate.only,
        candidate.afterwards,
    )
    return replace(refinement, node=node, place=place_of(node, evidence, tree, refinement.psi))


def _several(name: str, evidence: Evidence) -> bool:
    """Whether there are other entities of an entity's type."""
    return len(evidence.layout.of_type(evidence.types[name])) > 1


def place_of(node: Node, evidence: Evidence, tree: Tree, psi: str) -> Place:
    """Find where the demonstrations reach a new subgoal of ψ, among those that are there already.

    Source: the order i(D, φ) of Algorithm 5, line 10, within the service of one entity.
    """
    before = ""
    waiting = [] if node.afterwards else list(tree.predecessors(psi))
    while waiting:
        old = waiting.pop()
        if node.circular and old.circular and node.role == old.role and not _same_phase(node, old, evidence):
            return Place(apart=True)
        if set(free_vars(old.predicate)) != set(free_vars(node.predicate)) or not free_vars(node.predicate):
            continue
        if not node.circular and evidence.restores(node.predicate):  # what undid it stays where it is
            return Place(apart=True)
        if _precedes(node, old, evidence, tree, psi):
            before = old.name
            waiting = list(tree.predecessors(old.name))
    return Place(before)


def _precedes(node: Node, old: Node, evidence: Evidence, tree: Tree, psi: str) -> bool:
    """Whether φ is reached before an older subgoal of the same entity."""
    crossings = evidence.crossings(tree, old.name if tree.loop_around(old.name) else psi)
    first, other = (crossings.first_steps(n.predicate, evidence.layout, evidence.solved) for n in (node, old))
    voters = first > 0
    return bool(voters.any() and np.mean(first[voters] < other[voters]) >= AGREEMENT)


def _same_phase(node: Node, old: Node, evidence: Evidence) -> bool:
    """Whether two things done to every entity of a type are done to one entity before the next is turned to."""
    if node.only != old.only:
        return False
    one, other = (np.sort(evidence.each_first_steps(n.served, n.role), axis=1) for n in (node, old))
    alternate = [_alternating(a, b) for a, b in zip(one, other, strict=True)]
    shown = [each for each in alternate if each is not None]
    return not shown or float(np.mean(shown)) >= 0.5


def _alternating(one: IntArray, other: IntArray) -> bool | None:
    """Whether two ascending lists of steps take turns; None where too few are left to see it."""
    a, b = (steps[(steps > 0) & (steps < NEVER)] for steps in (one, other))
    if min(len(a), len(b)) < 2:
        return None
    return bool(max(a[0], b[0]) <= min(a[1], b[1]))


def _comparable(negatives: FloatArray, evidence: Evidence, tree: Tree, psi: str) -> FloatArray | Fail:
    """Leave out failing states that a learned predecessor tells apart already.

    Fail where a loop before ψ is hardly ever complete in them: then it is the loop that fails, and all that follows
    from its end in the demonstrations would seem to be missing.
    """
    for node in tree.predecessors(psi):
        phi = node.completed(evidence.types)
        reached = holds(phi, negatives, {}, evidence.layout, evidence.solved)
        if reached.sum() >= LEAST_NEGATIVES:
            negatives = negatives[reached]
        elif node.circular and not tree.node(psi).circular:
            return Fail(f"the loop that brings about {node.name} is hardly ever complete in the failing states")
    return negatives


def _nameable(evidence: Evidence, tree: Tree, psi: str) -> list[str]:
    """Entities that may be mentioned by name: of a type over which a loop goes only the one that it serves."""
    loop = tree.loop_around(psi)
    looped = {evidence.types[n.role] for n in tree.nodes if n.circular}
    served = "" if loop is None else loop.role
    return [name for name, kind in evidence.types.items() if kind not in looped or name == served]


def _samples(
    part: _Part, negatives: FloatArray, evidence: Evidence, tree: Tree, psi: str, features: Sequence[Feature]
) -> Samples:
    """Gather what predicates are judged on; `features` are all on offer."""
    crossings, nodes = part.crossings, (*tree.above(psi), *part.known)
    steps: dict[frozenset[str], tuple[IntArray, ...]] = {}
    for node in () if part.afterwards else tree.below(psi):
        about = frozenset(node.entities)
        first = crossings.first_steps(node.lifted(evidence.types), evidence.layout, evidence.solved)
        steps[about] = (*steps.get(about, ()), first)
    return Samples(
        evidence.layout,
        crossings.before,
        crossings.reached,
        evidence.lasts(crossings),
        negatives,
        crossings.frames,
        crossings.starts,
        otherwise=crossings.frames[:0] if part.whole is None else part.whole.frames,
        choices=len(features),
        steps=steps,
        known=_compared(features, nodes, evidence),
        restored=_compared(features, [n for n in nodes if n.name != ROOT and evidence.restores(n.predicate)], evidence),
        goal_entities=_at_stake(evidence, tree, psi),
        elsewhere=tuple(_elsewhere(crossings, evidence, tree, psi)),
        root=psi == ROOT,
        afterwards=part.afterwards,
        anchors=tuple(Anchor(node.predicate, node.scales) for node in tree.predecessors(psi) if node.entities),
    )


def _elsewhere(
    crossings: Crossings, evidence: Evidence, tree: Tree, psi: str
) -> Iterator[tuple[frozenset[str], IntArray]]:
    """Say of the branches beside that of ψ what they move that ψ does not mention, and when they are done."""
    mentioned = frozenset(free_vars(tree.node(psi).predicate))
    path = [node.name for node in tree.above(psi)]
    for node in (before for goal in path[1:] for before in tree.predecessors(goal)):
        moved = (_at_stake(evidence, tree, node.name) & evidence.moved) - mentioned
        if node.name not in path and not node.circular and moved:
            yield moved, crossings.first_steps(node.predicate, evidence.layout, evidence.solved)


def _at_stake(evidence: Evidence, tree: Tree, psi: str) -> frozenset[str]:
    """Name the entities of a goal that what leads to it has to be about.

    In a loop it is the one that is served; elsewhere what no demonstration moves, a coaster, is what others go by.
    """
    named, loop = frozenset(free_vars(tree.node(psi).predicate)), tree.loop_around(psi)
    if loop is not None and loop.role in named:
        return frozenset([loop.role])
    return named & evidence.moved or named


def _recurring(samples: Samples, evidence: Evidence, tree: Tree, psi: str, *, several: bool) -> list[Candidate]:
    """Read what leads to ψ_R once for every entity of each type that has several, or of each type that has one."""
    layout, found = evidence.layout, list[Candidate]()
    single = [name for name, kind in evidence.types.items() if len(layout.of_type(kind)) == 1]
    for members in (layout.of_type(kind) for kind in layout.types):
        if psi == ROOT and (len(members) > 1) == several:
            entity = layout.names[members[0]]
            features = (*enumerate_features(layout, [entity, *single]), *relations(layout, entity))
            known = {
                only: _compared(features, [n for n in tree.nodes if n.only in (only, Truth())], evidence)
                for only in (Truth(), *(n.only for n in tree.nodes))
            }
            pairs = Pairs(layout, entity, members, samples.frames, samples.starts, samples.negatives, known)
            moving = (set(single) - {entity}) & evidence.moved
            for each in recurring_candidates(features, pairs):
                found.append(replace(each, with_others=not moving.isdisjoint(free_vars(each.predicate))))
    return found


def _compared(features: Sequence[Feature], nodes: Iterable[Node], evidence: Evidence) -> dict[str, int]:
    """Say what nodes compare already, of one entity or of all of its type, see `is_copy`."""
    terms = {part for node in nodes for part in walk(node.predicate)}
    role = {kind: name for name, kind in reversed(list(evidence.types.items()))}

    def plain(feature: Feature) -> Term:
        return (
            feature.term
            if feature.over is None
            else rename(feature.term, {feature.over[0].name: role[feature.over[1]]})
        )

    known: dict[str, int] = {}
    for feature in features:
        if feature.term in terms or plain(feature) in terms:
            known[feature.family] = max(feature.detail, known.get(feature.family, 0))
    return known
