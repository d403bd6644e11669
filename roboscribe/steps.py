"""The pieces of Algorithm 2, what they show, and what Algorithm 1 decides."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from roboscribe.classifier import Refinement, alternative, learn_classifier
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.segmentation import explains
from roboscribe.dsl.syntax import Predicate, Program
from roboscribe.errors import Fail, expected
from roboscribe.evidence import Evidence
from roboscribe.program_gen import gen_program
from roboscribe.subtask_tree import Node, Tree, update_tree, validate
from roboscribe.success_rate import wilson
from roboscribe.world.layout import NULL, FloatArray
from roboscribe.world.naming import by_binding

Skills = TypeVar("Skills")
"""Whatever TRAINPROGRAM returns: the algorithms pass controllers on without looking at them."""


def most_common(names: Sequence[str]) -> str:
    """Return the name that more than half of all are; "" where there is no such one."""
    return next((name for name, count in Counter(names).items() if 2 * count > len(names)), "")


@dataclass(frozen=True, eq=False)
class Failure:
    """One failing episode.

    Args:
        states: (T, F), entities named in the order of their binding; where the episode failed within a loop, only
            those in which the loop served the entity that it failed at, first named; (0, F) where physics broke.
        unreached: subgoal that the episode ended at without ever having reached it; "" where there was none.
    """

    states: FloatArray
    unreached: str = ""


@dataclass(frozen=True)
class Outcome:
    """What Exec(M, P) showed for one program and goal.

    Args:
        successes: episodes that reached the goal.
        episodes: episodes run.
        lost: the others.
    """

    successes: int
    episodes: int
    lost: tuple[Failure, ...] = ()

    @property
    def stuck_at(self) -> str:
        """Subgoal that most of the failing episodes ended at and never had reached; "" where there is no such one."""
        return most_common([each.unreached for each in self.lost])

    def failures(self, unreached: str | None = None) -> FloatArray:
        """Return N_s, (M, F): states of the failing episodes, or of those alone that were stuck at a subgoal."""
        lost = [each.states for each in self.lost if unreached in (None, each.unreached)]
        return np.concatenate(lost) if lost else np.empty((0, 0))

    @property
    def rate(self) -> float:
        """Share of episodes that reached the goal."""
        return self.successes / self.episodes

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Wilson interval of the success rate."""
        return wilson(self.successes, self.episodes)

    def beats(self, other: Outcome) -> bool:
        """Whether it is better than another, by more than one episode."""
        return self.successes > other.rate * self.episodes + 1

    @classmethod
    def of(cls, rollouts: Rollouts) -> Outcome:
        """Read rollouts; a diverged episode is a failure whose states are left out."""
        lost = tuple(_failure(rollouts, int(episode)) for episode in np.flatnonzero(~rollouts.success))
        return cls(int(rollouts.success.sum()), len(rollouts.success), lost)

    @classmethod
    def total(cls, parts: Iterable[Outcome]) -> Outcome:
        """Add up what was run in parts, at least one."""
        each = list(parts)
        lost = tuple(failure for part in each for failure in part.lost)
        return cls(sum(part.successes for part in each), sum(part.episodes for part in each), lost)


def _failure(rollouts: Rollouts, episode: int) -> Failure:
    """Keep the states in which an episode was at what it failed at, the entity that a loop served named first."""
    layout, states = rollouts.layout, rollouts.trajectories[episode].states
    if rollouts.diverged[episode]:
        return Failure(states[:0])
    bound = list(rollouts.bound[episode])
    served = rollouts.served[episode] if rollouts.served else np.empty(0, dtype=np.int64)
    if len(served) and served[-1] != NULL:
        entity = int(served[-1])
        bound = [entity, *(e for e in bound if e != entity)]
        states = states[1:][served == entity]
    unreached = rollouts.unreached[episode] if rollouts.unreached else ""
    return Failure(layout.permute(states, by_binding(layout, bound)), unreached)


@dataclass(frozen=True)
class Steps(Generic[Skills]):
    """The pieces of Algorithm 2. Pipelines wrap each to track and cache it; the algorithm stands here once.

    Args:
        generate: GENPROGRAM without training: goal and tree to program.
        train: TRAINPROGRAM: grounds every controller of a program that the given skills lack.
        roll_out: Exec(M, P) for a program, its skills and a goal.
        classify: LEARNCLASSIFIER: N_s, tree and goal to a refinement.
        alternative: the refinement with the subgoal at a rank of its table.
        update_tree: UPDATETREE: tree and refinement to tree.
        validate: VALIDATE: the reason why a tree cannot be right, or None.
        explained: how many demonstrations a program explains, and of how many.
        turns: for how many entities a node is brought about, one after the other.
        unfinished: whether steps ran out while one of the skills was still getting better.
        check: a short Exec(M, P), enough to see that a program has become much worse; None goes to `roll_out` at once.
        looser: trees in which the subgoal that failing episodes were stuck at asks for less, each with that subgoal.
        tell: hears what is decided.
    """

    generate: Callable[[str, Tree], Program | Fail]
    train: Callable[[Program, str, Tree, Skills], Skills]
    roll_out: Callable[[Program, str, Skills], Outcome]
    classify: Callable[[FloatArray, Tree, str], Refinement | Fail]
    alternative: Callable[[Refinement, int, Tree], Refinement]
    update_tree: Callable[[Tree, Refinement], Tree]
    validate: Callable[[Tree], Fail | None]
    explained: Callable[[Program], tuple[int, int]]
    turns: Callable[[Node], int] = lambda _: 1
    unfinished: Callable[[Skills], bool] = lambda _: False
    check: Callable[[Program, str, Skills], Outcome] | None = None
    looser: Callable[[Outcome, Tree], Iterable[tuple[Node, Tree]]] = lambda *_: ()
    tell: Callable[[Decision], None] = lambda _: None


