"""Demonstrations as the algorithms use them: consistently named, and asked when a predicate first holds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from roboscribe.dsl.semantics import SolvedTest, holds
from roboscribe.dsl.syntax import Predicate
from roboscribe.dsl.types import named_entities
from roboscribe.subtask_tree import NEVER, TRUE, Tree
from roboscribe.world.layout import FloatArray, IntArray, Layout
from roboscribe.world.naming import by_displacement
from roboscribe.world.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Evidence:
    """D, the demonstrations, with the black box ψ_R.

    Args:
        trajectories: demonstrations in which one name plays one role, see `of`.
        solved: ψ_R.
    """

    trajectories: tuple[Trajectory, ...]
    solved: SolvedTest

    @classmethod
    def of(cls, trajectories: Iterable[Trajectory], solved: SolvedTest) -> Evidence:
        """Name the entities of each demonstration by the order in which they are first displaced."""
        return cls(tuple(t.renamed(by_displacement(t)) for t in trajectories), solved)

    @property
    def layout(self) -> Layout:
        """Meaning of the states."""
        return self.trajectories[0].layout

    @cached_property
    def types(self) -> dict[str, str]:
        """Type of every named entity."""
        return named_entities(self.layout)

    @cached_property
    def states(self) -> FloatArray:
        """All frames (S, F), one demonstration after the other."""
        return np.concatenate([t.states for t in self.trajectories])

    @cached_property
    def starts(self) -> IntArray:
        """Where each demonstration begins in `states`, (D,)."""
        lengths = [len(t) for t in self.trajectories]
        return np.concatenate([[0], np.cumsum(lengths)[:-1]]).astype(np.int64)

    def first_steps(self, predicate: Predicate) -> IntArray:
        """Step at which a predicate first holds in each demonstration, (D,); NEVER where it does not."""
        truth = holds(predicate, self.states, {}, self.layout, self.solved)
        parts = np.split(truth, self.starts[1:])
        return np.array([part.argmax() if part.any() else NEVER for part in parts], dtype=np.int64)

    def first_steps_of(self, tree: Tree) -> dict[str, IntArray]:
        """`first_steps` of every node but True, as VALIDATE needs them."""
        return {n.name: self.first_steps(n.lifted(self.types)) for n in tree.nodes if n.name != TRUE}

    def states_before(self, predicate: Predicate) -> FloatArray:
        """P_s: in each demonstration the state before the predicate first holds, (≤ D, F).

        Source:  Algorithm 2, line 6.
        Departs: only the first crossing of a demonstration counts; noise makes later ones.
        """
        first = self.first_steps(predicate)
        rows = [s + f - 1 for s, f in zip(self.starts, first, strict=True) if 0 < f < NEVER]
        return self.states[rows]
