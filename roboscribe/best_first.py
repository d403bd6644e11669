"""Which subgoals to try: lines of choices for Algorithm 2, the likeliest first, none of them final."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from heapq import heappop, heappush
from typing import Generic, TypeVar

from roboscribe.classifier import Refinement
from roboscribe.dsl.syntax import Predicate, Program
from roboscribe.errors import Fail
from roboscribe.steps import Limits, Loosened, Outcome, Refined, Retrained, Skills, Solution, Steps
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.world.layout import FloatArray
from roboscribe.world.trajectory import AGREEMENT

T = TypeVar("T")
TRIED, PRECEDES = "trained and did not help", "comes before the goal already"
BY_DEGREES, IN_KIND = 1, 2
"""What a choice gives away that takes the next best: hardly anything where it is worse by degrees alone."""
UNTRIED = Outcome(0, 1)
"""Of a program that was not run yet."""
PROMISING = 0.5
"""Share of the episodes from which on a program that reaches its goal may owe its failures to its controllers, and from
which on one without any subgoal is better than none."""


@dataclass
class Search(Generic[Skills]):
    """Every choice passes here: which lines are open, what was done already, what was best.

    A line is the list of its choices; a choice is the rank of what is taken among what is possible. Lines are taken up
    in the order of what they give away, latest choices first. What two lines share is done once.
    """

    steps: Steps[Skills]
    limits: Limits
    best: Solution[Skills] | None = None
    best_choices: tuple[int, ...] = ()
    trained_again: Solution[Skills] | None = None
    trained: int = 0
    since: int = 0
    open: list[tuple[int, int, tuple[int, ...]]] = field(default_factory=lambda: [(0, 0, ())])
    done: dict[tuple[object, ...], object] = field(default_factory=dict)

    def lines(self) -> Iterator[Line[Skills]]:
        """Yield one line after the other, best first, until a program is good or the budget is spent."""
        while self.open and self.trained < self.limits.programs and not self.satisfied:
            given_away, _, choices = heappop(self.open)
            begins_otherwise = choices[:1] != self.best_choices[:1]
            while not self.satisfied and self._rather_trains_again(begins_otherwise):
                self._train_again()
            if self.satisfied or (self._nearly_in_vain and (begins_otherwise or given_away >= IN_KIND)):
                return
            yield Line(self, choices, given_away)

    @property
    def satisfied(self) -> bool:
        """Whether the best program is good enough, or nothing better is to be expected.

        That is so where it is as good as can be told, or promising and trained again in vain, and nothing better was
        found lately.
        """
        if self.best is None:
            return False
        limits, outcome, in_vain = self.limits, self.best.outcome, self.best is self.trained_again
        late = self.trained >= self.since + limits.patience
        return limits.met(outcome) or (late and (in_vain or limits.undecided(outcome)))

    @property
    def _nearly_in_vain(self) -> bool:
        """Whether the best program was trained again in vain, and fails hardly more often than is allowed."""
        best = self.best
        return best is not None and best is self.trained_again and self.limits.nearly(best.outcome)

    def _rather_trains_again(self, begins_otherwise: bool) -> bool:
        """Whether a promising best program owes its failures to its controllers more likely than to its subgoals.

        That is so before a line gives up all that it stands on, beginning with its first subgoal; before any line where
        it perhaps fails hardly more often than is allowed.
        """
        best = self.best
        if best is None or best is self.trained_again or self.trained >= self.limits.programs:
            return False
        return (begins_otherwise and best.outcome.rate >= PROMISING) or self.limits.perhaps_nearly(best.outcome)

    def _train_again(self) -> None:
        """Train the controllers of the best program once more; what becomes better by that may be trained again."""
        best = self.best
        assert best is not None
        self.trained_again = best
        self.steps.tell(Retrained(best.outcome.rate))
        self.keep(self.train(ROOT, best), self.best_choices)

    def train(self, psi: str, untrained: Solution[Skills]) -> Solution[Skills]:
        """TRAINPROGRAM and Exec(M, P); counts against the budget."""
        self.trained += 1
        program, tree = untrained.program, untrained.tree
        skills = self.steps.train(program, psi, tree, untrained.skills)
        found = replace(untrained, skills=skills, outcome=self.steps.roll_out(program, psi, skills))
        while (looser := self._looser(psi, found)) is not None:
            found = looser
        return found

    def _looser(self, psi: str, found: Solution[Skills]) -> Solution[Skills] | None:
        """Loosen the subgoal that most failing episodes were stuck at; None where that does not help.

        What a loop is to bring about for every entity stays as it is until ψ_R tells whether less is enough.
        """
        if found.outcome.successes == 0 or self.limits.met(found.outcome):
            return None
        best = found
        for node, tree in self.steps.looser(found.outcome, found.tree):
            asked_for = node.name == psi or (node.circular and psi != ROOT)
            if asked_for or isinstance(possible_program(tree, self.steps), Fail):
                continue
            program = self.steps.generate(psi, tree)
            assert isinstance(program, Program)  # it differs from the present one by a number
            outcome = self.steps.roll_out(program, psi, found.skills)
            helps = outcome.beats(best.outcome)
            self.steps.tell(Loosened(node.name, node.predicate, outcome.rate, helps))
            best = replace(found, program=program, tree=tree, outcome=outcome) if helps else best
        return None if best is found else best

    def is_getting_better(self, found: Solution[Skills]) -> bool:
        """Whether a promising program's controllers were still getting better when their steps ran out."""
        promising = found.rate >= PROMISING and not self.limits.met(found.outcome)
        return promising and self.trained < self.limits.programs and self.steps.unfinished(found.skills)

    def keep(self, found: Solution[Skills], choices: tuple[int, ...] = ()) -> None:
        """Remember a solution, and the choices of its line, if it is better than the best so far, or good enough."""
        if self.best is None or found.outcome.beats(self.best.outcome) or self._is_first_good_enough(found):
            self.best, self.best_choices, self.since = found, choices, self.trained

    def _is_first_good_enough(self, found: Solution[Skills]) -> bool:
        best = self.best
        return best is not None and self.limits.met(found.outcome) and not self.limits.met(best.outcome)

    def leave_open(self, choices: tuple[int, ...], given_away: int) -> None:
        """Remember that another choice is possible."""
        heappush(self.open, (given_away, -len(choices), choices))


