"""Where a branch is left that comes last in some demonstrations and not in others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roboscribe.branch_threshold import left_behind
from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.syntax import Const, Greater, Less
from roboscribe.envs.point_world import PointTask
from roboscribe.evidence import Crossings, Passage
from roboscribe.subtask_tree import Node
from roboscribe.world.layout import FloatArray
from tests.handmade import AT, HOLD, evidence, node, state

BOTH = PointTask("toy", ("peg", "cube"))
SHOWN = evidence(BOTH)
PEG = node("at", AT, "p1")
STEPS = 20
"""Frames of a crossing."""
PLACED = 0.008
"""How far from its goal, at most, a peg lies that was let go, m."""


def crossings(last: int, earlier: int) -> Crossings:
    """Show so many times how the peg comes last, and how it is placed half-way through."""
    rng = np.random.default_rng(0)
    arriving = [np.append(np.ones(STEPS - 1), 0.049)] * last
    placed = [np.repeat([1.0, rng.uniform(0.0, PLACED)], STEPS // 2) for _ in range(earlier)]
    distances = np.concatenate([*arriving, *placed])
    starts = np.arange(last + earlier) * STEPS
    same = tuple(range(len(BOTH.layout.entities)))
    return Crossings(np.stack([peg(d) for d in distances]), starts, (Passage(0, 0, STEPS, same),) * len(starts))


def peg(distance: float) -> FloatArray:
    """Return a state with the peg so far from its goal."""
    places = np.array([[distance, 0.0], [0.5, 0.5]])
    return state(BOTH.layout, np.array([0.9, 0.9]), places, np.zeros((2, 2)))


def threshold(found: Node) -> float:
    """Return the number that a node's predicate compares with."""
    assert isinstance(found.predicate, Less | Greater)
    assert isinstance(found.predicate.right, Const)
    return found.predicate.right.value


def test_what_others_follow_is_left_as_exactly_as_it_was_shown() -> None:
    sharper = left_behind(PEG, crossings(last=20, earlier=20), SHOWN)
    assert PLACED / 2 < threshold(sharper) < 2 * PLACED
    assert sharper == replace(PEG, predicate=sharper.predicate), "all else stays"


def test_a_bound_from_below_is_drawn_in_from_below() -> None:
    far = Node("far", parse_predicate("g(p1)↓x − p1↓x > -0.05"))
    sharper = left_behind(far, crossings(last=20, earlier=20), SHOWN)
    assert -2 * PLACED < threshold(sharper) < -PLACED / 2


@pytest.mark.parametrize(("last", "earlier"), [(40, 0), (0, 40)], ids=["always last", "never last"])
def test_what_comes_in_one_order_stays_as_it_was_learned(last: int, earlier: int) -> None:
    assert left_behind(PEG, crossings(last, earlier), SHOWN) == PEG


@pytest.mark.parametrize("other", [replace(PEG, circular=True), node("hold", HOLD, "p1")], ids=["loop", "robot"])
def test_loops_and_what_is_about_the_robot_stay_as_they_were_learned(other: Node) -> None:
    assert left_behind(other, crossings(last=20, earlier=20), SHOWN) == other


def test_what_is_never_shown_stays_as_it_was_learned() -> None:
    assert left_behind(PEG, Crossings(np.empty((0, BOTH.layout.size)), np.empty(0, np.int64), ()), SHOWN) == PEG
