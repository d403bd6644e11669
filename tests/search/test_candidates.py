"""The figures that speak for a predicate, and the order of preference."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.syntax import Truth
from roboscribe.search.candidates import Anchor, Candidate, Judged, Samples, judge
from roboscribe.search.chance import enough_said, likely_chance
from roboscribe.subtask_tree import Node
from roboscribe.world.layout import BoolArray
from roboscribe.world.trajectory import NEVER, first_true, restored
from tests.search.examples import feature, random_states, samples
from tests.story import candidate

BASE = candidate(Node("", Truth()))


@pytest.mark.parametrize(
    "worse",
    [
        {"advances": False},
        {"accepted": 0.5},
        {"copy": True},
        {"relevant": False},
        {"comes_with_it": True},
        {"kept": 0.3},
        {"kept": 0.9},
        {"entities": 0},
        {"entities": 2},
        {"standing": 1},
        {"initial": 0.2},
        {"accepted": 0.05},
        {"first": 0.8},
        {"size": 9},
        {"bits": 2.0},
        {"margin": 0.01},
    ],
    ids=str,
)
def test_each_figure_alone_decides_between_equals(worse: dict[str, Any]) -> None:
    assert BASE.rank < replace(BASE, **worse).rank


def test_the_order_of_preference_is_lexicographic() -> None:
    late = replace(BASE, first=0.99, size=40, accepted=0.04)
    assert late.rank < replace(BASE, advances=False).rank
    assert late.rank < replace(BASE, standing=1).rank
    assert replace(BASE, standing=2, initial=0.2).rank < replace(BASE, kept=0.4).rank


def test_what_tells_failures_clearly_comes_before_what_is_about_the_goals_entities_and_does_not() -> None:
    elsewhere = replace(BASE, relevant=False)
    assert elsewhere.rank < replace(BASE, accepted=0.13).rank
    assert replace(BASE, accepted=0.04).rank < elsewhere.rank


def test_what_says_little_is_a_step_where_it_lies_far_from_all_that_failed() -> None:
    """A side of the table is passed by accident; a mug that was moved, where no failing episode moved it, was not."""
    side = replace(BASE, bits=1.6)
    other = replace(BASE, kept=0.6, initial=0.3)
    assert other.rank < side.rank
    assert replace(side, margin=1.5).rank < other.rank


def test_what_is_lost_again_is_as_late_as_it_is_long() -> None:
    """A hand is far enough at once, and away for a while later; that it has brought something there lasts."""
    passing, lasting = replace(BASE, first=0.07, kept=0.82), replace(BASE, first=0.2, kept=1.0)
    assert lasting.rank < passing.rank
    assert replace(passing, kept=0.95).rank < lasting.rank


def test_what_recurs_comes_before_what_is_done_once_however_late_it_is_complete() -> None:
    loop = replace(BASE, each=True, first=1.0, standing=2, initial=0.2)
    assert loop.rank < BASE.rank
    assert BASE.rank < replace(loop, with_others=True).rank, "the other entity may be what has to be moved"


def test_what_separates_explains_only_if_it_is_a_new_step_about_the_goals_entities() -> None:
    assert BASE.explains
    for change in ({"accepted": 0.21}, {"informative": False}, {"advances": False}, {"copy": True}):
        assert not replace(BASE, **change).possible
        assert not replace(BASE, **change).explains
    elsewhere = replace(BASE, relevant=False)
    assert elsewhere.possible, "another kind of object may have to be dealt with first"
    assert not elsewhere.explains


@pytest.mark.parametrize(
    ("bits", "crossings", "choices", "enough"),
    [
        (0.9, 1000, 2, False),  # it does not even halve what is possible
        (1.0, 4, 16, True),  # four bits name one of 16, and four crossings show four
        (1.0, 3, 16, False),
        (3.0, 2, 100, False),  # of 100 expressions one says six bits by accident
        (3.0, 3, 100, True),
    ],
)
def test_a_subgoal_has_to_say_more_than_it_takes_to_name_it(
    bits: float, crossings: int, choices: int, enough: bool
) -> None:
    assert enough_said(bits, crossings, choices) == enough


@pytest.mark.parametrize(
    ("accepted", "crossings", "atoms", "chance"),
    [
        (0, 1, 1, True),  # one failing state in a thousand might be anyone's
        (0, 2, 1, False),
        (100, 3, 1, True),  # of 200 expressions some hold at three crossings, if each holds in a tenth of the failures
        (100, 4, 1, False),
        (100, 5, 2, True),  # and there are many more pairs of expressions
    ],
)
def test_of_few_crossings_something_holds_by_chance(accepted: int, crossings: int, atoms: int, chance: bool) -> None:
    assert likely_chance(np.arange(998) < accepted, crossings, 100, atoms) == chance


def test_first_true_counts_from_each_episodes_start() -> None:
    truth = np.array([0, 1, 1, 0, 0, 0, 1], dtype=np.bool_)
    starts = np.array([0, 3, 6])
    assert first_true(truth, starts).tolist() == [1, NEVER, 0]


def test_what_is_undone_is_brought_about_where_it_holds_again() -> None:
    truth = np.array([1, 0, 1, 1, 1, 0, 0, 0, 1, 0, 1, 1, 1, 1, 0], dtype=np.bool_)
    starts = np.array([0, 4, 7, 12])
    assert first_true(truth, starts).tolist() == [0, 0, 1, 0]
    assert restored(truth, starts).tolist() == [2, 0, 1, 0], "only what holds both at first and in the end is restored"


def three_demonstrations(*others: tuple[int, int, int]) -> Samples:
    """Three demonstrations of four frames; each of `others` says when a subgoal that is there first holds in each."""
    states = random_states(np.random.default_rng(0), 12)
    steps = {frozenset(["b1"]): tuple(np.array(other) for other in others)}
    return samples(states[:3], states[:4], steps=steps, episodes=(states[:4], states[4:8], states[8:]))


def judged(on_frames: str, given: Samples) -> Candidate:
    """Judge a predicate about b1 by where it holds, 1 for yes; of four negatives it holds on one."""
    frames: BoolArray = np.array([mark == "1" for mark in on_frames.replace(" ", "")])
    negatives = np.array([1, 0, 0, 0], dtype=np.bool_)
    return judge(Judged(parse_predicate("b1↓p < 0.5"), (feature("b1↓p"),), negatives, frames, 0.2, (), 2.0), given)


def test_figures_of_three_demonstrations_by_hand() -> None:
    found = judged("0111 0010 1111", three_demonstrations())
    assert found.accepted == 0.25
    assert found.initial == pytest.approx(1 / 3)
    assert found.kept == pytest.approx((3 / 3 + 1 / 2 + 4 / 4) / 3)
    assert found.first == pytest.approx(1 / 3)
    assert found.relevant
    assert (found.standing, found.bits, found.each) == (0, 2.0, False)


@pytest.mark.parametrize(
    ("on_frames", "advances"),
    [
        ("0111 0010 1111", True),  # one that begins with it has no say
        ("0111 1111 1111", True),  # most begin with it, and have no say either
        ("1111 1111 1111", False),  # nobody brings it about
        ("0111 0010 0000", False),  # one never reaches it
    ],
)
def test_a_step_is_brought_about_in_every_demonstration_that_lacks_it(on_frames: str, advances: bool) -> None:
    assert judged(on_frames, three_demonstrations()).advances == advances


@pytest.mark.parametrize(
    ("other", "advances"),
    [
        ((0, 0, 0), True),  # always after
        ((3, 3, 3), True),  # always before
        ((0, 3, 3), False),  # now after, now before
        ((0, 2, 3), True),  # after, or in the same frame; the third begins with it and has no say
    ],
)
def test_a_step_lies_on_one_side_of_each_subgoal_that_is_there(other: tuple[int, int, int], advances: bool) -> None:
    assert judged("0111 0010 1111", three_demonstrations(other)).advances == advances


def test_only_the_goal_of_the_task_may_be_nothing_but_its_last_step() -> None:
    root = three_demonstrations()
    assert judged("0001 0001 0001", root).advances
    assert not judged("0001 0001 0001", replace(root, root=False)).advances
    assert judged("0011 0001 0011", replace(root, root=False)).advances


@pytest.mark.parametrize(
    ("moved", "done", "relevant"),
    [
        ("b1", (2, 3, 0), False),  # it is there as soon as the other branch is done, or before
        ("b1", (1, 1, 0), False),
        ("b1", (0, 0, 3), True),  # it comes after what the other branch brings about
        ("b2", (2, 3, 0), True),  # the other branch is about another entity
    ],
)
def test_what_another_branch_brings_about_is_no_step_on_this_one(
    moved: str, done: tuple[int, int, int], relevant: bool
) -> None:
    given = replace(three_demonstrations(), elsewhere=((frozenset([moved]), np.array(done)),))
    assert judged("0111 0010 1111", given).relevant == relevant


@pytest.mark.parametrize(("text", "standing"), [("b1↓p", 0), ("μ↓opening", 1)])
@pytest.mark.parametrize("added", [False, True])
def test_after_a_predecessor_the_world_stands_before_the_robot(text: str, standing: int, added: bool) -> None:
    states = random_states(np.random.default_rng(0), 12)
    held = Anchor(parse_predicate("b1↓q < 0.5"), {})
    given = samples(states[:3], states[:4], anchors=(held,), episodes=(states,))
    truth = np.ones(12, dtype=np.bool_)
    it = Judged(parse_predicate(f"{text} < 0.5"), (feature(text),), truth[:4], truth, 0.2, ())
    assert judge(replace(it, anchor=held if added else None), given).standing == standing
    assert judge(it, replace(given, anchors=())).standing == 0


@pytest.mark.parametrize(
    ("text", "standing"),
    [("¬∃b':block. b'↓p < 0.5", 2), ("∃b':block. b'↓p > 0.5", 3), ("b1↓p < 0.5", 0), ("μ↓opening < 0.5", 0)],
)
def test_who_leaves_goes_away_from_all_rather_than_from_some(text: str, standing: int) -> None:
    states = random_states(np.random.default_rng(0), 12)
    given = replace(samples(states[:3], states[:4], episodes=(states,)), afterwards=True)
    truth = np.ones(12, dtype=np.bool_)
    it = Judged(parse_predicate(text), (feature("b1↓p"),), truth[:4], truth, 0.2, ())
    if "μ" in text:
        it = replace(it, features=(feature("μ↓opening"),))
    found = judge(it, given)
    assert (found.standing, found.afterwards) == (standing, True)


def left(text: str, bits: float = 2.0) -> Candidate:
    """Judge what is said of the robot in the end, when all else is done."""
    states = random_states(np.random.default_rng(0), 12)
    given = replace(samples(states[:3], states[:4], episodes=(states,)), afterwards=True)
    it = Judged(
        parse_predicate(text), (feature("μ↓opening"),), np.zeros(4, np.bool_), np.ones(12, np.bool_), 0.2, (), bits
    )
    return judge(it, given)


def test_a_hand_leaves_things_and_not_the_places_where_they_belong() -> None:
    things, places = "¬∃b':block. b'↓p < 0.5", "¬∃b':block. b'↓p − g(b')↓p < 0.5"
    assert left(things).standing < left(places).standing


def test_who_leaves_need_not_say_much_for_almost_anywhere_will_do() -> None:
    states = random_states(np.random.default_rng(0), 30)
    given = replace(samples(states, states[:4], episodes=(states[:2],) * 30), afterwards=True)
    late = np.tile([False, True], 30)
    for text, informative in (("¬∃b':block. b'↓p < 0.5", True), ("b1↓p > 0.5", True), ("μ↓opening > 0.5", False)):
        it = Judged(parse_predicate(text), (feature("μ↓opening"),), np.zeros(400, np.bool_), late, 0.2, (), 0.9)
        assert judge(it, given).informative == informative


@pytest.mark.parametrize(
    ("text", "first", "root", "held", "comes_with_it"),
    [
        ("b1↓p", 11, False, False, True),
        ("b1↓p", 9, False, False, False),
        ("b1↓p", 11, True, False, False),  # the task may end with it
        ("μ↓opening", 11, False, False, False),  # a button is pressed as soon as the hand is there
        ("μ↓opening", 11, False, True, True),  # a block in the hand is at its goal as soon as the hand is
    ],
)
def test_what_begins_to_hold_with_a_subgoal_is_no_step_towards_it(
    text: str, first: int, root: bool, held: bool, comes_with_it: bool
) -> None:
    states = random_states(np.random.default_rng(0), 12)
    anchor = Anchor(parse_predicate("b1↓q < 0.5"), {})
    anchors = (anchor,) if held else ()
    given = replace(samples(states[:3], states[:4], episodes=(states,)), root=root, anchors=anchors)
    it = Judged(
        parse_predicate(f"{text} < 0.5"), (feature(text),), np.zeros(4, np.bool_), np.arange(12) >= first, 0.2, ()
    )
    assert judge(it, given).comes_with_it == comes_with_it
    assert not held or judge(replace(it, anchor=anchor), given).comes_with_it == comes_with_it


def test_a_side_of_the_table_leads_nowhere_unless_one_entity_after_the_other_is_brought_there() -> None:
    found = replace(judged("0111 0010 1111", three_demonstrations()), bits=1.5, accepted=0.0)
    assert not found.leads_on
    assert replace(found, each=True).leads_on
    assert replace(found, bits=2.0).leads_on
    assert not replace(found, bits=2.0, initial=0.6).leads_on, "most begin with it"


def test_only_those_who_bring_it_about_bear_it_out() -> None:
    states = random_states(np.random.default_rng(0), 40)
    given = samples(states, states[:4], episodes=(states[:2],) * 20)
    for late, never, informative in ((20, 0, True), (1, 0, False), (1, 1, False)):
        shown = [[False, True]] * late + [[False, False]] * never + [[True, True]] * (20 - late - never)
        frames = np.concatenate(shown)
        it = Judged(parse_predicate("b1↓p > 0.5"), (feature("b1↓p"),), np.zeros(400, np.bool_), frames, 0.2, (), 1.5)
        assert judge(it, given).informative == informative


def test_what_is_reached_with_the_goal_alone_by_those_who_lack_it_comes_with_it() -> None:
    states = random_states(np.random.default_rng(0), 60)
    given = replace(samples(states, states[:4], episodes=(states[:3],) * 20), root=False)
    frames = np.concatenate([[False, False, True]] * 9 + [[True, True, True]] * 11)
    it = Judged(parse_predicate("b1↓p > 0.5"), (feature("b1↓p"),), np.zeros(400, np.bool_), frames, 0.2, (), 6.0)
    found = judge(it, given)
    assert found.comes_with_it
    assert not found.advances
    assert found.first == 0.0
