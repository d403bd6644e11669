"""The pieces of Algorithm 2 written down instead of computed: which trees succeed, and what failures teach."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from roboscribe.classifier import Refinement
from roboscribe.dsl.syntax import Program, Seq, Statement
from roboscribe.errors import Fail
from roboscribe.search.candidates import Candidate
from roboscribe.steps import Decision, Failure, Outcome, Steps
from roboscribe.subtask_tree import ROOT, Node, Tree, update_tree
from roboscribe.world.layout import FloatArray

EPISODES = 20
LOST = (Failure(np.zeros((1, 2))),)
MOST_DECISIONS = 1000
"""No story has so many."""


def candidate(node: Node) -> Candidate:
    """Write a row of a table."""
    return Candidate(
        predicate=node.predicate,
        accepted=0.0,
        initial=0.0,
        kept=1.0,
        first=0.5,
        copy=False,
        relevant=True,
        advances=True,
        margin=0.1,
        scales=(),
        entities=1,
        bits=3.0,
        size=5,
        family=node.name,
    )


@dataclass
class Story:
    """What each attempt at a goal will show, and what each failure teaches; keeps what was asked and told.

    Args:
        successes: by goal and subgoals there are, joined by blanks in the order in which they were found ("at hold"),
            how many of 20 episodes succeed; goals that are not listed always fail.
        lessons: by goal, the subgoals that its failures suggest, best first; those that are there already are skipped.
        invalid: by subgoal, why no tree with it can be right.
        unwritable: by subgoal, why no program has it.
        stuck: by goal and subgoals there are, the subgoal that the failing episodes were stuck at.
        bodies: by all subgoals there are, the program's statements; none if not listed.
        explained: by all subgoals there are, how many of 20 demonstrations the program explains; all if not listed.
        later: by goal and subgoals, how many succeed after each further training; better until the last.
    """

    successes: Mapping[tuple[str, str], int]
    lessons: Mapping[str, Sequence[Node] | Fail] = field(default_factory=dict)
    invalid: Mapping[str, Fail] = field(default_factory=dict)
    unwritable: Mapping[str, Fail] = field(default_factory=dict)
    stuck: Mapping[tuple[str, str], str] = field(default_factory=dict)
    bodies: Mapping[str, Statement] = field(default_factory=dict)
    explained: Mapping[str, int] = field(default_factory=dict)
    later: Mapping[tuple[str, str], Sequence[int]] = field(default_factory=dict)
    asked: list[tuple[str, str]] = field(default_factory=list)
    classified: list[tuple[str, str]] = field(default_factory=list)
    checked: list[str] = field(default_factory=list)
    told: list[Decision] = field(default_factory=list)

    def steps(self) -> Steps[int]:
        """Build steps that follow the story; skills are a count of trainings."""
        return Steps(
            generate=self.generate,
            train=lambda program, goal, tree, skills: skills + 1,
            roll_out=self.roll_out,
            classify=self.classify,
            alternative=self.alternative,
            update_tree=lambda tree, found: update_tree(tree, found.node, found.psi, found.place),
            validate=lambda tree: self._first(self.invalid, tree),
            explained=lambda program: (self.explained.get(" ".join(_parts(program)), 20), 20),
            check=self.check,
            unfinished=lambda _: self.asked.count(self.asked[-1]) <= len(self.later.get(self.asked[-1], ())),
            tell=self.tell,
        )

    def generate(self, goal: str, tree: Tree) -> Program | Fail:
        """Write a program that says what it was written for."""
        body = self.bodies.get(_names(tree), Seq())
        return self._first(self.unwritable, tree) or Program(f"{goal}:{_names(tree)}", body)

    def tell(self, decision: Decision) -> None:
        """Hear what is decided; a search that goes on for ever is stopped."""
        self.told.append(decision)
        assert len(self.told) < MOST_DECISIONS, f"the search does not end; it last said {decision}"

    def roll_out(self, program: Program, goal: str, skills: int) -> Outcome:
        """Attempt a goal."""
        self.asked.append((goal, " ".join(_parts(program))))
        return self.outcome(program, goal)

    def check(self, program: Program, goal: str, skills: int) -> Outcome:
        """Attempt a goal for a short while."""
        self.checked.append(" ".join(_parts(program)))
        return self.outcome(program, goal)

    def outcome(self, program: Program, goal: str) -> Outcome:
        """Read how an attempt ends."""
        attempt = goal, " ".join(_parts(program))
        lost = tuple(replace(each, unreached=self.stuck.get(attempt, "")) for each in LOST)
        turns = (self.successes.get(attempt, 0), *self.later.get(attempt, ()))
        return Outcome(turns[min(max(self.asked.count(attempt), 1), len(turns)) - 1], EPISODES, lost)

    def classify(self, failures: FloatArray, tree: Tree, goal: str) -> Refinement | Fail:
        """Learn from a failed attempt."""
        self.classified.append((goal, _names(tree)))
        lesson = self.lessons.get(goal, Fail(f"nothing explains {goal}"))
        if isinstance(lesson, Fail):
            return lesson
        there = {node.name for node in tree.nodes}
        table = tuple(candidate(node) for node in lesson if node.name not in there)
        if not table:
            return Fail(f"nothing else explains {goal}")
        return self.alternative(Refinement(goal, tree.node(goal), table, 1, len(failures)), 0, tree)

    def alternative(self, refinement: Refinement, rank: int, tree: Tree) -> Refinement:
        """Take a row of the table."""
        lesson = self.lessons[refinement.psi]
        assert not isinstance(lesson, Fail)
        return replace(refinement, node=next(n for n in lesson if n.name == refinement.table[rank].family))

    @staticmethod
    def _first(fails: Mapping[str, Fail], tree: Tree) -> Fail | None:
        return next((fails[node.name] for node in tree.nodes if node.name in fails), None)


def _names(tree: Tree) -> str:
    """Subgoals of a tree in the order in which they were found."""
    return " ".join(node.name for node in tree.nodes[len(Tree().nodes) :])


def _parts(program: Program) -> list[str]:
    """Subgoals of the tree that a program was written for."""
    return program.name.partition(":")[2].split()


def root(successes: int, subgoals: str = "") -> dict[tuple[str, str], int]:
    """How many episodes solve the task with some subgoals."""
    return {(ROOT, subgoals): successes}
