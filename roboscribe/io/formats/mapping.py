"""Which columns of a file hold which attributes of a task: a TOML file that a person can read and correct.

    task = "pick-place-1"
    frequency = 25

    [columns]
    "mu.position" = "observation.state[0:3]"
    "mu.opening" = { from = "gripper", scale = 0.001 }
    "b1.position" = ["x", "y", "z"]
    "b1.velocity" = { rate_of = "b1.position" }
    "g(b1).position" = { value = [1.3, 0.7, 0.45] }
    action = "action"

On the left stands what the task expects; `suggest` writes such a file. A mapping is checked as a whole: every problem
is found at once, each is one line.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TypeAlias

from roboscribe.io.columns import Column, columns_of
from roboscribe.io.formats.foreign import ACTION, SNAPSHOT, Contents, Field
from roboscribe.world import Task

_SETTINGS = ("task", "format", "frequency", "episode", "columns")
_KINDS = ("from", "value", "rate_of", "absent")
_FREQUENCY_TOLERANCE = 1e-3
_PICKS = re.compile(r"(?P<column>.+)\[(?P<picks>[0-9][0-9:, ]*)\]", re.DOTALL)
_LONGEST = 1 << 20
"""Characters that a mapping may have."""


@dataclass(frozen=True)
class Piece:
    """Some numbers of one column of the file, in the order in which they are wanted."""

    column: str
    picks: tuple[int, ...]


@dataclass(frozen=True)
class Given:
    """Values that stand in the file; those of several pieces side by side, multiplied by `scale`."""

    pieces: tuple[Piece, ...]
    scale: float = 1.0


@dataclass(frozen=True)
class Constant:
    """The same values in every frame."""

    values: tuple[float, ...]


@dataclass(frozen=True)
class RateOf:
    """The change per second of another column of the task."""

    column: str


@dataclass(frozen=True)
class Absent:
    """A goal that is not given, or actions or snapshots that are not there."""


Origin: TypeAlias = Given | Constant | RateOf | Absent


@dataclass(frozen=True)
class ColumnMapping:
    """A mapping that has been found good for a file and a task.

    Args:
        frequency: frames per second of the file.
        origins: where the values of each column of the task come from, action and snapshot included.
    """

    frequency: float
    origins: Mapping[str, Origin]

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the file that are needed."""
        given = (origin for origin in self.origins.values() if isinstance(origin, Given))
        return tuple(dict.fromkeys(piece.column for origin in given for piece in origin.pieces))


@dataclass(frozen=True)
class Draft:
    """A mapping as it was written, whatever it says.

    Args:
        settings: everything but the columns.
        columns: what is said of each column of the task.
    """

    settings: Mapping[str, object]
    columns: Mapping[str, object]

    def text(self, name: str) -> str | None:
        """Return a setting that is a text; None where it is not given or no text."""
        value = self.settings.get(name)
        return value if isinstance(value, str) else None


def parse_mapping(text: str, source: str) -> Draft | str:
    """Read TOML; a problem is one line of text.

    Args:
        text: content of the file.
        source: its name, for messages.
    """
    if len(text) > _LONGEST:
        return f"{source}: found {len(text)} characters, expected at most {_LONGEST}"
    try:
        whole = tomllib.loads(text)
    except (ValueError, RecursionError, OverflowError) as error:
        reason = (str(error).splitlines() or ["nested too deep"])[0]
        return f"{source}: not TOML ({reason})"
    columns = whole.get("columns", {})
    if not isinstance(columns, dict):
        return f"{source}: columns: found {columns!r:.60}, expected a table [columns]"
    return Draft({name: value for name, value in whole.items() if name != "columns"}, columns)


