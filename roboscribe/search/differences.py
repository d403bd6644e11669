"""Differences of two objects, and what an order may measure them from: how far they are apart may decide it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

from roboscribe.dsl.fields import projections, same_measure
from roboscribe.dsl.syntax import Diff, Goal, Object, Robot, Var
from roboscribe.world.layout import Layout, ObjectType


def landmarks(layout: Layout, types: Mapping[str, str]) -> Iterator[tuple[Object, ObjectType]]:
    """Yield the robot and every named entity that has no like, with their types; `types` by name."""
    yield Robot(), layout.robot
    yield from ((Var(name), layout.types[of]) for name, of in types.items() if len(layout.of_type(of)) == 1)


def differences(near: Object, its: ObjectType, far: Object, others: ObjectType) -> Iterator[Diff]:
    """Yield the difference of two objects, of types `its` and `others`, in every attribute that both have."""
    for attribute in (a for a in its.described(isinstance(near, Goal)) if a.is_place):
        for alike in (a for a in others.described(isinstance(far, Goal)) if same_measure(a, attribute)):
            for a, b in product(projections(near, its, attribute), projections(far, others, alike)):
                yield Diff(a, b)
