"""What a loop over entities has finished, and what of that is undone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import assert_never

import numpy as np

from roboscribe.dsl.compile import NOWHERE, Act, Bind, Instruction, Jump
from roboscribe.dsl.semantics import SolvedTest, holds
from roboscribe.dsl.syntax import And, Const, Exists, Greater, Less, Not, NotNull, Or, Predicate, Solved, Truth
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout

SLACK = 2.0
"""What was finished is undone at once when its goal fails even with thresholds so many times as wide, ..."""
PATIENCE = 10
"""... and when its goal fails in so many consecutive observations."""


class Finished:
    """The entities that one loop has finished in each row.

    Single observations are noisy, and controllers are satisfied at the very edge of a threshold. So what was finished
    counts as it was then, until its goal clearly fails.

    Args:
        var: the loop's variable.
        until: what the last controller of its body brings about for the entity.
        layout: meaning of the states.
        batch: B, count of rows.
        solved: answers ψ_R, where the program mentions it.
    """

    def __init__(
        self, var: str, until: Predicate, layout: Layout, batch: int, solved: SolvedTest | None = None
    ) -> None:
        """Begin with nothing finished."""
        self._var, self._until, self._layout, self._solved = var, until, layout, solved
        self._wide = slackened(until)
        self._failing = np.zeros((len(layout.entities), batch), dtype=np.int64)
        self._done = np.zeros((len(layout.entities), batch), dtype=np.bool_)
        self._states = np.zeros((batch, layout.size))
        self._columns = [_columns(layout, entity) for entity in range(len(layout.entities))]

    def forget(self, rows: IntArray) -> None:
        """Begin episodes in some rows (R,)."""
        self._done[:, rows] = False

    def note(self, rows: IntArray, entities: IntArray, states: FloatArray) -> None:
        """Note that entities (R,) are finished in rows (R,) that observe states (R, F)."""
        self._done[entities, rows] = True
        self._failing[entities, rows] = 0
        for entity in np.unique(entities):
            here = np.flatnonzero(entities == entity)
            columns = self._columns[entity]
            self._states[rows[here, None], columns] = states[here[:, None], columns]

    def watch(self, rows: IntArray, states: FloatArray) -> None:
        """Look at the next states (R, F) of rows (R,)."""
        for entity in np.flatnonzero(self._done[:, rows].any(axis=1)):
            fails = ~self._holds(self._until, int(entity), states)
            self._failing[entity, rows] = np.where(fails, self._failing[entity, rows] + 1, 0)

    def take_up(self, rows: IntArray, entities: IntArray) -> None:
        """Note that entities (R,) are served, again perhaps."""
        self._done[entities, rows] = False

    def undone(self, rows: IntArray, states: FloatArray) -> BoolArray:
        """Tell which entities (N, R) were finished and clearly are not any more."""
        undone: BoolArray = self._done[:, rows].copy()
        for entity in np.flatnonzero(undone.any(axis=1)):
            undone[entity] &= ~self._holds(self._wide, int(entity), states)
        return undone

    def believed(self, rows: IntArray, states: FloatArray) -> FloatArray:
        """Return states (R, F) in which what is finished, and not undone, is as it was when it was finished."""
        kept = self._done[:, rows] & (self._failing[:, rows] < PATIENCE) & ~self.undone(rows, states)
        believed = states.copy() if kept.any() else states
        for entity in np.flatnonzero(kept.any(axis=1)):
            here = np.flatnonzero(kept[entity])
            columns = self._columns[entity]
            believed[here[:, None], columns] = self._states[rows[here, None], columns]
        return believed

    def _holds(self, until: Predicate, entity: int, states: FloatArray) -> BoolArray:
        return holds(until, states, {self._var: entity}, self._layout, self._solved)


def finishing(
    code: Sequence[Instruction], layout: Layout, batch: int, solved: SolvedTest | None
) -> Mapping[int, Finished]:
    """Find the loops over entities whose body ends with a controller that brings something about for the entity alone.

    Returns:
        What each has finished, nothing yet, by the place of its guard.
    """
    found: dict[int, Finished] = {}
    for place, step in enumerate(code):
        head = code[step.target] if isinstance(step, Jump) and step.target < place else None
        last = code[place - 1]
        if isinstance(head, Bind) and head.null != NOWHERE and isinstance(last, Act) and last.needs == (head.var,):
            assert isinstance(step, Jump)
            found[step.target] = Finished(head.var, last.until, layout, batch, solved)
    return found


def slackened(predicate: Predicate) -> Predicate:
    """Widen the thresholds below which something must lie `SLACK` times."""
    match predicate:
        case Less(left, Const(value)) if value > 0:
            return Less(left, Const(SLACK * value))
        case And(left, right):
            return And(slackened(left), slackened(right))
        case Or(left, right):
            return Or(slackened(left), slackened(right))
        case Less() | Greater() | NotNull() | Not() | Exists() | Truth() | Solved():
            return predicate
        case _:
            assert_never(predicate)


def _columns(layout: Layout, entity: int) -> IntArray:
    """List the columns of what an entity is like; its goal's are left out."""
    places = [place for (index, _, goal), place in layout.columns.items() if index == entity and not goal]
    return np.array([column for place in places for column in range(place.start, place.stop)], dtype=np.int64)