def check_mapping(draft: Draft, contents: Contents, task: Task, source: str) -> ColumnMapping | tuple[str, ...]:
    """Find out whether a mapping fits a file and a task.

    Returns:
        The mapping; or all of its problems, one line each.
    """
    frequency = draft.settings.get("frequency", contents.frequency)
    problems = [*_settings_problems(draft, task), *_frequency_problems(frequency, task)]
    wanted = {column.name: column.attribute.width for column in columns_of(task.layout)} | {ACTION: task.action_size}
    allowed = [*wanted, SNAPSHOT]
    unknown = (name for name in draft.columns if name not in allowed)
    problems += [f'"{name}": the task has no such column{_meant(name, allowed)}' for name in unknown]
    fields = {field.name: field for field in contents.fields}
    origins: dict[str, Origin] = {}
    for name in allowed:
        found = _origin(draft.columns.get(name), name, wanted.get(name), fields)
        if isinstance(found, str):
            problems.append(f'"{name}": {found}')
        else:
            origins[name] = found
    rates = ((name, origin) for name, origin in origins.items() if isinstance(origin, RateOf))
    problems += [
        f'"{name}": {problem}' for name, origin in rates for problem in _rate_problems(name, origin, origins, task)
    ]
    if problems:
        return tuple(f"{source}: {problem}" for problem in problems)
    return ColumnMapping(float(str(frequency)), origins)


def numbers_wanted(column: Column) -> str:
    """Say what a column of the task holds: "3 numbers in m (x, y, z)"."""
    attribute = column.attribute
    names = f" ({', '.join(attribute.components)})" if attribute.width > 1 else ""
    return f"{attribute.width} number{'s' * (attribute.width > 1)} in {attribute.unit}{names}"


def _settings_problems(draft: Draft, task: Task) -> Iterator[str]:
    """Complain about settings that nobody asked for, and a task that is another one."""
    for name, value in draft.settings.items():
        if name not in _SETTINGS:
            yield f"{name}: no such setting{_meant(name, _SETTINGS)}"
        elif name in ("task", "format", "episode") and not isinstance(value, str):
            yield f"{name}: found {value!r:.60}, expected a text"
    stated = draft.text("task")
    if stated not in (None, task.name):
        yield f"task: found {stated}, expected {task.name}"


def _frequency_problems(value: object, task: Task) -> Iterator[str]:
    """Complain about a frequency that is not the task's."""
    expected = f"{task.frequency:g} frames per second, as the task has"
    if value is None:
        yield f"frequency: the file does not say; write frequency = N, expected {expected}"
    elif isinstance(value, bool) or not isinstance(value, int | float):
        yield f"frequency: found {value!r:.60}, expected {expected}"
    elif not abs(value - task.frequency) <= _FREQUENCY_TOLERANCE * task.frequency:
        yield f"frequency: found {value:g}, expected {expected}"


def _origin(value: object, name: str, width: int | None, fields: Mapping[str, Field]) -> Origin | str:
    """Read what is said of one column of the task; a problem is a text."""
    optional = name in (ACTION, SNAPSHOT) or name.startswith("g(")
    expected = "as many numbers as there are" if width is None else f"{width} number{'s' * (width > 1)}"
    if value is None and name in (ACTION, SNAPSHOT):
        return Absent()
    if value is None or value == "":
        how = "; write { absent = true } where the file has none" if optional else ""
        return f"nothing is said of it, expected the columns with its {expected}{how}"
    table = value if isinstance(value, dict) else {"from": value}
    problem = _table_problem(table, optional=optional)
    if problem:
        return problem
    if name in (ACTION, SNAPSHOT) and not {"from", "absent"} & {*table}:
        return f"found {', '.join(table)}, expected columns of the file or {{ absent = true }}"
    if "absent" in table:
        return Absent()
    if "rate_of" in table:
        return RateOf(str(table["rate_of"]))
    if "value" in table:
        return _constant(table["value"], width, expected)
    return _given(table, width, expected, fields)


def _table_problem(table: Mapping[str, object], *, optional: bool) -> str | None:
    """Complain about the form of a table."""
    unknown = [key for key in table if key not in (*_KINDS, "scale")]
    kinds = [key for key in _KINDS if key in table]
    if unknown:
        return f"found {unknown[0]}, expected one of {', '.join(_KINDS)}, and scale"
    if len(kinds) != 1 or ("scale" in table and kinds != ["from"]):
        return f"found {', '.join(table) or 'nothing'}, expected one of {', '.join(_KINDS)}, and scale with from alone"
    if "absent" in table and not (optional and table["absent"] is True):
        return "absent: expected true, and only of goals, action and snapshot"
    if "rate_of" in table and not isinstance(table["rate_of"], str):
        return f"rate_of: found {table['rate_of']!r:.60}, expected the name of a column of the task"
    return None


