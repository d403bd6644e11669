"""Demonstrations out of arrays are those of a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.errors import DemonstrationError
from roboscribe.io import Demonstrations
from roboscribe.world.states import column_places

TASK = POINT_TASKS["point-pick-place-1"]
SHOWN = TASK.demonstrate(3, 0)
STATES, ACTIONS = [t.states for t in SHOWN], [t.actions for t in SHOWN if t.actions is not None]


def test_arrays_survive_a_file(tmp_path: Path) -> None:
    given = Demonstrations.from_arrays(TASK, STATES, ACTIONS)
    given.to_parquet(tmp_path / "d.parquet", TASK)
    read = Demonstrations.from_parquet(tmp_path / "d.parquet", TASK)
    assert len(read) == 3
    for mine, theirs in zip(given.trajectories, read.trajectories, strict=True):
        np.testing.assert_array_equal(mine.states, theirs.states)
        assert mine.actions is not None
        assert theirs.actions is not None
        np.testing.assert_array_equal(mine.actions, theirs.actions)


def test_columns_by_name_are_the_same_states() -> None:
    named = [{name: shown[:, place] for name, place in column_places(TASK.layout).items()} for shown in STATES]
    assert (
        Demonstrations.from_arrays(TASK, named, ACTIONS).digest
        == Demonstrations.from_arrays(TASK, STATES, ACTIONS).digest
    )


def test_the_digest_tells_demonstrations_apart() -> None:
    digests = {Demonstrations.from_arrays(TASK, STATES[:n], ACTIONS[:n]).digest for n in (1, 2, 3)}
    assert len(digests | {Demonstrations.from_arrays(TASK, STATES).digest}) == 4


@pytest.mark.parametrize(
    ("states", "actions", "said"),
    [
        (STATES, ACTIONS[:2], "found actions of 2 episodes, expected 3"),
        ([STATES[0][:, :-1]], None, "episode 0"),
        ([{"mu.position": STATES[0][:, :2]}], None, r"episode 0: missing column mu\.opening, b1\.position"),
        ([np.full_like(STATES[0], np.nan)], None, "episode 0"),
        ([STATES[0]], [2.0 * np.sign(ACTIONS[0]) + 2.0], "episode 0"),
    ],
)
def test_what_cannot_be_right_is_refused(states: list, actions: list | None, said: str) -> None:  # type: ignore[type-arg]  # any arrays
    with pytest.raises(DemonstrationError, match=said):
        Demonstrations.from_arrays(TASK, states, actions)
