"""ROBOSCRIBE and SYNTHESIZE with steps that are written down instead of computed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from roboscribe.abstraction_refinement import Limits, Solution, roboscribe
from roboscribe.dsl.syntax import And, Program, Robot, Run, Seq, Truth
from roboscribe.errors import Fail
from roboscribe.steps import Outcome, Removed
from roboscribe.subtask_tree import ROOT, TRUE, Tree
from tests.handmade import AT, HOLD, node
from tests.story import LOST, Story, root

HOLD1, AT1, LOOP1 = node("hold", HOLD, "b1"), node("at", AT, "b1"), node("at", AT, "b1", circular=True)
OTHER = node("other", AT, "c1")


def solved(story: Story, limits: Limits | None = None) -> Solution[int]:
    """Follow a story to its solution."""
    answer = roboscribe(story.steps(), 0, limits or Limits())
    assert isinstance(answer, Solution), answer.reason
    return answer


def test_a_goal_reached_at_once_needs_no_subgoal() -> None:
    answer = solved(Story(root(20)))
    assert (answer.tree, answer.rate, answer.refinements, answer.skills) == (Tree(), 1.0, (), 1)


def test_a_goal_that_is_missed_too_often_asks_for_a_subgoal() -> None:
    answer = solved(Story({**root(17), ("at", "at"): 20, **root(20, "at")}, {ROOT: [AT1]}))
    assert [r.node.name for r in answer.refinements] == ["at"]


def test_a_subgoal_is_reached_before_its_goal_is_tried_again() -> None:
    story = Story({("hold", "at hold"): 20, ("at", "at hold"): 20, **root(20, "at hold")}, {ROOT: [AT1], "at": [HOLD1]})
    answer = solved(story)
    assert story.asked == [
        (ROOT, ""),
        ("at", "at"),
        ("hold", "at hold"),
        ("at", "at hold"),
        (ROOT, "at hold"),
    ]
    assert [(r.psi, r.node.name) for r in answer.refinements] == [(ROOT, "at"), ("at", "hold")]
    assert set(answer.tree.edges) == {(TRUE, "hold"), ("hold", "at"), ("at", ROOT)}
    assert answer.program == Program(f"{ROOT}:at hold", Seq())


def test_a_subgoal_that_is_reached_in_half_of_the_episodes_is_taken_as_it_is() -> None:
    story = Story({("at", "at"): 10, **root(20, "at")}, {ROOT: [AT1], "at": [HOLD1]})
    assert names(solved(story).tree) == ["at"]
    assert story.asked == [(ROOT, ""), ("at", "at"), (ROOT, "at")]


@pytest.mark.parametrize(("turns", "taken"), [(1, False), (3, True)])
def test_a_loop_that_succeeds_in_half_of_its_turns_is_taken_as_it_is(turns: int, taken: bool) -> None:
    """Three turns in a row that each succeed in half of the episodes succeed in an eighth."""
    rates = {("hold", "at hold"): 20, ("at", "at hold"): 3, **root(20, "at hold")}
    story = Story(rates, {ROOT: [LOOP1], "at": [HOLD1, OTHER]})
    found = roboscribe(replace(story.steps(), turns=lambda node: turns if node.circular else 1), 0, Limits())
    assert isinstance(found, Solution) or not taken
    assert ((ROOT, "at hold") in story.asked) == taken


def test_it_is_refined_after_all_where_the_goal_is_missed() -> None:
    story = Story(
        {("at", "at"): 10, ("hold", "at hold"): 20, ("at", "at hold"): 20, **root(20, "at hold")},
        {ROOT: [AT1], "at": [HOLD1]},
    )
    assert [r.node.name for r in solved(story).refinements] == ["at", "hold"]
    assert story.asked.count(("at", "at")) == 1


def test_a_subgoal_that_nothing_explains_is_trained_once_more_and_taken_as_it_is() -> None:
    story = Story({("at", "at"): 3, **root(20, "at")}, {ROOT: [AT1]})
    answer = solved(story)
    assert [r.node.name for r in answer.refinements] == ["at"]
    assert story.asked == [(ROOT, ""), ("at", "at"), ("at", "at"), (ROOT, "at")]
    assert answer.skills == 4


def test_it_is_trained_on_as_long_as_that_makes_it_better() -> None:
    """Controllers learned from few demonstrations get better step by step."""
    story, reached = Story(root(20, "at"), {ROOT: [AT1]}), {2: 0, 3: 8, 4: 17, 5: 18}

    def roll_out(program: Program, goal: str, skills: int) -> Outcome:
        told = story.roll_out(program, goal, skills)
        return Outcome(reached[skills], 20, told.lost) if goal == "at" else told

    answer = roboscribe(replace(story.steps(), roll_out=roll_out), 0, Limits())
    assert isinstance(answer, Solution)
    assert story.asked == [(ROOT, ""), *[("at", "at")] * 4, (ROOT, "at")]


def test_a_loop_is_not_attempted_before_something_precedes_it() -> None:
    story = Story(
        {("hold", "at hold"): 20, ("at", "at hold"): 20, **root(20, "at hold")}, {ROOT: [LOOP1], "at": [HOLD1]}
    )
    solved(story)
    assert story.asked == [(ROOT, ""), ("hold", "at hold"), ("at", "at hold"), (ROOT, "at hold")]


def test_a_loop_that_another_branch_precedes_in_the_program_is_attempted() -> None:
    """A mug is held; then it is brought to every lamp that is lit."""
    runs = tuple(Run(name, (Robot(),), Truth()) for name in ("hold", "at"))
    reached = {("hold", "hold"): 20, ("at", "hold at"): 20, **root(20, "hold at")}
    story = Story(reached, {ROOT: [HOLD1, LOOP1], "at": [OTHER]}, bodies={"hold at": Seq(runs)})
    solved(story)
    assert story.asked == [(ROOT, ""), ("hold", "hold"), (ROOT, "hold"), ("at", "hold at"), (ROOT, "hold at")]


def test_a_loop_that_needs_nothing_is_attempted() -> None:
    story = Story({("at", "at"): 20, **root(20, "at")}, {ROOT: [LOOP1]})
    assert [r.node.name for r in solved(story).refinements] == ["at"]
    assert story.asked == [(ROOT, ""), ("at", "at"), (ROOT, "at")]


def test_controllers_are_handed_from_attempt_to_attempt() -> None:
    story = Story({("hold", "at hold"): 20, ("at", "at hold"): 20, **root(20, "at hold")}, {ROOT: [AT1], "at": [HOLD1]})
    assert solved(story).skills == len(story.asked) == 5


def test_what_the_classifier_cannot_explain_fails_with_the_rate_and_the_reason() -> None:
    story = Story(root(6), {ROOT: Fail("no predicate separates them")})
    answer = roboscribe(story.steps(), 0, Limits())
    assert answer == Fail("ψ_R is reached in 6 of 20 episodes, and no predicate separates them")


def test_a_tree_that_cannot_be_right_fails_with_the_reason() -> None:
    story = Story({}, {ROOT: [AT1]}, invalid={"at": Fail("at is never reached")})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Fail)
    assert answer.reason.startswith("ψ_R is reached in 0 of 20 episodes, and no other subgoal is left to try")
    assert f"{AT1.predicate}: at is never reached" in answer.reason
    assert story.asked == [(ROOT, "")], "nothing is trained for it"


def test_a_tree_without_a_program_fails_with_the_reason() -> None:
    story = Story({}, {ROOT: [AT1]}, unwritable={"at": Fail("no loop guard")})
    answer = roboscribe(story.steps(), 0, Limits())
    assert isinstance(answer, Fail)
    assert f"{AT1.predicate}: no loop guard" in answer.reason


def test_refinements_are_counted_across_the_whole_recursion() -> None:
    story = Story({("at", "at"): 0}, {ROOT: [AT1, OTHER], "at": [HOLD1], "hold": [OTHER]})
    answer = roboscribe(story.steps(), 0, Limits(refinements=1))
    assert isinstance(answer, Fail)
    assert "1 refinements were not enough" in answer.reason
    assert all(len(subgoals.split()) <= 1 for _, subgoals in story.asked)


TWO_STEPS = {("at", "at"): 20, ("other", "at other"): 20, **root(20, "at other")}


HELPED = {("at", "at"): 12, ("hold", "at hold"): 20, ("at", "at hold"): 20, **root(20, "at hold")}


def test_an_earlier_subgoal_that_episodes_are_stuck_at_is_refined_before_the_goal() -> None:
    """What failures at ψ_R teach is not asked for while they end before anything leads to ψ_R."""
    lessons = {ROOT: [AT1, OTHER], "at": [HOLD1]}
    story = Story({**HELPED, **root(12, "at")}, lessons, stuck={(ROOT, "at"): "at"})
    answer = solved(story)
    assert names(answer.tree) == ["at", "hold"]
    assert [(r.psi, r.node.name) for r in answer.refinements] == [(ROOT, "at"), ("at", "hold")]
    assert story.classified == [(ROOT, ""), ("at", "at")]


@pytest.mark.parametrize(("wanted", "refined"), [(0.97, "hold"), (0.95, "other")])
def test_where_few_episodes_are_stuck_the_goal_is_refined(wanted: float, refined: str) -> None:
    """17 of 20 reach it, three times as many failures as 0.95 allows: another abstraction would hardly do better."""
    lessons = {ROOT: [AT1, OTHER], "at": [HOLD1]}
    rates = {**HELPED, **root(17, "at"), ("other", "at other"): 20, **root(20, "at other")}
    answer = roboscribe(Story(rates, lessons, stuck={(ROOT, "at"): "at"}).steps(), 0, Limits(success=wanted))
    assert isinstance(answer, Solution)
    assert names(answer.tree) == ["at", refined]


def test_where_that_does_not_help_the_goal_is_refined() -> None:
    lessons = {ROOT: [AT1, OTHER], "at": [HOLD1]}
    rates = {**HELPED, **root(9, "at"), **root(2, "at hold"), ("other", "at other"): 20, **root(20, "at other")}
    answer = solved(Story(rates, lessons, stuck={(ROOT, "at"): "at"}))
    assert names(answer.tree) == ["at", "other"]


def test_where_nothing_explains_what_episodes_are_stuck_at_the_goal_is_refined_at_once() -> None:
    rates = {("at", "at"): 12, **root(12, "at"), ("other", "at other"): 20, **root(20, "at other")}
    story = Story(rates, {ROOT: [AT1, OTHER]}, stuck={(ROOT, "at"): "at"})
    assert names(solved(story).tree) == ["at", "other"]
    assert story.asked.count(("at", "at")) == 1


def test_where_no_tree_with_the_explanation_can_be_right_the_goal_is_refined_at_once() -> None:
    """Formerly the line without the explanation was taken up once more, and all that follows trained again."""
    rates = {("at", "at"): 12, **root(9, "at"), ("other", "at other"): 20, **root(9, "at other")}
    lessons, stuck = {ROOT: [AT1, OTHER], "at": [HOLD1]}, {(ROOT, "at"): "at"}
    story = Story(rates, lessons, invalid={"hold": Fail("not so")}, stuck=stuck)
    roboscribe(story.steps(), 0, Limits(programs=8))
    assert story.asked.count(("other", "at other")) == 1


def test_a_subgoal_that_does_not_help_is_removed() -> None:
    """After the other was found the task is solved without the first as often."""
    story = Story({**TWO_STEPS, **root(20, "other")}, {ROOT: [AT1, OTHER]})
    answer = solved(story)
    assert names(answer.tree) == ["other"]
    assert answer.removed == ("at",)
    assert answer.program == Program(f"{ROOT}:other", Seq())
    assert [r.node.name for r in answer.refinements] == ["at", "other"], "how they were found stays told"
    assert story.told[-1] == Removed("at", 1.0)


def test_no_atom_goes_without_which_a_subgoal_says_what_another_one_says() -> None:
    """Whatever is left has to say until when its controller acts."""
    leave = replace(OTHER, predicate=And(AT1.predicate, HOLD1.predicate))
    answer = solved(Story({**TWO_STEPS}, {ROOT: [AT1, leave]}))
    assert answer.removed == (str(AT1.predicate),)
    assert answer.tree.node("other").predicate == HOLD1.predicate


def test_what_only_led_to_a_removed_subgoal_is_removed_too() -> None:
    """The first was needed for the second only; without that one neither is missed."""
    third = node("third", AT, "d1")
    rates = {("at", "at"): 20, ("other", "at other"): 20, ("third", "at other third"): 20, **root(20, "at other third")}
    story = Story({**rates, **root(20, "at third"), **root(20, "third")}, {ROOT: [AT1, OTHER, third]})
    answer = solved(story)
    assert names(answer.tree) == ["third"]
    assert answer.removed == ("other", "at")


def test_a_subgoal_without_which_less_is_solved_stays() -> None:
    answer = solved(Story({**TWO_STEPS, **root(18, "other"), **root(18, "at")}, {ROOT: [AT1, OTHER]}))
    assert answer.removed == ()
    assert names(answer.tree) == ["at", "other"]


def test_a_subgoal_without_which_demonstrations_are_not_explained_stays() -> None:
    story = Story({**TWO_STEPS, **root(20, "other")}, {ROOT: [AT1, OTHER]}, explained={"other": 18})
    assert solved(story).removed == ()
    assert "other" not in story.checked, "it need not be tried"


def test_a_subgoal_without_which_no_tree_can_be_right_stays() -> None:
    story = Story({**TWO_STEPS, **root(20, "other")}, {ROOT: [AT1, OTHER]})
    steps = story.steps()
    refused = replace(steps, validate=lambda tree: Fail("not so") if names(tree) == ["other"] else None)
    answer = roboscribe(refused, 0, Limits())
    assert isinstance(answer, Solution)
    assert answer.removed == ()


def test_an_atom_that_does_not_help_is_removed() -> None:
    """What was learned in addition to a predecessor need not ask for the predecessor any more."""
    both = replace(AT1, predicate=And(HOLD1.predicate, AT1.predicate))
    answer = solved(Story({("at", "at"): 20, **root(20, "at")}, {ROOT: [both]}))
    assert answer.removed == (str(HOLD1.predicate),)
    assert answer.tree.node("at").predicate == AT1.predicate
    assert answer.refinements[0].node.predicate == both.predicate


def test_an_atom_without_which_less_is_solved_stays() -> None:
    both = replace(AT1, predicate=And(HOLD1.predicate, AT1.predicate))
    story = Story({("at", "at"): 20, **root(20, "at")}, {ROOT: [both]})
    steps = replace(story.steps(), check=lambda program, goal, skills: Outcome(12, 20))
    answer = roboscribe(steps, 0, Limits())
    assert isinstance(answer, Solution)
    assert answer.removed == ()
    assert answer.tree.node("at").predicate == both.predicate


def test_the_last_subgoal_is_never_removed() -> None:
    """A program without any would be one controller asked for everything."""
    answer = solved(Story({("at", "at"): 20, **root(20, "at")}, {ROOT: [AT1]}))
    assert answer.removed == ()


def test_a_short_attempt_decides_whether_a_subgoal_helps() -> None:
    story = Story({**TWO_STEPS, **root(20, "other")}, {ROOT: [AT1, OTHER]})
    assert solved(story).removed == ("at",)
    assert story.checked == ["at", "other"], "the latest first"
    assert story.asked[-1] == (ROOT, "other"), "the usual episodes confirm it"


def test_what_a_short_attempt_lets_pass_the_usual_episodes_may_keep() -> None:
    story = Story({**TWO_STEPS, **root(18, "other")}, {ROOT: [AT1, OTHER]})
    steps = replace(story.steps(), check=lambda program, goal, skills: Outcome(20, 20))
    answer = roboscribe(steps, 0, Limits())
    assert isinstance(answer, Solution)
    assert answer.removed == ()
    assert (ROOT, "other") in story.asked


def test_a_program_without_subgoals_that_mostly_succeeds_is_better_than_none() -> None:
    for successes, found in ((12, True), (9, False)):
        answer = roboscribe(Story(root(successes), {}).steps(), 0, Limits())
        assert isinstance(answer, Solution) is found


@pytest.mark.parametrize("later", [2, 0])
def test_controllers_that_became_worse_are_not_kept(later: int) -> None:
    """Nothing explains why at fails; it is trained once more, and gets worse."""
    story = Story({**root(12, "at")}, {ROOT: [AT1]})
    tries = iter([8, later])

    def roll_out(program: Program, goal: str, skills: int) -> Outcome:
        kept.append((goal, skills))
        return Outcome(next(tries), 20, LOST) if goal == "at" else story.roll_out(program, goal, skills)

    kept: list[tuple[str, int]] = []
    answer = roboscribe(replace(story.steps(), roll_out=roll_out), 0, Limits(programs=4))
    assert isinstance(answer, Solution)
    assert kept[:4] == [(ROOT, 1), ("at", 2), ("at", 3), (ROOT, 3)], "the controllers of the first training go on"


def names(tree: Tree) -> list[str]:
    """Subgoals of a tree."""
    return [node.name for node in tree.nodes[len(Tree().nodes) :]]