@dataclass
class Line(Generic[Skills]):
    """The pieces of Algorithm 2 along one line of choices."""

    search: Search[Skills]
    choices: tuple[int, ...]
    given_away: int = 0
    taken: tuple[int, ...] = ()
    calls: int = 0
    refinements: list[Refinement] = field(default_factory=list)
    exhausted: bool = False
    """Whether every choice at the last place was made by earlier lines."""

    @property
    def limits(self) -> Limits:
        """Accuracy asked and effort allowed."""
        return self.search.limits

    def generate(self, psi: str, tree: Tree) -> Program | Fail:
        """GENPROGRAM."""
        return self._once(lambda: self.search.steps.generate(psi, tree))

    def attempt(self, program: Program, psi: str, tree: Tree, skills: Skills) -> Solution[Skills] | Fail:
        """TRAINPROGRAM and Exec(M, P); a subgoal may ask for less than before where that helps."""
        return self._once(lambda: self._attempt(program, psi, tree, skills))

    def _attempt(self, program: Program, psi: str, tree: Tree, skills: Skills) -> Solution[Skills] | Fail:
        search, steps = self.search, self.search.steps
        if search.trained >= search.limits.programs:
            return Fail(
                f"the budget of {search.limits.programs} trained programs is spent; "
                f"`--set limits.programs={2 * search.limits.programs}` allows for more"
            )
        found = search.train(psi, Solution(program, tree, skills, UNTRIED))
        in_vain = False
        while psi == ROOT and not in_vain and search.is_getting_better(found):
            steps.tell(Retrained(found.rate))
            again = search.train(psi, found)
            in_vain = not again.outcome.beats(found.outcome)
            found = found if in_vain else again
        blind = tree == Tree()
        if psi == ROOT and found.outcome.successes and (not blind or found.rate >= PROMISING):
            kept = replace(found, refinements=tuple(self.refinements))
            search.keep(kept, self.taken)
            search.trained_again = kept if in_vain and search.best is kept else search.trained_again
        return found

    def is_promising(self, psi: str, found: Solution[Skills]) -> bool:
        """Whether a subgoal is reached often enough to be taken as it is at first: of a loop, in each of its turns."""
        return found.rate >= PROMISING ** self.search.steps.turns(found.tree.node(psi))

    def goes_on(self) -> bool:
        """Whether a subgoal that is reached often, but not often enough, is taken as it is."""
        return self._first_of_two()

    def _first_of_two(self) -> bool:
        rank = self._choose()
        if rank == 0:
            self._leave_open(IN_KIND)
        return rank == 0

    def refine(
        self, failures: FloatArray, tree: Tree, psi: str, *, optional: bool = False
    ) -> tuple[Refinement, Tree] | Fail:
        """LEARNCLASSIFIER, UPDATETREE and VALIDATE: the subgoal at this line's rank among those that can be right.

        Where that is `optional`, other lines go on without it.
        """
        options = self._once(lambda: self._options(failures, tree, psi))
        if isinstance(options, Fail):
            return options
        if optional:
            first = options.at(0)
            if isinstance(first, Fail):
                return first
            if not self._first_of_two():
                return Fail(f"{psi} is not refined along this line")
        rank = self._choose()
        refined = self._once(lambda: self._refined(options, rank))
        if isinstance(refined, Fail):
            self.exhausted = rank > 0
            return refined
        self._leave_open(BY_DEGREES if options.next_is_alike(rank) else IN_KIND)
        self.refinements.append(refined.refinement)
        return refined.refinement, refined.tree

    def _refined(self, options: _Options[Skills], rank: int) -> Refined | Fail:
        refined = options.at(rank)
        if not isinstance(refined, Fail):
            self.search.steps.tell(refined)
        return refined

    def _options(self, failures: FloatArray, tree: Tree, psi: str) -> _Options[Skills] | Fail:
        if len(self.refinements) >= self.limits.refinements:
            return Fail(f"{self.limits.refinements} refinements were not enough")
        found = self.search.steps.classify(failures, tree, psi)
        if isinstance(found, Fail):
            return found
        nodes = [each.node for each in self.refinements if each.psi == psi]
        before = frozenset((node.predicate, node.only, node.afterwards) for node in nodes)
        return _Options(self.search.steps, found, tree, before)

    def _choose(self) -> int:
        """Take the next choice; beyond those given the best."""
        place = len(self.taken)
        rank = self.choices[place] if place < len(self.choices) else 0
        self.taken = (*self.taken, rank)
        return rank

    def _leave_open(self, price: int) -> None:
        """Leave the next best open, which gives so much more away, unless an earlier line did."""
        if len(self.taken) >= len(self.choices):
            self.search.leave_open((*self.taken[:-1], self.taken[-1] + 1), self.given_away + price)

    def _once(self, act: Callable[[], T]) -> T:
        """Do what this line has not done in common with an earlier one."""
        key = (self.taken, self.calls)
        self.calls += 1
        if key not in self.search.done:
            self.search.done[key] = act()
        return self.search.done[key]  # type: ignore[return-value]  # the key tells what was done


