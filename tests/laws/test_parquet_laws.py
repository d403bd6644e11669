"""Whatever can be written to Parquet is read back bit for bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from roboscribe.io import read_demonstrations, write_demonstrations
from roboscribe.io.columns import columns_of
from roboscribe.world import Attribute, Layout, ObjectType, Trajectory
from roboscribe.world.layout import FloatArray
from tests.io.examples import TASK, same

UNITS = st.sampled_from(["m", "rad", "m/s", "rad/s", "1"])
FINITE = st.floats(allow_nan=False, allow_infinity=False)
UNIT_INTERVAL = st.floats(-1.0, 1.0)


@st.composite
def attributes(draw: st.DrawFn) -> tuple[Attribute, ...]:
    """Draw up to three attributes of one to four numbers."""
    widths = draw(st.lists(st.integers(1, 4), min_size=1, max_size=3))
    names = (f"a{i}" for i in range(len(widths)))
    return tuple(
        Attribute(name, (name,) if width == 1 else tuple("wxyz"[:width]), draw(UNITS))
        for name, width in zip(names, widths, strict=True)
    )


@st.composite
def layouts(draw: st.DrawFn) -> Layout:
    """Draw a robot and up to three entities of up to two types, whose names may share a letter."""
    kinds = [
        ObjectType(n, draw(attributes()), draw(st.just(()) | attributes()))
        for n in ("box", draw(st.sampled_from(["bin", "dør"])))
    ]
    return Layout(ObjectType("robot", draw(attributes())), tuple(draw(st.lists(st.sampled_from(kinds), max_size=3))))


def table(draw: st.DrawFn, shape: tuple[int, int], elements: st.SearchStrategy[float]) -> FloatArray:
    """Draw an array of any floats that `elements` allows: huge, tiny, −0."""
    return draw(arrays(np.float64, shape, elements=elements))


@st.composite
def trajectories(draw: st.DrawFn, layout: Layout, actions: int) -> Trajectory:
    """Draw an episode with or without actions, snapshots of any bits, and goals that are given or not."""
    length = draw(st.integers(0, 5))
    states = table(draw, (length, layout.size), FINITE)
    for column in columns_of(layout):
        if column.goal and draw(st.booleans()):
            states[:, column.place] = np.nan
    moves = table(draw, (length - 1, actions), UNIT_INTERVAL) if length > 1 and draw(st.booleans()) else None
    bits = draw(arrays(np.uint64, (length, 3))).view(np.float64) if length and draw(st.booleans()) else None
    return Trajectory(layout, states, moves, bits)


@settings(max_examples=60, deadline=None)
@given(st.data(), layouts(), st.integers(1, 3), st.floats(0.1, 1000.0))
def test_written_demonstrations_are_read_bit_for_bit(
    data: st.DataObject, layout: Layout, actions: int, frequency: float
) -> None:
    episodes = data.draw(st.lists(trajectories(layout, actions), max_size=4))
    task = replace(TASK, name="any task, even φ", layout=layout, frequency=frequency, action_size=actions)
    with TemporaryDirectory() as directory:
        path = Path(directory) / "demos.parquet"
        digest = write_demonstrations(path, task.name, layout, frequency, episodes, generator="φ", seed=None)
        found = read_demonstrations(path, task)
    assert same(found.trajectories, episodes)
    assert found.digest == digest
