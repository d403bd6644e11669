"""Projections on attributes, spelled so that they mean what was asked for, and names that programs can be read with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from roboscribe.dsl.lexer import is_name
from roboscribe.dsl.printer import RESERVED
from roboscribe.dsl.syntax import Goal, Object, Proj
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, Layout, ObjectType


def projections(
    item: Object, kind: ObjectType, attribute: Attribute, ranks: tuple[int, ...] | None = None
) -> Iterator[Proj]:
    """Yield the projection of an object on an attribute, or on some of its components, if there is a way to say it.

    Args:
        item: the object.
        kind: its type, or that of the entity whose goal it is.
        attribute: one of its own.
        ranks: of the components, ascending; None takes all of them.
    """
    field = kind.spell(attribute, ranks, goal=isinstance(item, Goal))
    if field is not None:
        yield Proj(item, field)


def components(item: Object, kind: ObjectType, attribute: Attribute) -> Iterator[Proj]:
    """Yield the projections of an object on every component of an attribute."""
    for rank in range(attribute.width):
        yield from projections(item, kind, attribute, (rank,))


def same_measure(one: Attribute, other: Attribute) -> bool:
    """Whether attributes of two objects measure the same, so that they can be compared."""
    return (one.name, one.unit, one.width) == (other.name, other.unit, other.width)


def check_layout(layout: Layout) -> None:
    """Check that programs which speak of a layout can be read again.

    Raises:
        TaskError: a type, attribute or component has a name that is no word of the language or means something else
            there, or shares it with another one.
    """
    _check_names("types", layout.types)
    for kind in (layout.robot, *layout.types.values()):
        for attributes in (kind.attributes, kind.goal):
            _check_names(f"attributes of {kind.name}", (attribute.name for attribute in attributes))
            for attribute in attributes:
                _check_names(f"components of {kind.name}.{attribute.name}", attribute.components)
    if len({kind.name for kind in layout.entities}) < len(set(layout.entities)):
        msg = f"types: found several that are called alike, expected one for each name of {', '.join(layout.types)}"
        raise TaskError(msg)


def _check_names(what: str, names: Iterable[str]) -> None:
    for name, count in Counter(list(names)).items():
        if not is_name(name) or name in RESERVED:
            msg = f"{what}: found {name!r}, expected a word of letters, digits and _ without other meaning"
            raise TaskError(msg)
        if count > 1:
            msg = f"{what}: found {name!r} {count} times, expected different names"
            raise TaskError(msg)