@dataclass(frozen=True)
class Refined:
    """A subgoal was chosen, and these came before it in the table.

    Args:
        refinement: with what was passed over and why.
        tree: the tree with the subgoal.
        explained: demonstrations that the program of that tree explains.
        demonstrations: how many there are.
    """

    refinement: Refinement
    tree: Tree
    explained: int
    demonstrations: int


@dataclass(frozen=True)
class Abandoned:
    """A line of refinements ended without a program that is good enough; another one is taken up."""

    reason: str


@dataclass(frozen=True)
class Retrained:
    """The controllers of a promising program are trained on, before what is less likely to help.

    Args:
        success: share of the episodes in which that program has reached the goal.
    """

    success: float


@dataclass(frozen=True)
class Removed:
    """A subgoal was taken out again, for the program is as good without it."""

    node: str
    success: float


@dataclass(frozen=True)
class Loosened:
    """A program was tried with a subgoal that asks for less.

    Args:
        node: its name.
        predicate: what it asks for then.
        success: share of the episodes in which the program reaches its goal.
        helps: whether that is better than before, so that it is kept unless another one is better still.
    """

    node: str
    predicate: Predicate
    success: float
    helps: bool


Decision: TypeAlias = Refined | Abandoned | Retrained | Loosened | Removed


def pure_steps(
    evidence: Evidence,
    train: Callable[[Program, str, Tree, Skills], Skills],
    roll_out: Callable[[Program, str, Skills], Outcome],
    name: str = "P",
) -> Steps[Skills]:
    """Bind the pure functions to the demonstrations; training and rollouts arrive as callables."""
    return Steps(
        generate=lambda goal, tree: gen_program(goal, evidence, tree, name),
        train=train,
        roll_out=roll_out,
        classify=lambda failures, tree, goal: learn_classifier(failures, evidence, tree, goal),
        alternative=lambda refinement, rank, tree: alternative(refinement, rank, evidence, tree),
        update_tree=lambda tree, refinement: update_tree(tree, refinement.node, refinement.psi, refinement.place),
        validate=lambda tree: validate(tree, lambda phi, psi: evidence.edge_steps(tree, phi, psi)),
        explained=lambda program: explained(program, evidence),
        turns=evidence.turns,
    )


def explained(program: Program, evidence: Evidence) -> tuple[int, int]:
    """Count the demonstrations that a program explains, and all."""
    shown = explains(program, evidence.trajectories, evidence.solved)
    return int(shown.sum()), len(shown)


@dataclass(frozen=True)
class Solution(Generic[Skills]):
    """P*, T* and how they were found.

    Args:
        program: the program.
        tree: the abstraction it was generated from.
        skills: its controllers.
        outcome: how often it reached the goal when it was last tried.
        refinements: every refinement in order.
        removed: subgoals that were taken out again.
    """

    program: Program
    tree: Tree
    skills: Skills
    outcome: Outcome
    refinements: tuple[Refinement, ...] = ()
    removed: tuple[str, ...] = ()

    @property
    def rate(self) -> float:
        """Share of episodes that reached the goal."""
        return self.outcome.rate


NEARLY = 3.0
"""How many times as often as is allowed a program may fail that is as good as its abstraction can be."""


@dataclass(frozen=True)
class Limits:
    """When a program is good enough, and when to give up.

    Args:
        success: 1 − ε, the success rate that is wanted.
        programs: most programs that are trained.
        patience: programs that may be trained without a better one, once one cannot be told apart from what is wanted,
            or succeeds half of the time and was trained again in vain.
        refinements: most refinements of one line (Sec. 4.4 bounds them; this bounds them tighter).
    """

    success: float = 0.97
    programs: int = 40
    patience: int = 8
    refinements: int = 20

    def __post_init__(self) -> None:
        """Check the ranges."""
        expected("success", self.success, 0.0, 1.0)
        expected("programs", self.programs, 1)
        expected("patience", self.patience, 1)
        expected("refinements", self.refinements, 0)

    def met(self, outcome: Outcome) -> bool:
        """Whether an outcome is what is wanted; one episode more or less decides nothing."""
        wanted = self.success * outcome.episodes
        return outcome.successes >= min(1.0, wanted) and outcome.successes + 1 >= wanted

    def nearly(self, outcome: Outcome) -> bool:
        """Whether a program fails hardly more often than is allowed: another abstraction would hardly do better."""
        return 1.0 - outcome.rate <= NEARLY * (1.0 - self.success)

    def perhaps_nearly(self, outcome: Outcome) -> bool:
        """Whether an outcome cannot be told apart from one that fails hardly more often than is allowed."""
        return 1.0 - outcome.interval[1] <= NEARLY * (1.0 - self.success)

    def undecided(self, outcome: Outcome) -> bool:
        """Whether an outcome cannot be told apart from what is wanted: its interval reaches that far."""
        return outcome.interval[1] >= self.success

    def misled(self, learned: Outcome, evaluated: Outcome) -> bool:
        """Whether a program is good enough in the simulator it was learned in, and surely not where it is evaluated."""
        return self.met(learned) and evaluated.interval[1] < min(self.success, learned.interval[0])

    def doubtful(self, outcome: Outcome) -> bool:
        """Whether more episodes would tell if a program that fails at times is good enough: its interval has both."""
        low, high = outcome.interval
        return outcome.successes < outcome.episodes and low < self.success <= high
