"""Samples with a planted answer: scalar attributes of one block, of which some decide."""

from __future__ import annotations

import numpy as np

from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Predicate
from roboscribe.search.candidates import Anchor, Samples
from roboscribe.search.features import Feature, enumerate_features
from roboscribe.world.layout import Attribute, BoolArray, FloatArray, IntArray, Layout, ObjectType

GAUGES = ("p", "q", "r", "s")
"""Four numbers in [0, 1] that a block shows."""
LAYOUT = Layout(
    ObjectType("EE", (Attribute("opening", ("opening",), "1"),)),
    (ObjectType("block", tuple(Attribute(name, (name,), "1") for name in GAUGES)),),
)
FEATURES: tuple[Feature, ...] = enumerate_features(LAYOUT, ["b1"])


def feature(text: str) -> Feature:
    """Find a feature by the text of its expression."""
    return next(f for f in FEATURES if str(f.term) == text)


def random_states(rng: np.random.Generator, count: int) -> FloatArray:
    """Draw states (count, F) whose numbers are uniform in [0, 1]."""
    return rng.uniform(0.0, 1.0, (count, LAYOUT.size))


def planted(predicate: Predicate, rng: np.random.Generator, count: int = 2000) -> tuple[FloatArray, FloatArray]:
    """Draw states and part them by a predicate: where it holds, where it does not."""
    states = random_states(rng, count)
    truth = truth_of(predicate, states)
    return states[truth], states[~truth]


def truth_of(predicate: Predicate, states: FloatArray) -> BoolArray:
    """Decide a predicate about b1."""
    return holds(predicate, states, {}, LAYOUT)


def samples(
    positives: FloatArray,
    negatives: FloatArray,
    *,
    reached: FloatArray | None = None,
    lasts: FloatArray | None = None,
    steps: dict[frozenset[str], tuple[IntArray, ...]] | None = None,
    anchors: tuple[Anchor, ...] = (),
    episodes: tuple[FloatArray, ...] = (),
) -> Samples:
    """Build samples of one goal that is ψ_R; it is reached in `reached`, without them where `positives` show it, too;
    so for `lasts`, what is shown last.

    Without `episodes` every demonstration is ten failing states, then a positive one.
    """
    if not episodes:
        episodes = tuple(np.vstack([negatives[10 * i : 10 * i + 10], positives[i : i + 1]]) for i in range(20))
    starts = np.concatenate([[0], np.cumsum([len(e) for e in episodes])[:-1]]).astype(np.int64)
    reached = positives if reached is None else reached
    return Samples(
        LAYOUT,
        before=positives,
        reached=reached,
        lasts=reached if lasts is None else lasts,
        negatives=negatives,
        frames=np.concatenate(episodes),
        starts=starts,
        choices=len(FEATURES),
        steps=steps or {},
        anchors=anchors,
    )
