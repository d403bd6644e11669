"""Expressions α of the grammar (Fig. 12), enumerated for whatever objects and attributes a task declares.

Nothing here knows a task. An expression is offered when the grammar derives it and its units agree: coordinates,
differences of one attribute of two objects, their norms, and angles between objects that share a point. Velocities are
left out: a subgoal is a place to be, not a speed, for it must be possible to stay in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from roboscribe.dsl.fields import projections, same_measure
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
from roboscribe.world.units import is_angle, is_length, is_speed

RADIANS = "rad"
"""Unit of the directions that arctan2 gives."""
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
        unit: of its values.
    """

    term: Term
    over: tuple[Var, str] | None = None
    greatest: bool = False
    family: str = ""
    detail: int = 1
    unit: str = ""

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
                plain += [Feature(f.term, (var, kind.name), g, "∃" + f.family, f.detail, f.unit) for g in (False, True)]
    return tuple(dict.fromkeys(plain))


def relations(layout: Layout, entity: str) -> Iterator[Feature]:
    """Yield how far an entity is from the nearest one of each other type with several: in one of the bins, say.

    Args:
        layout: objects, types and attributes that the task declares.
        entity: its name.
    """
    kind = layout.entities[layout.names.index(entity)]
    for other in layout.types.values():
        if other.name != kind.name and len(layout.of_type(other.name)) > 1:
            var = Var(f"{layout.letter(other.name)}'")
            for feature in _expressions(layout, {entity: kind, var.name: other}):
                if isinstance(feature.term, Norm) and set(free_vars(feature.term)) == {entity, var.name}:
                    yield replace(feature, over=(var, other.name), family="∃" + feature.family)


@dataclass(frozen=True)
class _Shown:
    """An object that predicates speak of.

    Args:
        item: how they call it.
        kind: its type, or that of the entity whose goal it is.
    """

    item: Object
    kind: ObjectType

    @property
    def attributes(self) -> tuple[Attribute, ...]:
        """What predicates may speak of: no speeds, and no task's own flag of success."""
        described = self.kind.described(isinstance(self.item, Goal))
        return tuple(a for a in described if not is_speed(a.unit) and a.unit != "flag")

    def like(self, attribute: Attribute) -> Attribute | None:
        """Return the attribute that measures the same as another object's; None where there is none."""
        return next((a for a in self.attributes if same_measure(a, attribute)), None)

    def at(self, attribute: Attribute, ranks: tuple[int, ...] | None = None) -> Iterator[Proj]:
        """Yield the projection on some components, by default all, if there is a way to say it."""
        return projections(self.item, self.kind, attribute, ranks)


def _expressions(layout: Layout, kinds: dict[str, ObjectType]) -> Iterator[Feature]:
    objects = _objects(layout, kinds)
    for shown in objects:
        for attribute in shown.attributes:
            yield from _coordinates(shown, attribute)
        for attribute, begun in combinations(shown.attributes, 2):
            yield from _changes(shown, attribute, begun)
    for one, other in combinations(objects, 2):
        if len({*_mentions(one.item), *_mentions(other.item)}) <= MAX_ENTITIES:
            for attribute in one.attributes:
                yield from _differences(one, other, attribute)
    planar: list[Attribute] = []
    for attribute in (a for shown in objects for a in shown.attributes if a.plane):
        if not any(same_measure(attribute, known) for known in planar):
            planar.append(attribute)
            yield from _angles(objects, attribute)


def _objects(layout: Layout, kinds: dict[str, ObjectType]) -> list[_Shown]:
    found = [_Shown(Robot(), layout.robot)]
    found += [_Shown(Var(name), kind) for name, kind in kinds.items()]
    found += [_Shown(Goal(Var(name)), kind) for name, kind in kinds.items() if kind.goal]
    return found


def _coordinates(shown: _Shown, attribute: Attribute) -> Iterator[Feature]:
    family = f"{shown.item}.{attribute.name}"
    for rank in range(attribute.width):
        for component in shown.at(attribute, (rank,)):
            yield Feature(component, family=family, unit=attribute.unit)
    if attribute.width > 1 and not is_length(attribute.unit):
        for whole in shown.at(attribute):
            yield Feature(Norm(whole), family=family, detail=attribute.width, unit=attribute.unit)


def _changes(shown: _Shown, attribute: Attribute, other: Attribute) -> Iterator[Feature]:
    """Differences of two attributes of one object that measure the same, as a position and where it began."""
    unit = attribute.unit
    if (unit, attribute.width) == (other.unit, other.width) and (is_length(unit) or is_angle(unit)):
        family = f"{shown.item}.{attribute.name}−{other.name}"
        for rank in range(attribute.width):
            for one, two in product(shown.at(attribute, (rank,)), shown.at(other, (rank,))):
                yield Feature(Diff(one, two), family=family, unit=unit)
        whole = Diff(Proj(shown.item, attribute.name), Proj(shown.item, other.name))
        yield Feature(Norm(whole), family=family, detail=attribute.width, unit=attribute.unit)


def _differences(one: _Shown, other: _Shown, attribute: Attribute) -> Iterator[Feature]:
    theirs = other.like(attribute)
    if theirs is None:
        return
    family = f"{one.item}−{other.item}.{attribute.name}"
    for rank in range(attribute.width):
        for near, far in product(one.at(attribute, (rank,)), other.at(theirs, (rank,))):
            yield Feature(Diff(near, far), family=family, unit=attribute.unit)
    whole = tuple(range(attribute.width))
    for ranks in dict.fromkeys((attribute.plane or whole, whole)):
        for near, far in product(one.at(attribute, ranks), other.at(theirs, ranks)):
            yield Feature(Norm(Diff(near, far)), family=family, detail=len(ranks), unit=attribute.unit)


def _angles(objects: list[_Shown], seen: Attribute) -> Iterator[Feature]:
    """Directions between two objects, and the angle at which two objects are seen from a third."""
    ends = [end for shown in objects for end in _planar(shown, seen)]
    for one, other in combinations(ends, 2):
        yield Feature(_direction(one, other), family=f"∠{one.of}{other.of}", unit=RADIANS)
    for apex in ends:
        for one, other in combinations([end for end in ends if end != apex], 2):
            if len({*_mentions(apex.of), *_mentions(one.of), *_mentions(other.of)}) == 1:
                angle = Diff(_direction(one, apex), _direction(other, apex))
                family = f"∠{one.of}{apex.of}{other.of}"
                yield Feature(angle, family=family, unit=RADIANS)
                yield Feature(Norm(angle), family=family, detail=2, unit=RADIANS)


def _planar(shown: _Shown, seen: Attribute) -> Iterator[Proj]:
    """Where an object is as seen from above."""
    attribute = shown.like(seen)
    if attribute is not None:
        yield from shown.at(attribute, attribute.plane)


def _direction(one: Proj, other: Proj) -> Term:
    return Arctan2(Diff(one, other))


def _mentions(item: Object) -> tuple[str, ...]:
    match item:
        case Robot():
            return ()
        case Var(name):
            return (name,)
        case Goal(Var(name)):
            return (name,)