def _constant(value: object, width: int | None, expected: str) -> Constant | str:
    """Read constant values."""
    values = value if isinstance(value, list) else [value]
    numbers = [float(v) for v in values if isinstance(v, int | float) and not isinstance(v, bool) and _finite(v)]
    if len(numbers) != len(values) or (width is not None and len(values) != width) or width is None:
        return f"value: found {value!r:.60}, expected {expected}"
    return Constant(tuple(numbers))


def _given(table: Mapping[str, object], width: int | None, expected: str, fields: Mapping[str, Field]) -> Given | str:
    """Read which columns of the file are meant."""
    scale, named = table.get("scale", 1.0), table["from"]
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not _finite(scale) or scale == 0:
        return f"scale: found {scale!r:.60}, expected a number other than 0"
    names = named if isinstance(named, list) else [named]
    pieces: list[Piece] = []
    for name in names:
        piece = _piece(name, fields) if isinstance(name, str) else f"found {name!r:.60}, expected the name of a column"
        if isinstance(piece, str):
            return piece
        pieces.append(piece)
    found = sum(len(piece.picks) for piece in pieces)
    if found == 0 or (width is not None and found != width):
        return f"found {found} number{'s' * (found != 1)} in {named!r:.80}, expected {expected}"
    return Given(tuple(pieces), float(scale))


def _piece(text: str, fields: Mapping[str, Field]) -> Piece | str:
    """Read "column", "column[2]", "column[0:3]" or "column[3,0,1,2]"; a name that has brackets itself comes first."""
    if text in fields:
        return Piece(text, tuple(range(fields[text].width)))
    match = _PICKS.fullmatch(text)
    name = match["column"] if match else text
    if name not in fields:
        return f"the file has no column {text!r:.80}{_meant(name, list(fields))}"
    picks = _picks(match["picks"] if match else "", fields[name].width)
    if picks is None:
        return f"{text!r:.80} picks numbers that are not there, {name} has {fields[name].width}"
    return Piece(name, picks)


def _picks(text: str, width: int) -> tuple[int, ...] | None:
    """Read "2", "0:3" or "3,0,1,2"; None where that is none of them or more than there is."""
    found: list[int] = []
    for part in text.split(","):
        ends = part.strip().split(":")
        if len(ends) > 2 or not all(end.strip().isdecimal() and len(end.strip()) < 9 for end in ends):
            return None
        start, stop = int(ends[0]), int(ends[-1]) + (len(ends) == 1)
        if not start < stop <= width:
            return None
        found += range(start, stop)
    return tuple(found)


def _rate_problems(name: str, rate: RateOf, origins: Mapping[str, Origin], task: Task) -> Iterator[str]:
    """Complain about a rate that cannot be worked out."""
    columns = {column.name: column for column in columns_of(task.layout)}
    column, of = columns.get(name), columns.get(rate.column)
    if of is None:
        yield f"rate_of: the task has no column {rate.column!r:.60}{_meant(rate.column, list(columns))}"
    elif column is None or not column.attribute.unit.endswith("/s"):
        yield "rate_of: expected values of the file, only velocities are rates"
    elif (of.attribute.unit + "/s", of.attribute.width) != (column.attribute.unit, column.attribute.width):
        yield f"rate_of: found {numbers_wanted(of)} in {of.name}, expected what gives {numbers_wanted(column)}"
    elif of.name in origins and not isinstance(origins[of.name], Given):
        yield f"rate_of: {of.name} does not come from the file itself"


def _meant(name: str, known: Sequence[str]) -> str:
    """Name what may have been meant, or what there is."""
    close = get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean {close[0]!r}?"
    listed = ", ".join(known[:12])
    return f"; there is {listed}{', …' * (len(known) > 12)}" if known else ""


def _finite(value: float) -> bool:
    """Whether a number fits into double precision."""
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False
