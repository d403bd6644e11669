"""Columns and metadata of a demonstration file, and whether a file has those that a task expects.

Lists are stored with variable length although their width is fixed: Arrow cannot read back a null in a fixed-size list
from Parquet, and goals and actions may be null.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isclose
from typing import NoReturn

import pyarrow as pa

from roboscribe.errors import DemonstrationError
from roboscribe.io.atomic import Json, canonical_json, package_versions, parse_json
from roboscribe.io.columns import columns_of
from roboscribe.world import Layout, ObjectType, Task

VERSION = "1"
EPISODE = pa.field("episode_index", pa.int64())
FRAME = pa.field("frame_index", pa.int64())
TIMESTAMP = pa.field("timestamp", pa.float64(), metadata={"unit": "s"})
ACTION = pa.field("action", pa.list_(pa.float64()), metadata={"unit": "1"})
SNAPSHOT = pa.field("snapshot", pa.large_list(pa.float64()))
_PREFIX = "roboscribe."


def schema_of(layout: Layout, metadata: Mapping[str, str], *, snapshots: bool) -> pa.Schema:
    """Return a file's schema: index, timestamp, attributes, action and, where stored, snapshot."""
    fields = [EPISODE, FRAME, TIMESTAMP]
    for column in columns_of(layout):
        kind = pa.float64() if column.attribute.width == 1 else pa.list_(pa.float64())
        components = " ".join(column.attribute.components)
        fields.append(pa.field(column.name, kind, metadata={"unit": column.attribute.unit, "components": components}))
    tail = (ACTION, SNAPSHOT) if snapshots else (ACTION,)
    return pa.schema([*fields, *tail], metadata={_PREFIX + key: value for key, value in metadata.items()})


def describe(
    task_name: str,
    layout: Layout,
    frequency: float,
    *,
    generator: str,
    seed: int | None,
    lengths: list[int],
    snapshots: bool,
) -> dict[str, str]:
    """Return the key-value metadata of a file, keys without their prefix.

    Args:
        task_name: name of the task shown.
        layout: objects and attributes.
        frequency: frames per second.
        generator: what made the demonstrations.
        seed: the generator's seed; None where it has none.
        lengths: count of frames by episode.
        snapshots: whether there is a column of snapshots.
    """
    values: dict[str, Json] = {
        "objects": _objects(layout), "packages": package_versions(("numpy", "pyarrow", "mujoco")),
        "seed": seed, "lengths": lengths, "snapshots": snapshots,
    }  # fmt: skip
    texts = {"schema_version": VERSION, "task": task_name, "frequency": repr(float(frequency)), "generator": generator}
    return texts | {key: canonical_json(value) for key, value in values.items()}


