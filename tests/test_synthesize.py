"""ROBOSCRIBE and SYNTHESIZE with steps that are written down instead of computed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from roboscribe.classifier import Refinement
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.syntax import Program, Seq
from roboscribe.envs.point_world import PointTask
from roboscribe.errors import Fail
from roboscribe.subtask_tree import ROOT, Node, Tree, update_tree
from roboscribe.synthesize import Limits, Outcome, Solution, Steps, roboscribe
from roboscribe.world.layout import FloatArray
from roboscribe.world.trajectory import Trajectory
from tests.handmade import AT, HOLD, node

LAYOUT = PointTask("toy", ("block",) * 3).layout
HOLD1, AT1 = node("hold", HOLD, "b1"), node("at", AT, "b1")


@dataclass
class Story:
    """What each attempt at a goal will show, and what each failure teaches; keeps what was asked."""

    successes: dict[str, list[int]]
    lessons: dict[str, list[Node | Fail]]
    invalid: dict[str, Fail] = field(default_factory=dict)
    unwritable: dict[str, Fail] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)

    def steps(self) -> Steps[int]:
        """Build steps that follow the story; skills are a count of trainings."""
        return Steps(
            generate=lambda goal, tree: self.unwritable.get(goal, Program(f"{goal}{len(tree.nodes)}", Seq())),
            train=lambda program, goal, tree, skills: skills + 1,
            roll_out=self.roll_out,
            classify=self.classify,
            update_tree=lambda tree, refinement: update_tree(tree, refinement.node, refinement.psi),
            validate=lambda tree: next((self.invalid[n.name] for n in tree.nodes if n.name in self.invalid), None),
        )

    def roll_out(self, program: Program, goal: str, skills: int) -> Outcome:
        """Attempt a goal."""
        self.asked.append(goal)
        return Outcome(self.successes[goal].pop(0), 20, np.full((1, LAYOUT.size), float(skills)))

    def classify(self, failures: FloatArray, tree: Tree, goal: str) -> Refinement | Fail:
        """Learn from a failed attempt."""
        lesson = self.lessons[goal].pop(0)
        return lesson if isinstance(lesson, Fail) else Refinement(goal, lesson, False, (), 1, len(failures))


def test_a_goal_reached_at_once_needs_no_subgoal() -> None:
    story = Story({ROOT: [19]}, {})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Solution)
    assert (answer.tree, answer.rate, answer.refinements, answer.skills) == (Tree(), 0.95, (), 1)


def test_one_success_too_few_asks_for_a_subgoal() -> None:
    story = Story({ROOT: [15, 20], "at": [20]}, {ROOT: [AT1]})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Solution)
    assert [r.node.name for r in answer.refinements] == ["at"]


def test_more_is_asked_of_a_subgoal_than_of_the_task() -> None:
    story = Story({ROOT: [0, 16], "at": [18, 20], "hold": [20]}, {ROOT: [AT1], "at": [HOLD1]})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Solution)
    assert answer.rate == 0.8
    assert [r.node.name for r in answer.refinements] == ["at", "hold"]


def test_a_subgoal_is_reached_before_its_goal_is_tried_again() -> None:
    story = Story({ROOT: [0, 20], "at": [0, 20], "hold": [20]}, {ROOT: [AT1], "at": [HOLD1]})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Solution)
    assert story.asked == [ROOT, "at", "hold", "at", ROOT]
    assert [(r.psi, r.node.name) for r in answer.refinements] == [(ROOT, "at"), ("at", "hold")]
    assert set(answer.tree.edges) == {("True", "hold"), ("hold", "at"), ("at", ROOT)}
    assert answer.program == Program(f"{ROOT}4", Seq())


def test_controllers_are_handed_from_attempt_to_attempt() -> None:
    story = Story({ROOT: [0, 0, 20], "at": [20], "hold": [20]}, {ROOT: [HOLD1, AT1]})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Solution)
    assert answer.skills == len(story.asked) == 5


def test_what_the_classifier_cannot_explain_fails_with_the_rate_and_the_reason() -> None:
    story = Story({ROOT: [6]}, {ROOT: [Fail("no predicate separates them")]})
    answer = roboscribe(story.steps(), 0, Limits())
    assert answer == Fail("ψ_R is reached in only 30% of the episodes, and no predicate separates them")


def test_a_tree_that_cannot_be_right_fails_with_the_reason() -> None:
    story = Story({ROOT: [0]}, {ROOT: [AT1]}, invalid={"at": Fail("at is never reached")})
    assert roboscribe(story.steps(), 0, Limits()) == Fail("at is never reached")
    assert story.asked == [ROOT]


def test_a_tree_without_a_program_fails_with_the_reason() -> None:
    story = Story({ROOT: [0]}, {ROOT: [AT1]}, unwritable={"at": Fail("no loop guard")})
    assert roboscribe(story.steps(), 0, Limits()) == Fail("no loop guard")


def test_refinements_are_counted_across_the_whole_recursion() -> None:
    story = Story({ROOT: [0, 0], "at": [0, 20], "hold": [20]}, {ROOT: [AT1], "at": [HOLD1]})
    answer = roboscribe(story.steps(), 0, Limits(refinements=2))
    assert answer == Fail("ψ_R is reached in only 0% of the episodes after the last refinement allowed")


def test_failures_are_named_by_binding_and_broken_episodes_left_out() -> None:
    states = np.arange(3 * LAYOUT.size, dtype=np.float64).reshape(3, LAYOUT.size)
    episodes = tuple(Trajectory(LAYOUT, row[None]) for row in states)
    ran = Rollouts(
        LAYOUT,
        episodes,
        success=np.array([True, False, False]),
        diverged=np.array([False, False, True]),
        bound=((0,), (2, 0), (1,)),
        control_steps=0,
        lines=(np.empty(0, dtype=np.int64),) * 3,
    )
    outcome = Outcome.of(ran)
    assert (outcome.successes, outcome.episodes) == (1, 3)
    assert np.array_equal(outcome.failures, LAYOUT.permute(states[1:2], (2, 0, 1)))
