"""A first mapping for a file: what is sure by name is filled in, what is likely is marked, the rest is left open."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from roboscribe.io.atomic import canonical_json
from roboscribe.io.columns import Column, columns_of
from roboscribe.io.formats.foreign import ACTION, SNAPSHOT, Contents, Field, component_names
from roboscribe.io.formats.mapping import Draft, numbers_wanted
from roboscribe.world import Task

_WORDS = {
    "position": ("position", "pos", "xyz", "location"),
    "rotation": ("rotation", "rot", "euler", "rpy"),
    "orientation": ("orientation", "quat", "quaternion"),
    "velocity": ("velocity", "vel", "velp", "speed"),
    "opening": ("opening", "width", "aperture", "gripper", "finger", "fingers"),
}
"""Words by which files name attributes."""
_OTHERS = {word for words in _WORDS.values() for word in words}
"""Words that name some attribute: a goal that is called by none is one of position."""
_ROBOT_WORDS = ("eef", "ee", "robot", "robot0", "hand", "gripper", "tcp", "effector", "endeffector", "grip", "tool")
_GOAL_WORDS = ("goal", "target", "desired")
_ACTION_WORDS = ("action", "actions", "act")


@dataclass(frozen=True)
class Suggestion:
    """What a mapping may say.

    Args:
        sure: columns that the file names as the task does.
        likely: columns that its names only hint at.
        contents: what the file holds.
    """

    sure: Mapping[str, str | list[str]]
    likely: Mapping[str, str]
    contents: Contents

    def draft(self) -> Draft:
        """Return the mapping of what is sure."""
        return Draft({}, self.sure)


def suggest(contents: Contents, task: Task) -> Suggestion:
    """Find columns of a file that hold what a task expects."""
    sure: dict[str, str | list[str]] = {}
    for column in columns_of(task.layout):
        exact = _exact(column.name, component_names(column), contents.fields)
        if exact:
            sure[column.name] = exact
    actions = _exact(ACTION, [f"{ACTION}[{i}]" for i in range(task.action_size)], contents.fields)
    snapshots = _snapshots(contents.fields)
    sure |= {name: said for name, said in ((ACTION, actions), (SNAPSHOT, snapshots)) if said}
    taken = {_bare(text) for said in sure.values() for text in ([said] if isinstance(said, str) else said)}
    free = [field for field in contents.fields if field.name not in taken]
    likely = _likely([c for c in columns_of(task.layout) if c.name not in sure], free, task)
    return Suggestion(sure, likely, contents)


def spell_suggestion(suggestion: Suggestion, task: Task, kind: str, file: str, episode: str | None) -> str:
    """Spell a suggestion as TOML with comments.

    Args:
        suggestion: what to spell.
        task: the task.
        kind: the file's format.
        file: its name.
        episode: the setting of that name, where one was given.
    """
    frequency = suggestion.contents.frequency
    lines = [
        f"# Which columns of {_one_line(file)} hold what {task.name} expects.",
        '# On the right: "column", "column[2]", "column[0:3]", "column[3,0,1,2]", or a list of these;',
        '# { from = "column", scale = 0.001 } converts millimetres to metres; { value = [1.3, 0.7, 0.45] } is the same',
        '# in every frame; { rate_of = "b1.position" } works out a velocity; { absent = true }: there is no goal.',
        f"task = {_quoted(task.name)}",
        f"format = {_quoted(kind)}",
        *([f"frequency = {frequency:.12g}  # frames per second"] if frequency else []),
        *(
            []
            if frequency
            else [f"# frequency =   # frames per second; the file does not say, the task has {task.frequency:g}"]
        ),
        *([f"episode = {_quoted(episode)}"] if episode is not None else []),
        "",
        "[columns]",
    ]
    lines += [_line(column.name, numbers_wanted(column), suggestion) for column in columns_of(task.layout)]
    actions = f"{task.action_size} numbers from -1 to 1; remove the line where there are none"
    lines.append(_line(ACTION, actions, suggestion))
    if SNAPSHOT in suggestion.sure:
        lines.append(_line(SNAPSHOT, "simulator states", suggestion))
    lines += ["", "# Columns of the file:"]
    lines += [f"#   {_described(field)}" for field in suggestion.contents.fields]
    return "\n".join(lines) + "\n"


def _line(name: str, wanted: str, suggestion: Suggestion) -> str:
    """Spell one entry."""
    said = suggestion.sure.get(name, suggestion.likely.get(name, ""))
    values = f"[{', '.join(map(_quoted, said))}]" if isinstance(said, list) else _quoted(said)
    doubt = "guessed, please check; " if said else "please fill in; "
    doubt = "" if name in suggestion.sure else doubt
    return f"{_quoted(name)} = {values}  # {doubt}{wanted}"


def _exact(name: str, components: Sequence[str], fields: Sequence[Field]) -> str | list[str] | None:
    """Find what a file names as the task does: one column, numbers of one, or one column per number."""
    for field in fields:
        if field.name == name and field.width == len(components):
            return name
        if {*components} <= {*field.components}:
            picks = [field.components.index(component) for component in components]
            return f"{field.name}[{_spelled(picks)}]"
    names = {field.name for field in fields if field.width == 1}
    return list(components) if {*components} <= names else None


def _snapshots(fields: Sequence[Field]) -> str | list[str] | None:
    """Find simulator states, of which a task does not say how many numbers they have: one column, or one per number."""
    names = {field.name for field in fields}
    numbered = [name for name in names if name.startswith(f"{SNAPSHOT}[")]
    expected = [f"{SNAPSHOT}[{i}]" for i in range(len(numbered))]
    return SNAPSHOT if SNAPSHOT in names else expected if numbered and {*expected} == {*numbered} else None


def _spelled(picks: Sequence[int]) -> str:
    """Spell which numbers of a column are meant."""
    together = list(picks) == list(range(picks[0], picks[0] + len(picks)))
    if len(picks) == 1:
        return str(picks[0])
    return f"{picks[0]}:{picks[-1] + 1}" if together else ",".join(map(str, picks))


def _likely(wanted: Sequence[Column], fields: Sequence[Field], task: Task) -> dict[str, str]:
    """Guess by words; only what a single column fits is guessed."""
    found = {c.name: [f.name for f in fields if f.width == c.attribute.width and _hints(f, c, task)] for c in wanted}
    guesses = {name: names[0] for name, names in found.items() if len(names) == 1}
    actions = [f.name for f in fields if f.width == task.action_size and {*_words(f.name)} & {*_ACTION_WORDS}]
    if len(actions) == 1:
        guesses[ACTION] = actions[0]
    values = list(guesses.values())
    return {name: value for name, value in guesses.items() if values.count(value) == 1}


def _hints(field: Field, column: Column, task: Task) -> bool:
    """Whether the words of a column's name speak of this attribute of this object."""
    words = {*_words(field.name)}
    kind = _WORDS.get(column.attribute.name, (column.attribute.name,))
    named = words & {*kind} or (column.goal and not words & _OTHERS)
    if not named or bool(words & {*_GOAL_WORDS}) != column.goal:
        return False
    of_robot = bool(words & {*_ROBOT_WORDS})
    if not column.of_entity:
        return of_robot
    rank = task.layout.names.index(column.owner)
    names = {column.owner, task.layout.entities[rank].name, "object", "obj", "achieved"}
    alone = len(task.layout.entities) == 1
    return not of_robot and bool(words & ({column.owner} if not alone else names) or (alone and column.goal))


def _words(name: str) -> list[str]:
    """Split a name into its words."""
    return [word for word in re.split(r"[^a-z0-9]+", re.sub(r"([a-z])([A-Z])", r"\1_\2", name).lower()) if word]


def _bare(text: str) -> str:
    """Return the column's name without what is picked of it."""
    return re.sub(r"\[[0-9:,]+\]$", "", text)


def _described(field: Field) -> str:
    """Describe a column of the file in a comment."""
    names = f": {', '.join(field.components)}" if field.components else ""
    return _one_line(f"{field.name} ({field.width}){names}")


def _one_line(text: str) -> str:
    """Make a text fit for a comment."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _quoted(text: str) -> str:
    """Spell a TOML string; JSON's spelling is one."""
    return canonical_json(text).replace("\x7f", "\\u007f")