def metadata_of(raw: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Return a file's key-value metadata as text, keys without their prefix; other programs' keys are left out."""
    decoded = {key.decode(errors="replace"): value.decode(errors="replace") for key, value in (raw or {}).items()}
    return {key.removeprefix(_PREFIX): value for key, value in decoded.items() if key.startswith(_PREFIX)}


def lengths_of(metadata: Mapping[str, str]) -> list[int]:
    """Return the count of frames by episode that a file states; empty when it states none."""
    try:
        value = parse_json(metadata.get("lengths", "[]"))
    except ValueError:
        return []
    return [n for n in value if isinstance(n, int)] if isinstance(value, list) else []


def metadata_for(task: Task, *, snapshots: bool = False) -> dict[str, str]:
    """Return the key-value metadata that a file of demonstrations of a task must have, whoever writes it.

    Args:
        task: what the demonstrations show.
        snapshots: whether there is a column of simulator states.
    """
    texts = {"schema_version": VERSION, "task": task.name, "frequency": repr(float(task.frequency))}
    texts |= {"objects": canonical_json(_objects(task.layout))} | ({"snapshots": "true"} if snapshots else {})
    return {_PREFIX + key: text for key, text in texts.items()}


def check_metadata(metadata: Mapping[str, str], task: Task, source: str) -> None:
    """Refuse a file of another schema version, task, frequency or set of objects.

    Raises:
        DemonstrationError: with what was found and what was expected.
    """
    for problem in metadata_problems(metadata, task):
        _refuse(source, problem)


def metadata_problems(metadata: Mapping[str, str], task: Task) -> Iterator[str]:
    """Say of each entry of a file's metadata that is not as the task wants it what was found and expected."""
    for key, expected in (("schema_version", VERSION), ("task", task.name)):
        found = metadata.get(key)
        if found != expected:
            yield _problem(f"metadata {_PREFIX}{key}", found, expected)
    frequency = metadata.get("frequency", "")
    if not isclose(_number(frequency), task.frequency, rel_tol=1e-9):
        yield _problem(f"metadata {_PREFIX}frequency", frequency, f"{task.frequency!r} frames per second")
    found_objects, expected_objects = _parsed_objects(metadata), _objects(task.layout)
    if found_objects is None:
        yield _problem(f"metadata {_PREFIX}objects", metadata.get("objects"), "a JSON object")
        return
    for name in dict.fromkeys((*expected_objects, *found_objects)):
        stated, wanted = found_objects.get(name), expected_objects.get(name)
        if stated != wanted:
            yield _problem(f"object {name}", _spelled(stated), _spelled(wanted))


def check_columns(schema: pa.Schema, layout: Layout, metadata: Mapping[str, str], source: str) -> tuple[str, ...]:
    """Refuse a file that lacks a column or states another unit for one.

    Args:
        schema: the file's columns.
        layout: attributes that need one each.
        metadata: says whether there are snapshots.
        source: file, for messages.

    Returns:
        The names of columns that the format does not know; they are ignored.

    Raises:
        DemonstrationError: with what was found and what was expected.
    """
    for problem in column_problems(schema, layout, metadata):
        _refuse(source, problem)
    expected = schema_of(layout, {}, snapshots=True)
    return tuple(name for name in schema.names if name not in expected.names)


def column_problems(schema: pa.Schema, layout: Layout, metadata: Mapping[str, str]) -> Iterator[str]:
    """Say which columns a file lacks, has twice, or states another unit for."""
    expected = schema_of(layout, {}, snapshots=True)
    optional = {SNAPSHOT.name} if metadata.get("snapshots") != "true" else set()
    lacking = [name for name in expected.names if name not in schema.names and name not in optional]
    if lacking:
        yield _problem(f"missing column {', '.join(lacking)}", ", ".join(schema.names), ", ".join(expected.names))
    repeated = [name for name in expected.names if schema.names.count(name) > 1]
    for name in repeated:
        yield _problem(f"column {name}", "it more than once", "it once")
    for field in expected:
        present = field.name in schema.names and field.name not in repeated
        wanted, stated = _unit(field), _unit(schema.field(field.name)) if present else None
        if stated not in (None, wanted):
            yield _problem(f"column {field.name}: unit", stated, wanted)


def _unit(field: pa.Field) -> str | None:
    """Return the unit that a field's metadata states, if it states one."""
    unit: bytes | None = (field.metadata or {}).get(b"unit")
    return None if unit is None else unit.decode(errors="replace")


def _objects(layout: Layout) -> dict[str, Json]:
    """Describe every object of a layout by its name."""
    described: dict[str, Json] = {"mu": _described(layout.robot)}
    described.update((name, _described(kind)) for name, kind in zip(layout.names, layout.entities, strict=True))
    return described


def _described(kind: ObjectType) -> Json:
    """Describe one object type."""
    attributes, goal = (
        {a.name: {"components": list(a.components), "unit": a.unit} for a in kind.described(of_goal)}
        for of_goal in (False, True)
    )
    return {"type": kind.name, "attributes": attributes, "goal": goal}


def _parsed_objects(metadata: Mapping[str, str]) -> Mapping[str, Json] | None:
    """Read the description of a file's objects; None where there is none."""
    try:
        value = parse_json(metadata.get("objects", ""))
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _number(text: str) -> float:
    """Read a number; NaN when it is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _spelled(value: Json) -> str | None:
    """Spell a description, or None where there is none."""
    return None if value is None else canonical_json(value)


def _problem(what: str, found: str | None, expected: str | None) -> str:
    """Word a problem."""
    return f"{what}: found {found or 'none'}, expected {expected or 'none'}"


def _refuse(source: str, problem: str) -> NoReturn:
    """Raise the one error of this module."""
    msg = f"{source}: {problem}"
    raise DemonstrationError(msg)
