"""Names for exchangeable entities, so that one name plays one role in every episode.

Entities of one type are exchangeable: block 3 of one demonstration may play the part of block 1 in another. Before
learning, demonstrations name them in the order in which they are first displaced, and rollouts in the order in which
the program binds them; untouched ones come last, in their own order.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout
from roboscribe.world.trajectory import Trajectory
from roboscribe.world.units import in_si, is_angle, is_length

_NOTICED_LENGTH, _NOTICED_ANGLE, _NOTICED = 0.01, 0.5, 0.1  # m, rad, any other unit: changes below these are touches
_MOVED = 0.1  # share of an episode's largest displacement that counts as "displaced"


def by_displacement(trajectory: Trajectory) -> tuple[int, ...]:
    """Order entities of each type by the step at which they first move; `order[i]` will be called `i`."""
    moved = first_displacements(trajectory)
    return _ordered(trajectory.layout, sorted(range(len(moved)), key=lambda i: (moved[i], i)))


def by_binding(layout: Layout, bound: Sequence[int]) -> tuple[int, ...]:
    """Order entities of each type by the order in which a program bound them; `order[i]` will be called `i`."""
    rank = {entity: place for place, entity in reversed(list(enumerate(bound)))}
    entities = range(len(layout.entities))
    return _ordered(layout, sorted(entities, key=lambda i: (rank.get(i, len(bound)), i)))


def first_displacements(trajectory: Trajectory) -> IntArray:
    """Step at which each entity first leaves its place, shape (N,); the episode's length where it never does.

    An entity counts as displaced once one of its attributes, velocities and quaternions aside, has changed by a tenth
    of the largest change that any entity of its type shows in that attribute. Only what a controller moves counts, so a
    goal never does.
    """
    layout = trajectory.layout
    first = np.full(len(layout.entities), len(trajectory), dtype=np.int64)
    for members, _, change, least in _changes(trajectory):
        moved = change > least
        step = np.where(moved.any(axis=1), moved.argmax(axis=1), len(trajectory))
        first[members] = np.minimum(first[members], step)
    return first


def _changes(trajectory: Trajectory) -> Iterator[tuple[list[int], str, FloatArray, float]]:
    """Yield the attributes that a demonstration changes by more than a touch.

    Of each: the entities of a type, its name, how far (N, T) it is from where it is at first, and the least change that
    counts.
    """
    layout = trajectory.layout
    for kind in layout.types.values():
        members = list(layout.of_type(kind.name))
        for attribute in (a for a in kind.attributes if a.is_place):
            change = np.stack([_change(trajectory.states, layout, i, attribute.name) for i in members])
            largest = float(change.max())
            if largest > 0.0 and _worth_noticing(attribute.unit, largest):
                yield members, attribute.name, change, _MOVED * largest


class Movements:
    """Where a demonstration moves its entities.

    As with `first_displacements`, changes below a tenth of the largest do not count.

    Args:
        trajectory: the demonstration.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        """Measure how far everything goes."""
        columns = trajectory.layout.columns
        self._states, self._count = trajectory.states, len(trajectory.layout.entities)
        self._least = [
            (entity, columns[entity, name, False], least)
            for members, name, _, least in _changes(trajectory)
            for entity in members
        ]
        """Entities, the columns of one of their attributes, and the least change of it that counts."""

    def attended_from(self, start: int, stop: int, entities: Sequence[int], known: Collection[int]) -> int:
        """Return the frame from which on a part of the demonstration is about some entities.

        An unknown entity that is moved and comes to rest before any of them moves was another matter: what is done
        until then is not done for them.

        Args:
            start: first frame of the part.
            stop: frame after the last one.
            entities: indices.
            known: entities that have been dealt with so far, and these.
        """
        moved = self._displaced(start, stop, self._states[start])
        own = moved[list(entities)].any(axis=0)
        free = int(own.argmax()) if own.any() else stop - start
        rests = self._last_moved(start, stop)
        others = [e for e in range(len(moved)) if e not in known and moved[e].any() and rests[e] < free]
        return start + max((int(rests[e]) + 1 for e in others), default=0)

    def _last_moved(self, start: int, stop: int) -> IntArray:
        """Return the last frame, counted from `start`, at which each entity is not yet where it is in the end, (N,)."""
        away = self._displaced(start, stop, self._states[stop - 1])
        return np.where(away.any(axis=1), away.shape[1] - 1 - away[:, ::-1].argmax(axis=1), -1)

    def _displaced(self, start: int, stop: int, origin: FloatArray) -> BoolArray:
        """Tell in which frames from `start` each entity is displaced from its place in `origin` (F,), (N, T)."""
        found = np.zeros((self._count, stop - start), dtype=np.bool_)
        for entity, columns, least in self._least:
            away = self._states[start:stop, columns] - origin[columns]
            found[entity] |= np.linalg.norm(away, axis=1) > least
        return found


def _worth_noticing(unit: str, change: float) -> bool:
    least = _NOTICED_LENGTH if is_length(unit) else _NOTICED_ANGLE if is_angle(unit) else _NOTICED
    return change * in_si(unit) > least


def _change(states: FloatArray, layout: Layout, entity: int, attribute: str) -> FloatArray:
    values = states[:, layout.columns[entity, attribute, False]]
    return np.asarray(np.linalg.norm(values - values[0], axis=1), dtype=np.float64)


def _ordered(layout: Layout, ranking: Sequence[int]) -> tuple[int, ...]:
    """Put a ranking of all entities into the places that each type has."""
    order = list(range(len(layout.entities)))
    for kind in layout.types:
        members = layout.of_type(kind)
        for place, entity in zip(members, (i for i in ranking if i in members), strict=True):
            order[place] = entity
    return tuple(order)
