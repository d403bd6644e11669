"""Differences of two objects: an order may go by how far they are apart."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from roboscribe.dsl.fields import projections, same_measure
from roboscribe.dsl.syntax import Diff, Goal, Object
from roboscribe.world.layout import ObjectType


def differences(near: Object, its: ObjectType, far: Object, others: ObjectType) -> Iterator[Diff]:
    """Yield the difference of two objects, of types `its` and `others`, in every attribute that both have."""
    for attribute in (a for a in its.described(isinstance(near, Goal)) if a.is_place):
        for alike in (a for a in others.described(isinstance(far, Goal)) if same_measure(a, attribute)):
            for a, b in product(projections(near, its, attribute), projections(far, others, alike)):
                yield Diff(a, b)
