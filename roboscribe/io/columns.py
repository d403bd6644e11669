"""Names of the columns that hold a layout's attributes, in files and in messages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.world import Attribute, Layout
from roboscribe.world.layout import ROBOT, BoolArray, FloatArray


@dataclass(frozen=True)
class Column:
    """One attribute of one object, or of its goal.

    Args:
        name: "mu.position", "b1.position" or "g(b1).position".
        owner: the object's name alone, "mu" or "b1".
        attribute: components, unit and range.
        place: where it lies in a state.
        goal: whether it belongs to the goal.
    """

    name: str
    owner: str
    attribute: Attribute
    place: slice
    goal: bool

    @property
    def of_entity(self) -> bool:
        """Whether it describes an entity, not the robot."""
        return self.owner != "mu"

    def component(self, index: int) -> str:
        """Name one number of the column: "b1.position.z", or the column's own name when it is a scalar."""
        return self.name if self.attribute.width == 1 else f"{self.name}.{self.attribute.components[index]}"


def columns_of(layout: Layout) -> tuple[Column, ...]:
    """List the columns of a layout in storage order."""
    return tuple(_column(layout, index, name, goal, place) for (index, name, goal), place in layout.columns.items())


def missing(states: FloatArray, column: Column) -> BoolArray:
    """Say for states (T + 1, F) in which frames a column has no value at all, shape (T + 1,)."""
    return np.asarray(np.isnan(states[:, column.place]).all(axis=1))


def _column(layout: Layout, index: int, name: str, goal: bool, place: slice) -> Column:
    """Describe one entry of `Layout.columns`."""
    owner = "mu" if index == ROBOT else layout.names[index]
    attribute = next(a for a in layout.type_of(index).described(goal) if a.name == name)
    return Column(f"g({owner}).{name}" if goal else f"{owner}.{name}", owner, attribute, place, goal)
