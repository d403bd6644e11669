"""Names that programs can speak of."""

from __future__ import annotations

import re

import pytest

from roboscribe.dsl.fields import check_layout
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, Layout, ObjectType

PLACE = Attribute("position", ("x", "y"))
HAND = ObjectType("EE", (PLACE,))


def entity(name: str = "block", attribute: str = "position", components: tuple[str, ...] = ("x", "y")) -> ObjectType:
    """Return a type with one attribute."""
    return ObjectType(name, (Attribute(attribute, components),))


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (entity("green block"), "types: found 'green block'"),
        (entity("tool-box"), "types: found 'tool-box'"),
        (entity("get"), "types: found 'get'"),
        (entity(attribute="grip-force"), "attributes of block: found 'grip-force'"),
        (entity(attribute="not"), "attributes of block: found 'not'"),
        (entity(components=("0", "1")), "components of block.position: found '0'"),
        (entity(components=("x", "x")), "components of block.position: found 'x' 2 times"),
        (ObjectType("block", (PLACE, PLACE)), "attributes of block: found 'position' 2 times"),
    ],
)
def test_names_that_no_program_can_be_read_with_are_refused(kind: ObjectType, told: str) -> None:
    with pytest.raises(TaskError, match=re.escape(told)):
        check_layout(Layout(HAND, (kind,)))


def test_two_types_of_one_name_are_refused() -> None:
    with pytest.raises(TaskError, match="several that are called alike"):
        check_layout(Layout(HAND, (entity(), entity(attribute="place"))))


def test_usual_names_are_fine() -> None:
    check_layout(Layout(HAND, (entity(), entity(), entity("lid", "Öffnung_2"))))
