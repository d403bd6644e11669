"""Which looser subgoals failing episodes suggest, and when one is taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.abstraction_refinement import Limits, Solution, roboscribe
from roboscribe.best_first import Search
from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.syntax import Program, Seq
from roboscribe.envs.point_world import PointTask
from roboscribe.loosening import looser
from roboscribe.steps import Failure, Loosened, Outcome
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree
from tests.handmade import AT, HOLD, node, state
from tests.story import Story, root

LAYOUT = PointTask("toy", ("block",)).layout
NEAR = "‖μ↓xz − b1↓xz‖ < 0.01"


def stuck(*distances: float, at: str = "hold", height: float = 0.2) -> Failure:
    """Draw an episode in which the hand is so far from b1, step by step."""
    goal = np.array([[0.5, 0.5]])
    rows = [state(LAYOUT, np.array([d, height]), np.array([[0.0, height]]), goal) for d in distances]
    return Failure(np.stack(rows), at)


def tree_of(predicate: str) -> Tree:
    """Build a tree with one subgoal."""
    found = Node("hold", parse_predicate(predicate))
    return Tree((*Tree().nodes, found), ((TRUE, "hold"), ("hold", ROOT)))


def suggested(predicate: str, *lost: Failure) -> list[str]:
    """List the looser predicates."""
    found = list(looser(Outcome(9, 9 + len(lost), lost), tree_of(predicate), LAYOUT))
    assert all(tree.node("hold") == changed for changed, tree in found)
    return [str(changed.predicate) for changed, _ in found]


def test_thresholds_let_half_and_nine_tenths_of_the_episodes_pass() -> None:
    ends = (0.02, 0.02, 0.03, 0.04, 0.05)
    found = suggested(NEAR, *(stuck(0.3, end, end, end) for end in ends))
    assert found == ["‖μ↓xz − b1↓xz‖ < 0.0301", "‖μ↓xz − b1↓xz‖ < 0.0501"]


def test_what_is_only_touched_does_not_count() -> None:
    """A subgoal has to hold for some steps to count as reached."""
    (found,) = suggested(NEAR, *(stuck(0.3, 0.02, 0.04, 0.04, 0.04, 0.3) for _ in range(3)))
    assert found == "‖μ↓xz − b1↓xz‖ < 0.0401"


def test_what_has_to_lie_beyond_may_lie_less_far_beyond() -> None:
    (found,) = suggested("b1↓z > 0.3", *(stuck(0.3, 0.3, 0.3, height=0.25) for _ in range(3)))
    assert found == "b1↓z > 0.249"


def test_one_atom_is_loosened_where_the_others_hold() -> None:
    both = f"({NEAR} ∧ b1↓z > 0.3)"
    low = [stuck(0.02, 0.02, 0.02, height=0.25) for _ in range(3)]
    assert suggested(both, *low) == [], "neither alone lets anything pass"
    high = [stuck(0.02, 0.02, 0.02, height=0.35) for _ in range(3)]
    assert suggested(both, *high) == ["‖μ↓xz − b1↓xz‖ < 0.0201 ∧ b1↓z > 0.3"]


@pytest.mark.parametrize(
    "lost",
    [
        (stuck(0.02, 0.02, 0.02), stuck(0.02, 0.02, 0.02)),
        tuple(stuck(0.02, 0.02, 0.02, at="at") for _ in range(5)),
        tuple(Failure(np.zeros((0, LAYOUT.size)), "hold") for _ in range(5)),
    ],
    ids=["too few", "stuck elsewhere", "physics broke"],
)
def test_some_failures_say_nothing(lost: tuple[Failure, ...]) -> None:
    assert suggested(NEAR, *lost) == []


HOLD1, AT1 = node("hold", HOLD, "b1"), node("at", AT, "b1")
LOOSE = replace(HOLD1, predicate=parse_predicate("‖μ↓xz − b1↓xz‖ < 0.02"))
TOO_LOOSE = replace(HOLD1, predicate=parse_predicate("‖μ↓xz − b1↓xz‖ < 0.2"))


@pytest.mark.parametrize(("strict", "helps"), [(15, True), (18, False), (3, True), (0, False)])
def test_a_program_that_succeeds_at_times_is_tried_with_looser_subgoals(strict: int, helps: bool) -> None:
    """One episode more is no gain, and what never succeeds lacks more than a number."""
    rates = {("at", "at"): 3, ("hold", "at hold"): 20, ("at", "at hold"): 20}
    story = Story(
        {**rates, **root(strict, "at hold"), **root(19, "loose"), **root(5, "too")}, {ROOT: [AT1], "at": [HOLD1]}
    )
    steps, told = story.steps(), story.told
    names = {LOOSE.predicate: "loose", TOO_LOOSE.predicate: "too", HOLD1.predicate: "at hold"}

    def generate(goal: str, tree: Tree) -> Program:
        program = story.generate(goal, tree)
        assert isinstance(program, Program)
        held = next((each.predicate for each in tree.nodes if each.name == "hold"), None)
        return program if held is None else replace(program, name=f"{goal}:{names[held]}")

    def suggest(outcome: Outcome, tree: Tree) -> list[tuple[Node, Tree]]:
        present = [each for each in tree.nodes if each.name == "hold" and each.predicate == HOLD1.predicate]
        return [(wider, tree.replacing(wider)) for wider in (LOOSE, TOO_LOOSE) if present]

    answer = roboscribe(replace(steps, generate=generate, looser=suggest), 0, Limits(success=0.97))
    assert isinstance(answer, Solution) or not helps
    told_of = [each for each in told if isinstance(each, Loosened)]
    tried = [(each.predicate, each.helps) for each in told_of]
    assert set(tried) == ({(LOOSE.predicate, helps), (TOO_LOOSE.predicate, False)} if strict else set())
    if helps:
        assert isinstance(answer, Solution)
        assert answer.tree.node("hold").predicate == LOOSE.predicate
        assert answer.refinements[1].node == HOLD1, "how it was found stays told"


def test_what_a_loop_brings_about_asks_for_less_where_the_task_is_solved_with_it() -> None:
    """For another subgoal it stays as it is: whether less is enough only ψ_R tells."""
    loop, last = node("at", AT, "b1", circular=True), node("last", HOLD, "b1")
    less = replace(loop, predicate=parse_predicate("‖b1↓xz − g(b1)↓xz‖ < 0.09"))
    rates = {("last", "at last"): 15, **root(15, "at last"), ("last", "less last"): 20, **root(20, "less last")}
    story, asked = Story({("at", "at"): 20, **rates}, {ROOT: [loop], "last": []}), []
    tree = Tree((*Tree().nodes, loop, last), ((TRUE, "at"), ("at", "last"), ("last", ROOT)))

    def generate(goal: str, tree: Tree) -> Program:
        return Program(f"{goal}:{'less' if less in tree.nodes else 'at'} last", Seq())

    def suggest(outcome: Outcome, tree: Tree) -> list[tuple[Node, Tree]]:
        asked.append(outcome)
        return [(less, tree.replacing(less))] if loop in tree.nodes else []

    steps = replace(story.steps(), generate=generate, looser=suggest)
    for goal, found in (("last", loop), (ROOT, less)):
        untrained = Solution(generate(goal, tree), tree, 0, Outcome(0, 1))
        assert Search(steps, Limits()).train(goal, untrained).tree.node("at") == found
    assert len(asked) == 2
