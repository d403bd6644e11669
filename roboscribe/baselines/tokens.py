"""One token per entity: what every baseline sees of a state.

A token holds the robot's attributes, the entity's own, its goal's, the differences of positions among them, and its
type. A spec names attributes, not columns, so it outlives the layout it was built on: the same weights take any number
of entities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from roboscribe.errors import ArtifactError
from roboscribe.rl.observation import FINE_SCALES
from roboscribe.world.layout import ROBOT, FloatArray, IntArray, Layout, ObjectType
from roboscribe.world.units import in_si, is_length

ABSENT = -1
"""Column of an attribute that a type lacks."""
WIDEST = 1000
"""Most numbers of an attribute that is read from a file."""


@dataclass(frozen=True)
class Field:
    """An attribute as a token holds it: its name, how many numbers it has, whether it is the goal's, its unit."""

    name: str
    width: int
    goal: bool = False
    unit: str = "m"


def fields_of(kind: ObjectType) -> tuple[Field, ...]:
    """List a type's attributes and its goal's."""
    return tuple(Field(a.name, a.width, goal, a.unit) for goal in (False, True) for a in kind.described(goal))


@dataclass(frozen=True)
class TokenSpec:
    """What a token holds, in order.

    Args:
        robot: the robot's attributes.
        entity: attributes that any type of entity has.
        types: types that are told apart.
        fine: scales of the fine copies of differences, m.
    """

    robot: tuple[Field, ...]
    entity: tuple[Field, ...]
    types: tuple[str, ...]
    fine: tuple[float, ...] = FINE_SCALES

    @staticmethod
    def of(layout: Layout) -> TokenSpec:
        """Take all attributes of a layout."""
        entity = dict.fromkeys(field for kind in layout.types.values() for field in fields_of(kind))
        return TokenSpec(fields_of(layout.robot), tuple(entity), tuple(layout.types))

    @property
    def width(self) -> int:
        """Numbers of a token that are attributes."""
        return sum(field.width for field in (*self.robot, *self.entity))

    @property
    def pairs(self) -> tuple[tuple[slice, slice], ...]:
        """Places of every two lengths named alike, of which the difference is seen, too.

        It is what controllers of programs see of their arguments: a difference of a centimetre decides whether fingers
        hold a block, and hardly shows in two places on a table.
        """
        fields = (*self.robot, *self.entity)
        ends = np.cumsum([field.width for field in fields]).tolist()
        places = [(field, slice(end - field.width, end)) for field, end in zip(fields, ends, strict=True)]
        return tuple((here, there) for (a, there), (b, here) in combinations(places, 2) if _alike(a, b))

    @property
    def differences(self) -> int:
        """Numbers of a token that are differences, without their fine copies."""
        return sum(place.stop - place.start for place, _ in self.pairs)

    @property
    def metres(self) -> tuple[float, ...]:
        """How many metres one unit of each difference is."""
        units = [field.unit for field in (*self.robot, *self.entity) for _ in range(field.width)]
        return tuple(in_si(unit) for place, _ in self.pairs for unit in units[place])

    @property
    def size(self) -> int:
        """All numbers of a token: attributes, differences and their fine copies, and one for each type."""
        return self.width + self.differences * (1 + len(self.fine)) + len(self.types)

    def columns(self, layout: Layout) -> IntArray:
        """Find the column of every attribute in a layout's states, (N, width); `ABSENT` where a type lacks it.

        Raises:
            ArtifactError: the layout has a type, or an attribute, that the spec does not know.
        """
        self._check(layout)
        rows = [
            [*_found(layout, ROBOT, self.robot), *_found(layout, entity, self.entity)]
            for entity in range(len(layout.entities))
        ]
        return np.array(rows, np.int64).reshape(len(rows), self.width)

    def kinds(self, layout: Layout) -> FloatArray:
        """Return each entity's type as a row with a single one, (N, types)."""
        return np.array([[float(kind.name == name) for name in self.types] for kind in layout.entities])

    def _check(self, layout: Layout) -> None:
        if fields_of(layout.robot) != self.robot:
            msg = f"the policy sees a robot with {_spell(self.robot)}, the task's has {_spell(fields_of(layout.robot))}"
            raise ArtifactError(msg)
        for kind in layout.types.values():
            unknown = [field for field in fields_of(kind) if field not in self.entity]
            if kind.name not in self.types or unknown:
                known = f"types {', '.join(self.types)} with {_spell(self.entity)}"
                msg = f"the policy knows {known}, the task has type {kind.name} with {_spell(fields_of(kind))}"
                raise ArtifactError(msg)

    def to_json(self) -> dict[str, object]:
        """Return plain lists, numbers and strings."""
        robot, entity = (
            [[field.name, field.width, field.goal, field.unit] for field in fields]
            for fields in (self.robot, self.entity)
        )
        return {"robot": robot, "entity": entity, "types": list(self.types), "fine": list(self.fine)}

    @staticmethod
    def from_json(data: object) -> TokenSpec:
        """Read what `to_json` wrote.

        Raises:
            ArtifactError: an entry is missing or of another kind.
        """
        found = data if isinstance(data, Mapping) else {}
        try:
            robot, entity = (tuple(_field(row) for row in _list(found[name])) for name in ("robot", "entity"))
            types, fine = tuple(str(name) for name in _list(found["types"])), _scales(found["fine"])
            return TokenSpec(robot, entity, types, fine)
        except (KeyError, TypeError, ValueError) as error:
            msg = f"token spec cannot be read: {error!r}; expected robot, entity, types and fine"
            raise ArtifactError(msg) from error


def _alike(one: Field, other: Field) -> bool:
    """Tell whether two attributes are positions of which a difference says something."""
    return is_length(one.unit) and (one.name, one.width, one.unit) == (other.name, other.width, other.unit)


def _found(layout: Layout, entity: int, fields: Sequence[Field]) -> list[int]:
    """Return the columns of one object's attributes."""
    own = fields_of(layout.type_of(entity))
    columns: list[int] = []
    for field in fields:
        start = layout.columns[entity, field.name, field.goal].start if field in own else None
        columns += [ABSENT] * field.width if start is None else range(start, start + field.width)
    return columns


def _spell(fields: Sequence[Field]) -> str:
    return ", ".join(f"{'goal ' * field.goal}{field.name} ({field.width})" for field in fields) or "nothing"


def _list(value: object) -> list[object]:
    if not isinstance(value, list):
        msg = f"expected a list, found {value!r}"
        raise TypeError(msg)
    return value


def _scales(value: object) -> tuple[float, ...]:
    scales = [scale for scale in _list(value) if isinstance(scale, float) and scale > 0]
    if len(scales) != len(_list(value)):
        msg = f"expected scales, found {value!r}"
        raise ValueError(msg)
    return tuple(scales)


def _field(row: object) -> Field:
    name, width, goal, unit = _list(row)
    sound = isinstance(name, str) and isinstance(goal, bool) and isinstance(unit, str)
    if not sound or not isinstance(width, int) or not 0 < width <= WIDEST:
        msg = f"expected [name, width, goal, unit], found {row!r}"
        raise TypeError(msg)
    return Field(str(name), width, bool(goal), str(unit))
