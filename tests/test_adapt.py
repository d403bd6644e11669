"""Learning only the guards of a program again, from demonstrations of another order."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from roboscribe.adapt import Adapted, adapt
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import pretty
from roboscribe.dsl.rewrite import controllers, rename
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Predicate, Program
from roboscribe.envs.point_world import AT, POINT_TASKS, PointTask
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.world.layout import ROBOT, FloatArray

TOWER = POINT_TASKS["point-tower-3"]
PLACE = parse_program(f"""
def Place(μ : EE):
  while (b := get(λb:block. ¬at(b))) ≠ null:
    π_hold(μ, b) until hold(μ, b)
    π_at(μ, b, g(b)) until at(b)
where
  hold(μ, b) ≡ ‖μ↓xz − b↓xz‖ < 0.02
  at(b) ≡ ‖b↓xz − g(b)↓xz‖ < {AT}
""")


def evidence(task: PointTask, count: int, seed: int = 0) -> Evidence:
    return Evidence.of(task.demonstrate(count, seed), task.solved)


def adapted(program: Program, shown: Evidence) -> Adapted:
    found = adapt(program, shown)
    assert isinstance(found, Adapted), found
    return found


def state(heights: tuple[float, ...], done: tuple[bool, ...]) -> FloatArray:
    """Build a tower task whose goals have some heights, some of its blocks where they belong."""
    layout, found = TOWER.layout, np.zeros(TOWER.layout.size)
    found[layout.columns[ROBOT, "opening", False]] = 1.0
    for index, (height, placed) in enumerate(zip(heights, done, strict=True)):
        goal = np.array([1.3, height])
        found[layout.columns[index, "position", True]] = goal
        found[layout.columns[index, "position", False]] = goal if placed else (0.2 * index, 0.5)
    return found


def chosen(guard: Predicate, where: FloatArray) -> set[int]:
    members = range(len(TOWER.layout.entities))
    return {i for i in members if holds(guard, where, {"b": i}, TOWER.layout)}


@pytest.mark.parametrize("count", [5, 10, 30])
def test_the_guard_takes_the_lowest_goal_first_in_every_small_state(count: int) -> None:
    ((old, new),) = adapted(PLACE, evidence(TOWER, count)).guards
    assert str(old.where) == f"¬(‖b↓xz − g(b)↓xz‖ < {AT})"
    for heights in permutations((0.05, 0.2, 0.35)):
        ranks = np.argsort(heights)
        for placed in range(len(ranks) + 1):
            done = tuple(i in ranks[:placed].tolist() for i in range(len(ranks)))
            wanted = {int(ranks[placed])} if placed < len(ranks) else set()
            assert chosen(new.where, state(heights, done)) == wanted


def test_only_the_guard_changes() -> None:
    found = adapted(PLACE, evidence(TOWER, 10)).program
    before, after = pretty(PLACE).splitlines(), pretty(found).splitlines()
    assert [a for a, b in zip(before, after, strict=True) if a != b] == [before[1]]


def test_what_is_undone_in_passing_is_no_example() -> None:
    pushed = POINT_TASKS["point-place-3"]
    shown = evidence(pushed, 10)
    layout = pushed.layout
    place = layout.columns[layout.names.index("b1"), "position", False]
    trajectory = shown.trajectories[0]
    first = int(shown.each_first_steps(parse_at(), "b1")[0, 0])
    disturbed = trajectory.states.copy()
    disturbed[first + 3 : -1, place] += 0.2
    changed = Evidence.of([type(trajectory)(layout, disturbed), *shown.trajectories[1:]], pushed.solved)
    ((_, new),) = adapted(PLACE, changed).guards
    assert str(new.where) == f"¬(‖b↓xz − g(b)↓xz‖ < {AT})"


def parse_at() -> Predicate:
    """At, about b1."""
    return rename(controllers(PLACE)[-1].until, {"b": "b1"})


def test_demonstrations_of_other_objects_are_refused() -> None:
    found = adapt(PLACE, evidence(POINT_TASKS["point-peg-cube"], 3))
    assert found == Fail("the loop over b:block has no object of this type in the demonstrations")


def test_a_program_without_a_loop_has_no_guard() -> None:
    straight = parse_program(
        "def P(μ : EE):\n  b := get(λb:block. true)\n  π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.1\n"
    )
    found = adapt(straight, evidence(TOWER, 3))
    assert isinstance(found, Fail)
    assert "no loop over entities" in found.reason
