"""Expressions α of the grammar (Fig. 12), enumerated for whatever objects and attributes a task declares.

Nothing here knows a task. An expression is offered when the grammar derives it and its units agree: coordinates,
differences of one attribute of two objects, their norms, and angles between objects that share a point. Velocities are
left out: a subgoal is a place to be, not a speed, for it must be possible to stay in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from roboscribe.dsl.rewrite import free_vars, size
from roboscribe.dsl.semantics import evaluate
from roboscribe.dsl.syntax import (
    Arctan2,
    Const,
    Diff,
    Exists,
    Goal,
    Greater,
    Less,
    Norm,
    Not,
    Object,
    Predicate,
    Proj,
    Robot,
    Term,
    Var,
)
from roboscribe.world.layout import Attribute, FloatArray, Layout, ObjectType

COMPARABLE = ("m", "rad")
"""Units of which two attributes of one object may be compared: shares and flags need not be of the same thing."""
MAX_ENTITIES = 2
"""Most entities one expression may mention; three would relate everything to everything."""


@dataclass(frozen=True)
class Feature:
    """A scalar α, or its least or greatest value over the entities of a type.

    Args:
        term: α.
        over: the quantified variable and its type; None for a plain expression.
        greatest: of a quantified feature, whether the greatest value counts instead of the least.
        family: objects and attribute that α compares; projections of one difference share it.
        detail: how many numbers of the attribute α looks at, the more the more specific.
    """

    term: Term
    over: tuple[Var, str] | None = None
    greatest: bool = False
    family: str = ""
    detail: int = 1

    @property
    def entities(self) -> int:
        """How many entities α mentions, a quantified one included."""
        return len(free_vars(self.term))

    @property
    def size(self) -> int:
        """Nodes of α and its quantifier."""
        return size(self.term) + (1 if self.over else 0)

    def below(self, threshold: float) -> Predicate:
        """Express "value < threshold" in the grammar."""
        if self.over is None:
            return Less(self.term, Const(threshold))
        if self.greatest:
            return Not(Exists(*self.over, Greater(self.term, Const(threshold))))
        return Exists(*self.over, Less(self.term, Const(threshold)))

    def above(self, threshold: float) -> Predicate:
        """Express "value > threshold" in the grammar."""
        if self.over is None:
            return Greater(self.term, Const(threshold))
        if self.greatest:
            return Exists(*self.over, Greater(self.term, Const(threshold)))
        return Not(Exists(*self.over, Less(self.term, Const(threshold))))

    def values(self, states: FloatArray, layout: Layout) -> FloatArray:
        """Evaluate on states (S, F); returns (S,)."""
        if self.over is None:
            return evaluate(self.term, states, {}, layout)[..., 0]
        var, kind = self.over
        each = [evaluate(self.term, states, {var.name: i}, layout)[..., 0] for i in layout.of_type(kind)]
        return np.asarray(np.max(each, axis=0) if self.greatest else np.min(each, axis=0))


def enumerate_features(layout: Layout, named: Sequence[str]) -> tuple[Feature, ...]:
    """Enumerate the scalar expressions that separate states may be told apart by.

    Args:
        layout: objects, types and attributes that the task declares.
        named: entities that may be mentioned by name. Types with several entities are also quantified over.

    Returns:
        Every feature once, in a fixed order.

    Source:  L(α) in Algorithm 3, line 5; Fig. 12.
    Departs: quantified atoms belong to the grammar of the classifier too, for a leaf about one named entity does not
        generalise to other counts of them.
    """
    kinds = {name: layout.entities[layout.names.index(name)] for name in named}
    plain = list(_expressions(layout, kinds))
    for kind in layout.types.values():
        if len(layout.of_type(kind.name)) > 1:
            var = Var(f"{layout.letter(kind.name)}'")
            mentions = (f for f in _expressions(layout, {var.name: kind}) if free_vars(f.term))
            for f in mentions:
                plain += [Feature(f.term, (var, kind.name), g, "∃" + f.family, f.detail) for g in (False, True)]
    return tuple(dict.fromkeys(plain))


def _expressions(layout: Layout, kinds: dict[str, ObjectType]) -> Iterator[Feature]:
    objects = _objects(layout, kinds)
    for item, attributes in objects:
        for attribute in attributes:
            yield from _coordinates(item, attribute)
        for attribute, begun in combinations(attributes, 2):
            yield from _changes(item, attribute, begun)
    for (one, theirs), (other, others) in combinations(objects, 2):
        if len({*_mentions(one), *_mentions(other)}) <= MAX_ENTITIES:
            for attribute in theirs:
                if any(a.name == attribute.name and a.unit == attribute.unit for a in others):
                    yield from _differences(one, other, attribute)
    yield from _angles([item for item, attributes in objects if any(_planar(a) for a in attributes)])


def _objects(layout: Layout, kinds: dict[str, ObjectType]) -> list[tuple[Object, tuple[Attribute, ...]]]:
    found: list[tuple[Object, tuple[Attribute, ...]]] = [(Robot(), layout.robot.attributes)]
    found += [(Var(name), kind.attributes) for name, kind in kinds.items()]
    found += [(Goal(Var(name)), kind.goal) for name, kind in kinds.items() if kind.goal]
    return [(item, tuple(a for a in attributes if not _hidden(a))) for item, attributes in found]


def _hidden(attribute: Attribute) -> bool:
    """Tell what no predicate may speak of: speeds, and a task's own flag of success."""
    return attribute.unit.endswith("/s") or attribute.unit == "flag"


