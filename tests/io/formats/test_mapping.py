"""Mappings: what they may say, that every problem is one line, and that all of them come at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roboscribe.errors import DemonstrationError
from roboscribe.io import read_demonstrations
from roboscribe.io.formats.foreign import Contents, Field
from roboscribe.io.formats.mapping import ColumnMapping, Draft, check_mapping, parse_mapping
from roboscribe.io.formats.suggest import spell_suggestion, suggest
from roboscribe.io.formats.table import FORMATS
from roboscribe.io.formats.transfer import ingest, suggest_mapping
from tests.io.examples import B1, B2, G1, LAYOUT, TASK, carried

CONTENTS = Contents(
    (
        Field("state", 4, ("x", "y", "z", "width")),
        Field("boxes", 6),
        Field("quats", 8),
        Field("tilts", 2),
        Field("goal", 3),
        Field("action", 4),
    ),
    (12,),
    25.0,
)
GOOD = """
task = "carry-2"
[columns]
"mu.position" = "state[0:3]"
"mu.opening" = { from = "state[3]", scale = 0.001 }
"b1.position" = "boxes[0:3]"
"b1.orientation" = "quats[3,0,1,2]"
"b1.tilt" = "tilts[0]"
"g(b1).position" = "goal"
"b2.position" = ["boxes[3]", "boxes[4:6]"]
"b2.orientation" = "quats[4:8]"
"b2.tilt" = { value = 0 }
"g(b2).position" = { absent = true }
action = "action"
"""


def checked(text: str, contents: Contents = CONTENTS) -> ColumnMapping | tuple[str, ...]:
    """Read and check a mapping."""
    draft = parse_mapping(text, "map.toml")
    return (draft,) if isinstance(draft, str) else check_mapping(draft, contents, TASK, "map.toml")


def test_a_good_mapping_has_no_problems() -> None:
    mapping = checked(GOOD)
    assert isinstance(mapping, ColumnMapping)
    assert mapping.columns == ("state", "boxes", "quats", "tilts", "goal", "action")
    assert mapping.frequency == 25.0


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('task = "carry-2"', 'task = "stack-2"', "task: found stack-2, expected carry-2"),
        ('task = "carry-2"', "task = 3", "task: found 3, expected a text"),
        ('task = "carry-2"', "frequncy = 25", "frequncy: no such setting; did you mean 'frequency'?"),
        ('task = "carry-2"', "frequency = 50", "frequency: found 50, expected 25 frames per second, as the task has"),
        ('task = "carry-2"', "frequency = nan", "frequency: found nan, expected 25 frames per second, as the task has"),
        (
            '"mu.position" =',
            '"mu.positon" =',
            "\"mu.positon\": the task has no such column; did you mean 'mu.position'?",
        ),
        ('"state[0:3]"', '"stat[0:3]"', "the file has no column 'stat[0:3]'; did you mean 'state'?"),
        ('"state[0:3]"', '"state[0:2]"', "found 2 numbers in 'state[0:2]', expected 3 numbers"),
        ('"state[0:3]"', '"state[2:5]"', "'state[2:5]' picks numbers that are not there, state has 4"),
        ('"state[0:3]"', '"state[3:0]"', "'state[3:0]' picks numbers that are not there, state has 4"),
        ('"state[0:3]"', "7", "found 7, expected the name of a column"),
        ('"state[0:3]"', '""', '"mu.position": nothing is said of it, expected the columns with its 3 numbers'),
        ('"state[0:3]"', "{ absent = true }", "absent: expected true, and only of goals, action and snapshot"),
        ('"state[0:3]"', '{ rate_of = "b1.position" }', "rate_of: expected values of the file, only velocities are"),
        ('"state[0:3]"', "{ value = [1, 2] }", "value: found [1, 2], expected 3 numbers"),
        ('"state[0:3]"', "{ value = [1, 2, inf] }", "value: found [1, 2, inf], expected 3 numbers"),
        ("scale = 0.001", "scale = 0", "scale: found 0, expected a number other than 0"),
        ("scale = 0.001", "unit = 'mm'", "found unit, expected one of from, value, rate_of, absent, and scale"),
        (
            'action = "action"',
            "action = { value = [0, 0, 0, 0] }",
            '"action": found value, expected columns of the file',
        ),
    ],
)
def test_each_problem_is_one_line(old: str, new: str, problem: str) -> None:
    assert old in GOOD
    found = checked(GOOD.replace(old, new))
    assert isinstance(found, tuple)
    assert all("\n" not in line and line.startswith("map.toml: ") for line in found)
    assert any(problem in line for line in found), found


def test_all_problems_come_at_once() -> None:
    found = checked('task = "other"\n[columns]\n"b9.tilt" = "tilts"\n', Contents(CONTENTS.fields, (12,), None))
    assert isinstance(found, tuple)
    assert len(found) == 3 + 10


@pytest.mark.parametrize("text", ["[columns", "columns = 3", 'a = "\\q"', "x = [" * 5000, "\0"])
def test_what_is_no_mapping_is_one_line(text: str) -> None:
    found = parse_mapping(text, "map.toml")
    assert isinstance(found, str)
    assert found.startswith("map.toml: ")
    assert "\n" not in found


SCALARS = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=20), st.dates())
VALUES = st.recursive(
    SCALARS,
    lambda v: (
        st.lists(v, max_size=4)
        | st.dictionaries(
            st.sampled_from(["from", "value", "scale", "rate_of", "absent"]) | st.text(max_size=4), v, max_size=3
        )
    ),
    max_leaves=6,
)
NAMES = st.sampled_from(["mu.position", "b1.tilt", "g(b1).position", "action", "snapshot", "task", "frequency"])


@given(st.dictionaries(NAMES | st.text(max_size=8), VALUES), st.dictionaries(NAMES | st.text(max_size=8), VALUES))
@settings(max_examples=60, deadline=None)
def test_whatever_is_said_ends_in_lines_or_in_a_mapping(said: dict[str, object], other: dict[str, object]) -> None:
    found = check_mapping(Draft(other, said), CONTENTS, TASK, "map.toml")
    assert isinstance(found, ColumnMapping) or all(line.startswith("map.toml: ") for line in found)


@given(st.text(alphabet="[]{}=\"'.,:#\n \\absentcolumnsfrom0123456789", max_size=200))
@settings(max_examples=150, deadline=None)
def test_any_text_ends_in_one_line_or_in_a_draft(text: str) -> None:
    found = parse_mapping(text, "map.toml")
    assert isinstance(found, Draft) or "\n" not in found


@given(st.text(alphabet="state[]0123456789:, -", min_size=1, max_size=16))
def test_what_is_picked_is_there(text: str) -> None:
    found = checked(GOOD.replace("state[3]", text.replace('"', "")))
    if isinstance(found, ColumnMapping):
        assert len(found.origins["mu.opening"].pieces) == 1  # type: ignore[union-attr]  # it says `from`


def test_a_suggestion_is_read_back_as_it_was_meant() -> None:
    fields = (Field("mu.position", 3), Field('od"d\n', 2, ("a\u2028", "b")), Field("action", 4))
    contents = Contents(fields, (12,), None)
    draft = parse_mapping(spell_suggestion(suggest(contents, TASK), TASK, "csv", "a\nb.csv", ""), "map.toml")
    assert isinstance(draft, Draft)
    assert draft.columns["mu.position"] == "mu.position"
    assert draft.columns["action"] == "action"
    assert draft.columns["b1.tilt"] == ""
    assert draft.settings == {"task": "carry-2", "format": "csv", "episode": ""}


def archive(path: Path, **arrays: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Path:
    """Write an archive as a user would have it: names, units and order of their own."""
    np.savez(path, **arrays)
    return path


def test_units_order_constants_and_rates_are_worked_out(tmp_path: Path) -> None:
    shown = carried(3)
    states = shown.states
    quats = np.concatenate([states[:, LAYOUT.columns[i, "orientation", False]] for i in (0, 1)], axis=1)
    file = archive(
        tmp_path / "own.npz",
        state=np.concatenate([states[:, :3], 1000 * states[:, 3:4] + 40], axis=1),
        boxes=np.concatenate([states[:, B1], states[:, B2]], axis=1),
        quats=np.concatenate([np.roll(quats[:, :4], -1, axis=1), quats[:, 4:]], axis=1),
        tilts=np.zeros((12, 2)), goal=states[:, G1], action=np.zeros((12, 4)),
    )  # fmt: skip
    mapping = tmp_path / "map.toml"
    mapping.write_text("frequency = 25\n" + GOOD)
    ingest(file, TASK, FORMATS["npz"], mapping, tmp_path / "out")
    (found,) = read_demonstrations(tmp_path / "out", TASK).trajectories
    for name in ("position", "orientation", "tilt"):
        for box in (0, 1):
            place = LAYOUT.columns[box, name, False]
            np.testing.assert_array_equal(found.states[:, place], states[:, place])
    np.testing.assert_allclose(found.states[:, 3], 0.04)
    assert np.isnan(found.states[:, LAYOUT.columns[1, "position", True]]).all()
    assert found.actions is not None
    assert found.actions.shape == (11, 4)


def test_stacked_episodes_are_told_from_shapes(tmp_path: Path) -> None:
    both = [carried(0), carried(1)]
    arrays = {c: np.stack([t.states[:, place] for t in both]) for c, place in (("boxes", slice(4, 7)), ("goal", G1))}
    file = archive(tmp_path / "own.npz", **arrays, action=np.stack([t.actions for t in both if t.actions is not None]))
    text = suggest_mapping(file, TASK, FORMATS["npz"])
    assert "#   boxes (3)\n#   goal (3)\n#   action (4)\n" in text


def test_a_mapping_that_is_not_there_is_named(tmp_path: Path) -> None:
    file = archive(tmp_path / "own.npz", goal=np.zeros((3, 3)))
    with pytest.raises(DemonstrationError, match=r"nowhere.toml: cannot be read"):
        ingest(file, TASK, FORMATS["npz"], tmp_path / "nowhere.toml", tmp_path / "out")


def test_without_a_mapping_names_must_be_the_tasks(tmp_path: Path) -> None:
    file = archive(tmp_path / "own.npz", goal=np.zeros((3, 3)))
    with pytest.raises(DemonstrationError, match="write a mapping with: roboscribe ingest") as caught:
        ingest(file, TASK, FORMATS["npz"], None, tmp_path / "out")
    assert len(str(caught.value).splitlines()) == 1 + 10 + 1
