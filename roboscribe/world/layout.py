"""Objects, their attributes, and where each lies in a flat state vector.

A state is one row of numbers: the robot's attributes, then for each entity its attributes followed by the
attributes of its goal. Any leading axes are allowed, so `(F,)` is a state, `(B, F)` a batch, `(T, F)` a trajectory.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from roboscribe.world.units import is_length, is_speed

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]


@dataclass(frozen=True)
class Attribute:
    """One attribute of an object type.

    Args:
        name: for instance "position" or "opening".
        components: one name per number; a scalar attribute has its own name as its only component.
        unit: a length or an angle, see `units`; either with "/s" for its speed; "quaternion" (unit norm); "flag" (0 or
            1, in no predicate); or any other, such as "1", whose numbers are only compared with their like. Differences
            of angles in "rad" take the short way round; readings in "deg" do not, for dials have stops.
        low: least value that can be right, in `unit`.
        high: greatest value that can be right, in `unit`.
    """

    name: str
    components: tuple[str, ...]
    unit: str = "m"
    low: float = -inf
    high: float = inf

    @property
    def width(self) -> int:
        """Count of numbers."""
        return len(self.components)

    @property
    def is_place(self) -> bool:
        """Whether it says how things are, number by number: no velocity, and no quaternion."""
        return not is_speed(self.unit) and self.unit not in ("quaternion", "flag")

    @property
    def plane(self) -> tuple[int, ...]:
        """Ranks of the two components seen from above, the first two but for z; none where there are not two."""
        flat = [rank for rank, name in enumerate(self.components) if name != "z"]
        return tuple(flat[:2]) if is_length(self.unit) and self.width in (2, 3) and len(flat) >= 2 else ()

    def picked(self, field: str) -> tuple[int, ...] | None:
        """Return the ranks of one component, or of several one-letter components in order ("xy"); None if neither."""
        names = self.components
        if field in names:
            return (names.index(field),)
        if field and set(field) <= set(names) and all(len(name) == 1 for name in names):
            ranks = tuple(names.index(letter) for letter in field)
            return ranks if list(ranks) == sorted(set(ranks)) else None
        return None


@dataclass(frozen=True)
class ObjectType:
    """A type of the grammar (Fig. 5): its attributes and those for which a goal is given (maybe none)."""

    name: str
    attributes: tuple[Attribute, ...]
    goal: tuple[Attribute, ...] = ()

    def described(self, goal: bool) -> tuple[Attribute, ...]:
        """Attributes of the object itself, or of its goal."""
        return self.goal if goal else self.attributes

    def find(self, field: str, goal: bool = False) -> tuple[Attribute, tuple[int, ...]] | None:
        """Resolve what follows `↓`.

        Args:
            field: an attribute's name, one component, or several one-letter components in order ("xy"); where another
                attribute before it has them, too, with its name and _ before them ("handle_xy").
            goal: look among the goal's attributes.

        Returns:
            The attribute and the positions taken from it; None when the type has no such field.
        """
        described = self.described(goal)
        for attribute in described:
            picked = tuple(range(attribute.width)) if field == attribute.name else attribute.picked(field)
            if picked is not None:
                return attribute, picked
        for attribute in described:
            picked = attribute.picked(field.removeprefix(f"{attribute.name}_"))
            if picked is not None and field.startswith(f"{attribute.name}_"):
                return attribute, picked
        return None

    def spell(self, attribute: Attribute, ranks: tuple[int, ...] | None = None, *, goal: bool = False) -> str | None:
        """Spell what `find` resolves to an attribute, or to some of its components; the shortest way.

        Args:
            attribute: one of the type's, or of its goal's.
            ranks: of the components, ascending; None takes all of them.
            goal: whether it is the goal's.

        Returns:
            What follows `↓`; None where there is no way to say it.
        """
        whole = tuple(range(attribute.width))
        asked = whole if ranks is None else ranks
        names = [attribute.components[rank] for rank in asked]
        joined = "".join(names)
        spellings = (joined, *([attribute.name] if asked == whole else []), f"{attribute.name}_{joined}")
        return next((field for field in spellings if self.find(field, goal) == (attribute, asked)), None)


@dataclass(frozen=True, eq=False)
class FieldColumns:
    """Where `↓field` finds its numbers in a state.

    Args:
        columns: (N + 1, w): row i for entity i, the last row (index NULL) for null; -1 where there is nothing to find.
            Of the robot: (1, w).
        unit: unit of the attribute.
        contiguous: every row of `columns` ascends without gaps.
    """

    columns: IntArray
    unit: str
    contiguous: bool


ROBOT = -2
"""Object index of the end effector."""
NULL = -1
"""Object index of `null`."""


@dataclass(frozen=True)
class Layout:
    """Where every attribute of every object lies in the flat state vector of `size` numbers."""

    robot: ObjectType
    entities: tuple[ObjectType, ...]

    @cached_property
    def size(self) -> int:
        """F, the count of numbers in one state."""
        total = sum(a.width for a in self.robot.attributes)
        return total + sum(a.width for e in self.entities for a in (*e.attributes, *e.goal))

    @cached_property
    def columns(self) -> dict[tuple[int, str, bool], slice]:
        """Columns of (object index or ROBOT, attribute name, is goal), in storage order."""
        found: dict[tuple[int, str, bool], slice] = {}
        start = 0
        for index, kind in ((ROBOT, self.robot), *enumerate(self.entities)):
            for goal in (False, True):
                for attribute in kind.described(goal):
                    found[index, attribute.name, goal] = slice(start, start + attribute.width)
                    start += attribute.width
        return found

    @cached_property
    def types(self) -> dict[str, ObjectType]:
        """Every entity type by name, in order of first appearance."""
        return {kind.name: kind for kind in self.entities}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of every entity as predicates mention it: its type's letter (or word) and its rank, b1, b2, d1."""
        rank = {name: iter(range(1, len(self.entities) + 1)) for name in self.types}
        return tuple(f"{self.letter(kind.name)}{next(rank[kind.name])}" for kind in self.entities)

    def letter(self, kind: str) -> str:
        """Short name for variables of a type: its first letter, or the whole word where letters clash."""
        clash = sum(name[0] == kind[0] for name in self.types) > 1
        return kind if clash else kind[0]

    def type_of(self, index: int) -> ObjectType:
        """Type of an object index."""
        return self.robot if index == ROBOT else self.entities[index]

    def of_type(self, name: str) -> tuple[int, ...]:
        """Entity indices of one type, ascending."""
        return tuple(i for i, kind in enumerate(self.entities) if kind.name == name)

    def starts(self, attribute: str, goal: bool) -> IntArray:
        """First column of an attribute for each entity, shape (N,); -1 where an entity has none."""
        places = (self.columns.get((i, attribute, goal)) for i in range(len(self.entities)))
        return np.array([-1 if place is None else place.start for place in places], dtype=np.int64)

    def place(self, field: str, goal: bool = False, robot: bool = False) -> FieldColumns:
        """Locate `↓field` for every entity (or its goal), or for the robot; remembered, as every evaluation asks.

        Raises:
            ValueError: no object has the field, or entities of several types have it with other widths or units.
        """
        key = (field, goal, robot)
        if key not in self._places:
            self._places[key] = self._locate(field, goal, (ROBOT,) if robot else tuple(range(len(self.entities))))
        return self._places[key]

    @cached_property
    def _places(self) -> dict[tuple[str, bool, bool], FieldColumns]:
        return {}

    def _locate(self, field: str, goal: bool, objects: tuple[int, ...]) -> FieldColumns:
        found = {i: hit for i in objects if (hit := self.type_of(i).find(field, goal)) is not None}
        shapes = {(len(picked), attribute.unit) for attribute, picked in found.values()}
        if len(shapes) != 1:
            owner = "the robot" if objects == (ROBOT,) else "goals of entities" if goal else "entities"
            problem = f"differing widths and units {sorted(shapes)}" if shapes else "no such field"
            msg = f"↓{field} of {owner}: {problem}; expected one width and one unit"
            raise ValueError(msg)
        width, unit = shapes.pop()
        columns = np.full((1 if ROBOT in objects else len(objects) + 1, width), -1, dtype=np.int64)
        for index, (attribute, picked) in found.items():
            columns[max(index, 0)] = self.columns[index, attribute.name, goal].start + np.array(picked)
        steps = np.diff(columns[columns[:, 0] >= 0], axis=1)
        return FieldColumns(columns, unit, bool((steps == 1).all()))

    def permute(self, states: FloatArray, order: tuple[int, ...]) -> FloatArray:
        """Rename entities: entity `i` of the result is entity `order[i]` of `states` (..., F).

        Raises:
            ValueError: `order` is no permutation, or maps an entity to one of another type.
        """
        if sorted(order) != list(range(len(self.entities))):
            msg = f"order must be a permutation of {len(self.entities)} entities, got {order}"
            raise ValueError(msg)
        if any(self.entities[i] != self.entities[j] for i, j in enumerate(order)):
            msg = f"order {order} maps an entity to one of another type"
            raise ValueError(msg)
        columns = np.arange(self.size)
        for (index, name, goal), place in self.columns.items():
            if index != ROBOT:
                source = self.columns[order[index], name, goal]
                columns[place] = np.arange(source.start, source.stop)
        return states[..., columns]