def _coordinates(item: Object, attribute: Attribute) -> Iterator[Feature]:
    family = f"{item}.{attribute.name}"
    for component in attribute.components:
        yield Feature(Proj(item, component), family=family)
    if attribute.width > 1 and attribute.unit != "m":
        yield Feature(Norm(Proj(item, _whole(attribute))), family=family, detail=attribute.width)


def _changes(item: Object, attribute: Attribute, other: Attribute) -> Iterator[Feature]:
    """Differences of two attributes of one object that measure the same, as a position and where it began."""
    if (attribute.unit, attribute.width) == (other.unit, other.width) and attribute.unit in COMPARABLE:
        family = f"{item}.{attribute.name}−{other.name}"
        for one, two in zip(attribute.components, other.components, strict=True):
            if one != two:
                yield Feature(Diff(Proj(item, one), Proj(item, two)), family=family)
        whole = Diff(Proj(item, attribute.name), Proj(item, other.name))
        yield Feature(Norm(whole), family=family, detail=attribute.width)


def _differences(one: Object, other: Object, attribute: Attribute) -> Iterator[Feature]:
    family = f"{one}−{other}.{attribute.name}"
    for component in attribute.components:
        yield Feature(Diff(Proj(one, component), Proj(other, component)), family=family)
    fields = {_whole(attribute)}
    if _planar(attribute):
        fields.add("xy")
    for field in sorted(fields):
        term = Norm(Diff(Proj(one, field), Proj(other, field)))
        yield Feature(term, family=family, detail=2 if field == "xy" else attribute.width)


def _angles(objects: list[Object]) -> Iterator[Feature]:
    """Directions between two objects, and the angle at which two objects are seen from a third."""
    for one, other in combinations(objects, 2):
        yield Feature(_direction(one, other), family=f"∠{one}{other}")
    for apex in objects:
        for one, other in combinations([o for o in objects if o != apex], 2):
            if len({*_mentions(apex), *_mentions(one), *_mentions(other)}) == 1:
                angle = Diff(_direction(one, apex), _direction(other, apex))
                family = f"∠{one}{apex}{other}"
                yield Feature(angle, family=family)
                yield Feature(Norm(angle), family=family, detail=2)


def _direction(one: Object, other: Object) -> Term:
    return Arctan2(Diff(Proj(one, "xy"), Proj(other, "xy")))


def _planar(attribute: Attribute) -> bool:
    return attribute.unit == "m" and {"x", "y"} <= set(attribute.components)


def _whole(attribute: Attribute) -> str:
    letters = all(len(component) == 1 for component in attribute.components)
    return "".join(attribute.components) if letters else attribute.name


def _mentions(item: Object) -> tuple[str, ...]:
    match item:
        case Robot():
            return ()
        case Var(name):
            return (name,)
        case Goal(Var(name)):
            return (name,)