@dataclass
class _Options(Generic[Skills]):
    """The subgoals of a table that can be right, found one after the other; those `before` the goal are no other."""

    steps: Steps[Skills]
    refinement: Refinement
    tree: Tree
    before: frozenset[tuple[Predicate, Predicate, bool]]
    found: list[Refined] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    passed: list[tuple[str, str]] = field(default_factory=list)
    looked_at: int = 0

    def at(self, rank: int) -> Refined | Fail:
        """Return the one at a rank; Fail where there are not so many."""
        while len(self.found) <= rank and self.looked_at < len(self.refinement.table):
            self._look()
        if rank < len(self.found):
            return self.found[rank]
        reasons = "; ".join(f"{phi}: {why}" for phi, why in self.passed[:3])
        return Fail(
            f"no other subgoal is left to try ({reasons or 'none separates'}); another attribute, or more "
            f"demonstrations, may offer one, and a larger `--budget` teaches better what was tried"
        )

    def next_is_alike(self, rank: int) -> bool:
        """Whether the next row of the table is worse than the subgoal at `rank` by degrees alone."""
        row, following = self.refinement.table[self.rows[rank]], self.refinement.table[self.rows[rank] + 1 :]
        return bool(following) and following[0].levels == row.levels

    def _look(self) -> None:
        """Look at the next row of the table before anything is trained for it."""
        row = self.looked_at
        candidate = self.refinement.table[row]
        if (candidate.predicate, candidate.only, candidate.afterwards) in self.before:
            self.passed.append((str(candidate.predicate), PRECEDES))
            self.looked_at += 1
            return
        refinement = self.steps.alternative(self.refinement, row, self.tree)
        self.looked_at += 1
        tree = self.steps.update_tree(self.tree, refinement)
        possible = possible_program(tree, self.steps)
        if isinstance(possible, Fail):
            self.passed.append((str(candidate.predicate), possible.reason))
            return
        self.rows.append(row)
        passed = (*((str(r.refinement.node.predicate), TRIED) for r in self.found), *self.passed)
        self.found.append(
            Refined(replace(refinement, passed_over=passed), tree, possible.explained, possible.demonstrations)
        )


@dataclass(frozen=True)
class Possible:
    """The program of a tree that can be right, and how many of the demonstrations it explains."""

    program: Program
    explained: int
    demonstrations: int


def possible_program(tree: Tree, steps: Steps[Skills]) -> Possible | Fail:
    """Generate the program of a tree; Fail where the demonstrations say that it cannot be right."""
    invalid = steps.validate(tree)
    program = steps.generate(ROOT, tree) if invalid is None else invalid
    if isinstance(program, Fail):
        return program
    count, shown = steps.explained(program)
    if count < AGREEMENT * shown:
        return Fail(f"its program explains {count} of {shown} demonstrations")
    return Possible(program, count, shown)
