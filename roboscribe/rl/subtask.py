"""What one skill is asked to do: reach φ from its start states within a step limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.semantics import Binding, holds
from roboscribe.dsl.syntax import Not, Predicate, Solved, Truth
from roboscribe.reward import reward
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import Task


@dataclass(frozen=True)
class Invariant:
    """φ of a circular node about one entity: true of those that the loop has served.

    Args:
        reached: φ.
        variable: its free variable.
        kind: type of the entities it ranges over.
    """

    reached: Predicate
    variable: str
    kind: str


@dataclass(frozen=True)
class Subtask:
    """An ordinary goal-reaching problem cut out of a program: one π_φ until φ.

    Args:
        task: where it is to be done.
        until: φ.
        variables: names of the entities a start state binds, in order.
        limit: control steps allowed.
        confirm: consecutive steps for which φ must hold.
        continues_if: where it is true the program goes on once φ is reached; elsewhere it is over, and ψ_R is wanted,
            too.
        scales: unit of each atom's margin, by the text of its left term.
        invariant: what a loop around the skill brings about, one entity after the other; what stands must stay.
    """

    task: Task
    until: Predicate
    variables: tuple[str, ...]
    limit: int
    confirm: int = CONFIRM
    continues_if: Predicate = field(default_factory=Truth)
    scales: Mapping[str, float] = field(default_factory=dict)
    invariant: Invariant | None = None

    @property
    def opaque(self) -> bool:
        """Whether φ is ψ_R itself."""
        return isinstance(self.until, Solved)

    @property
    def needed(self) -> int:
        """Consecutive steps on which `achieved` must be true: ψ_R alone counts at once."""
        return 1 if self.opaque or self.continues_if == Not(Truth()) else self.confirm

    def binding(self, entities: IntArray) -> Binding:
        """Bind the variables to the columns of entities (R, n)."""
        return {name: entities[:, rank] for rank, name in enumerate(self.variables)}

    def holds(self, states: FloatArray, entities: IntArray) -> BoolArray:
        """Evaluate φ on states (R, F) with bound entities (R, n); returns (R,)."""
        found = holds(self.until, states, self.binding(entities), self.task.layout, self.task.solved)
        return np.broadcast_to(found, states.shape[:1])

    def achieved(self, states: FloatArray, entities: IntArray) -> BoolArray:
        """Evaluate what the skill is measured by: φ where the program goes on, else ψ_R; returns (R,)."""
        if self.continues_if == Truth():  # as for most skills, at every step of their training
            return self.holds(states, entities)
        continues_if = holds(self.continues_if, states, {}, self.task.layout, self.task.solved)
        return np.where(continues_if, self.holds(states, entities), self.task.solved(states))

    @cached_property
    def others(self) -> IntArray:
        """Entities (K,) that a loop around the skill serves."""
        kind = None if self.invariant is None else self.invariant.kind
        return np.array([] if kind is None else self.task.layout.of_type(kind), np.int64)

    def _served(self, invariant: Invariant, states: FloatArray) -> BoolArray:
        """Tell for which of the `others` the loop's φ holds; states (R, F), returns (R, K)."""
        binding = {invariant.variable: self.others}
        return holds(invariant.reached, states[:, None], binding, self.task.layout, self.task.solved)

    def protected(self, states: FloatArray, entities: IntArray) -> BoolArray:
        """Tell which entities a loop has served and this skill is not to touch; (R, K), K of the loop's type."""
        if self.invariant is None:
            return np.zeros((len(states), 0), np.bool_)
        unbound = (entities[:, :, None] != self.others).all(axis=1)
        protected: BoolArray = unbound & self._served(self.invariant, states)
        return protected

    def invariant_holds(self, states: FloatArray, protected: BoolArray) -> BoolArray:
        """Tell whether everything that was `protected` (R, K) at the start still is; returns (R,)."""
        if self.invariant is None:
            return np.ones(len(states), np.bool_)
        invariant_holds: BoolArray = (~protected | self._served(self.invariant, states)).all(axis=1)
        return invariant_holds

    def shaped(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return R_φ and +1 while φ holds, (R,).

        Source: Sec. 4.3.3 with the bonus of the authors' implementation.
        """
        margin = reward(
            self.until, states, self.binding(entities), self.task.layout, self.scales, solved=self.task.solved
        )
        return margin + self.holds(states, entities)
