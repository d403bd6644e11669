"""What is brought about for one entity after the other, read off demonstrations drawn with a ruler."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.rewrite import walk
from roboscribe.dsl.syntax import Const, Less, Truth
from roboscribe.search.candidates import Candidate
from roboscribe.search.features import enumerate_features
from roboscribe.search.loop_entities import Pairs
from roboscribe.search.recurring import recurring_candidates
from roboscribe.world.layout import FloatArray, IntArray, Layout
from tests.search.examples import LAYOUT as ONE

TWO = Layout(ONE.robot, ONE.entities * 2)
P = (1, 5)
"""Columns of the number p of b1 and b2."""
OPENING = 0
LENGTH, DEMONSTRATIONS = 40, 30


def demonstrations(ends: FloatArray, begins: IntArray) -> FloatArray:
    """Draw demonstrations (D, T, F) in which each block's p falls from 1 to `ends` (D, 2), 20 frames from `begins` on.

    Everything else is noise that has to do with nothing.
    """
    states = np.random.default_rng(3).uniform(0.0, 1.0, (len(ends), LENGTH, TWO.size))
    share = np.clip((np.arange(LENGTH)[:, None] - begins[:, None, :] + 1) / 20, 0.0, 1.0)
    states[..., P] = 1.0 + share * (ends[:, None, :] - 1.0)
    return states


def candidates(states: FloatArray, known: dict[str, int] | None = None) -> dict[str, Candidate]:
    """Find what recurs, by the text of its left side; in failures every p is high."""
    negatives = np.random.default_rng(4).uniform(0.0, 1.0, (500, TWO.size))
    negatives[:, P] = np.random.default_rng(5).uniform(0.5, 1.0, (500, 2))
    starts = np.arange(len(states)) * LENGTH
    pairs = Pairs(TWO, "b1", (0, 1), states.reshape(-1, TWO.size), starts, negatives, {Truth(): known or {}})
    found = recurring_candidates(enumerate_features(TWO, ["b1"]), pairs)
    return {str(c.predicate.left): c for c in found if isinstance(c.predicate, Less)}


def threshold(candidate: Candidate) -> float:
    """Return the number that a candidate compares with."""
    (const,) = [n.value for n in walk(candidate.predicate) if isinstance(n, Const)]
    return const


ONE_BY_ONE = np.tile([0, 20], (DEMONSTRATIONS, 1))
CLOSE = np.random.default_rng(0).uniform(0.0, 0.02, (DEMONSTRATIONS, 2))


def test_what_each_block_is_brought_to_is_found_from_both() -> None:
    (found,) = [c for text, c in candidates(demonstrations(CLOSE, ONE_BY_ONE)).items() if text == "b1↓p"]
    assert found.each
    assert (found.advances, found.relevant, found.copy, found.possible) == (True, True, False, True)
    assert (found.accepted, found.initial, found.kept) == (0.0, 0.0, 1.0)
    assert CLOSE.max() < threshold(found) < 0.05


def test_a_last_block_that_is_still_on_its_way_does_not_loosen_the_threshold() -> None:
    """A demonstration may stop at once when the task is solved; what counts is where the others were left behind."""
    ends = CLOSE.copy()
    ends[:, 1] = 0.3
    found = candidates(demonstrations(ends, ONE_BY_ONE))["b1↓p"]
    assert CLOSE[:, 0].max() < threshold(found) < 0.05


def test_of_few_that_were_left_behind_the_one_that_lies_furthest_off_counts_as_well() -> None:
    ends = CLOSE[:5]
    found = candidates(demonstrations(ends, ONE_BY_ONE[:5] // 2))["b1↓p"]
    assert ends.max() < threshold(found) < 0.05


def test_a_threshold_lies_between_the_end_of_long_strides_and_the_frame_before() -> None:
    """Those who go fast show nothing of what lies between; a block that still rocks a little does not tighten it."""
    states = demonstrations(CLOSE / 20, np.tile([-15, 5], (DEMONSTRATIONS, 1)))
    states[..., P] = np.where(states[..., P] < 0.2, CLOSE[:, None] / 20, states[..., P])
    states[:2, -2, P[1]] = CLOSE.max() / 20 + 0.0002
    found = candidates(states)["b1↓p"]
    assert 0.08 < threshold(found) < 0.2


def test_it_does_not_matter_which_block_is_served_first() -> None:
    swapped = ONE_BY_ONE.copy()
    swapped[::2] = swapped[::2, ::-1]
    there, here = (candidates(demonstrations(CLOSE, order))["b1↓p"] for order in (swapped, ONE_BY_ONE))
    assert there.predicate == here.predicate


def test_a_block_that_needs_nothing_is_no_evidence_against_a_loop() -> None:
    states = demonstrations(CLOSE, ONE_BY_ONE)
    states[: DEMONSTRATIONS // 3, :, P[0]] = 0.01
    found = candidates(states)["b1↓p"]
    assert found.each
    assert found.initial == 0.0, "in no demonstration do both begin with it"
    assert CLOSE.max() < threshold(found) < 0.05


@pytest.mark.parametrize("reach", [0.06, 0.1, 0.3])
def test_a_block_that_needs_nothing_bounds_the_threshold_and_says_nothing_else(reach: float) -> None:
    """It lies further off than those that are served are left: what is good enough for it is good enough for them."""
    states = demonstrations(CLOSE, ONE_BY_ONE)
    exact = candidates(states)["b1↓p"]
    spared = np.linspace(0.0, reach, DEMONSTRATIONS // 3)
    states[: len(spared), :, P[1]] = spared[:, None]
    found = candidates(states)["b1↓p"]
    assert reach < threshold(found) < 0.5
    assert found.bits > exact.bits - 1.0
    assert found.possible


def test_what_all_blocks_come_to_satisfy_at_once_is_no_loop() -> None:
    together = np.full((DEMONSTRATIONS, 2), 10)
    assert "b1↓p" not in candidates(demonstrations(CLOSE, together))


def test_what_moves_all_blocks_alike_is_no_loop_though_one_arrives_first() -> None:
    """They ride on something, the first one in front."""
    ends, together = CLOSE - [0.5, 0.2], np.full((DEMONSTRATIONS, 2), 10)
    assert "b1↓p" not in candidates(demonstrations(ends, together))
    assert "b1↓p" in candidates(demonstrations(ends, ONE_BY_ONE))


def test_what_most_demonstrations_begin_with_is_not_brought_about() -> None:
    states = demonstrations(CLOSE, ONE_BY_ONE)
    states[: DEMONSTRATIONS * 2 // 3, :, P] = 0.01
    assert "b1↓p" not in candidates(states)


def test_what_only_one_block_is_brought_to_is_no_loop_of_three() -> None:
    three = Layout(ONE.robot, ONE.entities * 3)
    states = np.random.default_rng(3).uniform(0.5, 1.0, (DEMONSTRATIONS, LENGTH, three.size))
    states[:, 20:, P[0]] = 0.01
    flat, starts = states.reshape(-1, three.size), np.arange(DEMONSTRATIONS) * LENGTH
    negatives = np.random.default_rng(4).uniform(0.5, 1.0, (500, three.size))
    pairs = Pairs(three, "b1", (0, 1, 2), flat, starts, negatives, {Truth(): {}})
    found = recurring_candidates(enumerate_features(three, ["b1"]), pairs)
    assert not [c for c in found if threshold(c) < 0.5]


@pytest.mark.parametrize("text", ["μ↓opening", "μ"])
def test_what_is_about_the_robot_lasts_for_no_loop(text: str) -> None:
    states = demonstrations(CLOSE, ONE_BY_ONE)
    states[..., OPENING] = 0.01
    assert not [found for found in candidates(states) if text in found]


def test_what_the_tree_compares_already_is_a_copy() -> None:
    assert candidates(demonstrations(CLOSE, ONE_BY_ONE), {"b1.p": 1})["b1↓p"].copy
