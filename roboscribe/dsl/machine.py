"""The batched interpreter's control (Fig. 14): which controller acts in which row, and on what."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias, assert_never

import numpy as np
from numpy.random import Generator

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.compile import NOWHERE, Act, Bind, Branch, End, Jump, compile_program
from roboscribe.dsl.finished import finishing
from roboscribe.dsl.rewrite import assigned
from roboscribe.dsl.semantics import SolvedTest, holds
from roboscribe.dsl.syntax import Predicate, Program
from roboscribe.dsl.types import check_program
from roboscribe.world.layout import NULL, BoolArray, FloatArray, IntArray, Layout

Preference: TypeAlias = Callable[[str, IntArray], FloatArray]
"""How much entities (N,) are preferred for a variable in rows (R,): (N, R)."""
MOVES = 256
"""Control-flow instructions that a row may pass within one observed state before it counts as stuck."""


class Machine:
    """One program over `batch` rows, each with its own place, binding and counts.

    A machine sees states and says which controller acts; it never touches a world. Rows never influence each other,
    except through the order in which they draw from `rng`.

    Args:
        program: what to run.
        layout: meaning of the states.
        batch: B, count of rows.
        limits: step limit by controller; a controller without one has all the time it wants.
        confirm: consecutive observed states in which `until` must hold to count as reached.
        rng: draws among the answers of get that were served least often; None takes the lowest index of them.
        prefers: how much entities are preferred where get has several answers; None leaves it to `rng`, among those
            that were served least often.
        solved: answers ψ_R, where the program mentions it.

    Source: Fig. 14.
    Departs: `until` is confirmed over several states, and controllers time out, since single observations are noisy
        and a learned controller may never arrive. What a loop over entities has finished counts as finished until it
        clearly is not, see `Finished`; when it then is what the loop would serve, and the present entity is not, the
        loop goes back to its guard at once.
    """

    def __init__(
        self,
        program: Program,
        layout: Layout,
        batch: int,
        *,
        limits: Mapping[str, int],
        confirm: int = CONFIRM,
        rng: Generator | None = None,
        solved: SolvedTest | None = None,
        prefers: Preference | None = None,
    ) -> None:
        """Check the program and place every row at its start."""
        check_program(program, layout)
        self._code = compile_program(program)
        self._layout, self._confirm, self._rng, self._solved = layout, confirm, rng, solved
        self._prefers = prefers
        self._most_moves = max(MOVES, 4 * len(self._code))
        acts = [step for step in self._code if isinstance(step, Act)]
        self._limits = {act.index: limits[act.controller] for act in acts if act.controller in limits}
        self._binding = {name: np.full(batch, NULL, dtype=np.int64) for name in assigned(program)}
        self._place = np.zeros(batch, dtype=np.int64)
        self._resting = np.zeros(batch, dtype=np.bool_)
        self._steps = np.zeros(batch, dtype=np.int64)
        self._streak = np.zeros(batch, dtype=np.int64)
        self._undone = np.zeros(batch, dtype=np.int64)
        self._finished = finishing(self._code, layout, batch, solved)
        self._served_times: IntArray = np.zeros((len(layout.entities), batch), dtype=np.int64)
        self._entities = np.full((batch, max((len(a.variables) for a in acts), default=0)), NULL, dtype=np.int64)
        self.run_index: IntArray = np.full(batch, -1, dtype=np.int64)
        """Which of `controllers(program)` acts now; after the end the last one reached, -1 if none ever was. (B,)"""
        self.visit: IntArray = np.zeros(batch, dtype=np.int64)
        """How many times a controller statement was reached, so that two visits to one statement differ. (B,)"""
        self.ended: BoolArray = np.zeros(batch, dtype=np.bool_)
        """The program is over, or the row is stuck. (B,)"""
        self.stuck: BoolArray = np.zeros(batch, dtype=np.bool_)
        """The row went round in control flow without a controller to run. (B,)"""
        self._reached = np.zeros((batch, len(acts), len(layout.entities) + 1), dtype=np.bool_)
        self.served: IntArray = np.full(batch, NULL, dtype=np.int64)
        """Entity that the innermost loop around the acting controller serves, NULL outside loops over entities. (B,)"""
        self.bound: list[list[int]] = [[] for _ in range(batch)]
        """Entities in the order in which get first bound them, by row."""

    def reset(self, rows: IntArray) -> None:
        """Start the program over in some rows."""
        for values in self._binding.values():
            values[rows] = NULL
        for counts in (self._place, self._steps, self._streak, self._undone, self.visit):
            counts[rows] = 0
        for finished in self._finished.values():
            finished.forget(rows)
        self._served_times[:, rows] = 0
        self._entities[rows] = self.served[rows] = NULL
        self.run_index[rows] = -1
        self.ended[rows] = self.stuck[rows] = self._resting[rows] = self._reached[rows] = False
        for row in rows:
            self.bound[row] = []

    def entities(self, rows: IntArray) -> IntArray:
        """Return the entities that the acting controllers look at, (R, n), padded with NULL on the right."""
        found: IntArray = self._entities[rows]
        return found

    def binding(self, row: int) -> dict[str, int]:
        """Return the entity that each variable of the program is bound to in one row, NULL where it is none."""
        return {name: int(entities[row]) for name, entities in self._binding.items()}

    def never_reached(self, row: int) -> int:
        """Return which of `controllers(program)` acts in a row and never yet reached its subgoal for whom it serves.

        NULL where there is none: the program is over, or what was reached was lost again.
        """
        line = int(self.run_index[row])
        return NULL if self.ended[row] or line < 0 or self._reached[row, line, self.served[row]] else line

    def advance(self, rows: IntArray, states: FloatArray) -> None:
        """Observe one more state in some rows and move each to the controller that shall act now, or to the end.

        Args:
            rows: (R,) distinct rows.
            states: (R, F) what they observe.
        """
        live = ~self.ended[rows]
        if not live.all():
            rows, states = rows[live], states[live]
        self._steps[rows] += 1
        for finished in self._finished.values():
            finished.watch(rows, states)
        for _ in range(self._most_moves):
            if not len(rows):
                return
            going = self._execute_all(rows, states)
            rows, states = rows[going], states[going]
        self.stuck[rows] = self.ended[rows] = True

    def skip(self, rows: IntArray) -> None:
        """Go on in some rows as if what the acting controller is to bring about had been reached."""
        self._place[rows] += 1
        self._resting[rows] = False

    def _execute_all(self, rows: IntArray, states: FloatArray) -> BoolArray:
        """Execute one instruction in every row; return which (R,) have another to execute in this state."""
        places = self._place[rows]
        if (places == places[0]).all():
            return self._execute(int(places[0]), rows, states)
        going = np.zeros(len(rows), dtype=np.bool_)
        for place in np.flatnonzero(np.bincount(places)):
            here = np.flatnonzero(places == place)
            going[here] = self._execute(int(place), rows[here], states[here])
        return going

    def _execute(self, place: int, rows: IntArray, states: FloatArray) -> BoolArray:
        instruction = self._code[place]
        match instruction:
            case Act():
                return self._act(instruction, rows, states)
            case Bind():
                sure = self._bind(instruction, place, rows, states)
                null = self._binding[instruction.var][rows] == NULL
                after = np.where(null & (instruction.null != NOWHERE), instruction.null, place + 1)
                self._place[rows] = np.where(sure, after, place)
                return sure
            case Branch(predicate, needs, otherwise):
                true = self._holds(predicate, needs, rows, states)
                self._place[rows] = np.where(true, place + 1, otherwise)
            case Jump(target):
                self._place[rows] = target
                if target in self._finished:
                    self._finished[target].note(rows, self._served_at(target)[rows], states)
            case End():
                self.ended[rows] = True
                return np.zeros(len(rows), dtype=np.bool_)
            case _:
                assert_never(instruction)
        return np.ones(len(rows), dtype=np.bool_)

    def _act(self, act: Act, rows: IntArray, states: FloatArray) -> BoolArray:
        """Stay with a controller, or leave it because its goal is reached or its time in a loop is up."""
        arriving = rows[~self._resting[rows]]
        if len(arriving):
            self._arrive(act, arriving)
        streak = np.where(self._holds(act.until, act.needs, rows, states), self._streak[rows] + 1, 0)
        self._streak[rows] = streak
        leaving: BoolArray = streak >= self._confirm
        if leaving.any():
            gone = rows[leaving]
            self._place[gone] += 1
            self._reached[gone, act.index, self.served[gone]] = True
        limit = self._limits.get(act.index)
        if limit is not None and act.head != NOWHERE:
            late = ~leaving & (self._steps[rows] >= limit)
            self._place[rows[late]] = act.head
            leaving |= late
        if act.head in self._finished:
            back = ~leaving & self._goes_back(act.head, rows, states)
            self._place[rows[back]] = act.head
            leaving |= back
        self._resting[rows[leaving]] = False
        return leaving

    def _served_at(self, head: int) -> IntArray:
        """Return which entity (B,) a loop serves."""
        loop = self._code[head]
        assert isinstance(loop, Bind)
        return self._binding[loop.var]

    def _goes_back(self, head: int, rows: IntArray, states: FloatArray) -> BoolArray:
        """Tell where (R,) a loop has for some time been asking for what it had finished, not for what it serves."""
        loop, undone = self._code[head], self._finished[head].undone(rows, states)
        assert isinstance(loop, Bind)
        lost = undone.any(axis=0)
        if lost.any():
            present = self._served_at(head)[rows[lost]]
            candidates, fits = self._fits(loop, rows[lost], self._finished[head].believed(rows[lost], states[lost]))
            served = (fits & (candidates[:, None] == present)).any(axis=0)
            lost[lost] = (fits & undone[candidates][:, lost]).any(axis=0) & ~served
        self._undone[rows] = np.where(lost, self._undone[rows] + 1, 0)
        back: BoolArray = self._undone[rows] >= self._confirm
        return back

    def _arrive(self, act: Act, rows: IntArray) -> None:
        self._resting[rows] = True
        self._steps[rows] = self._streak[rows] = self._undone[rows] = 0
        self.run_index[rows] = act.index
        self.visit[rows] += 1
        loop = self._code[act.head] if act.head != NOWHERE else None
        self.served[rows] = self._binding[loop.var][rows] if isinstance(loop, Bind) else NULL
        self._entities[rows] = NULL
        for column, name in enumerate(act.variables):
            self._entities[rows, column] = self._lookup(name, rows)

    def _bind(self, bind: Bind, place: int, rows: IntArray, states: FloatArray) -> BoolArray:
        """Bind a variable in every row; return where (R,) the answer is sure, elsewhere to be asked for again.

        A loop that believes everything finished, but does not see it so, looks again before it ends.
        """
        believed = self._finished[place].believed(rows, states) if place in self._finished else states
        candidates, fits = self._fits(bind, rows, believed)
        chosen = np.full(len(rows), NULL, dtype=np.int64)
        found = fits.any(axis=0)
        if found.any():
            chosen[found] = candidates[self._preference(bind.var, candidates, fits, rows).argmax(axis=0)[found]]
        self._binding[bind.var][rows] = chosen
        if place in self._finished:
            self._finished[place].take_up(rows[found], chosen[found])
        self._served_times[chosen[found], rows[found]] += 1
        for row, entity in zip(rows[found], chosen[found], strict=True):
            if entity not in self.bound[row]:
                self.bound[row].append(int(entity))
        sure: BoolArray = np.ones(len(rows), dtype=np.bool_)
        if believed is not states and not found.all():
            sure[~found] = ~self._fits(bind, rows[~found], states[~found])[1].any(axis=0)
        return sure

    def _fits(self, bind: Bind, rows: IntArray, states: FloatArray) -> tuple[IntArray, BoolArray]:
        """List the entities (N,) of the type that is asked for, and which of them (N, R) are answers in each row."""
        candidates = np.array(self._layout.of_type(bind.type), dtype=np.int64)
        binding: dict[str, IntArray | int] = {name: self._lookup(name, rows) for name in bind.needs}
        fits = np.zeros((len(candidates), len(rows)), dtype=np.bool_)
        for rank, entity in enumerate(candidates):
            binding[bind.var] = int(entity)
            fits[rank] = holds(bind.where, states, binding, self._layout, self._solved)
        return candidates, fits

    def _preference(self, var: str, candidates: IntArray, fits: BoolArray, rows: IntArray) -> FloatArray:
        """Say which of the candidates (N,) that fit (N, R) is taken: the one with the greatest number.

        What a controller ran out of time on, or what has slipped off since it was served, waits for the others: it may
        be beyond help, or good enough.
        """
        if self._prefers is not None:
            return np.where(fits, self._prefers(var, rows), -np.inf)
        drawn = np.zeros(fits.shape) if self._rng is None else self._rng.random(fits.shape)
        return np.where(fits, drawn - self._served_times[np.ix_(candidates, rows)], -np.inf)

    def _holds(self, predicate: Predicate, needs: tuple[str, ...], rows: IntArray, states: FloatArray) -> BoolArray:
        binding = {name: self._lookup(name, rows) for name in needs}
        return holds(predicate, states, binding, self._layout, self._solved)

    def _lookup(self, name: str, rows: IntArray) -> IntArray:
        if name in self._binding:
            return self._binding[name][rows]
        return np.full(len(rows), self._layout.names.index(name), dtype=np.int64)
