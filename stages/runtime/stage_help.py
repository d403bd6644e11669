"""What a stage's `--help` says: what it writes, its inputs, its settings with their defaults, and an example."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, get_type_hints

from roboscribe.io.atomic import Json
from roboscribe.stages.runtime.configuration import encode, flattened
from roboscribe.stages.runtime.store import AnyStage

SAMPLES: dict[str, Json] = {"name": "pick-place-1", "goal": "ψ_R", "profile": "actions", "seed": 0}
"""What the example gives for settings without a default."""


def input_names(stage: AnyStage) -> dict[str, str]:
    """Return what a stage reads and what that is, as the section `Inputs:` of its `run` lists it."""
    _, _, section = (inspect.getdoc(stage.run) or "").partition("Inputs:\n")
    lines = [line.strip().partition(": ") for line in section.partition("\n\n")[0].splitlines()]
    return {name: about for names, _, about in lines for name in names.split(", ")}


def stage_help(stage: AnyStage) -> str:
    """Return the part of a stage's help that follows its options."""
    written = (inspect.getdoc(stage.run) or "").partition("\n")[0]
    given = [f"  {name}: {about}" for name, about in input_names(stage).items()]
    chapters = {
        "outputs, in --out": [f"  {written}"],
        "inputs, each as --input NAME=PATH": given or ["  none"],
        "settings": [f"  {line}" for line in _settings(stage.config)] or ["  none"],
        "example": [f"  {example(stage)}"],
    }
    return "\n\n".join("\n".join([f"{title}:", *lines]) for title, lines in chapters.items())


def example(stage: AnyStage) -> str:
    """Return a command that runs the stage, with the settings that have to be given."""
    words = [f"python -m roboscribe.stages.{stage.name}"]
    needed = _needed(stage.config)
    words += [f"--config '{json.dumps(needed, ensure_ascii=False)}'"] if needed else []
    words += [f"--input {name}=PATH" for name in input_names(stage)]
    return " ".join([*words, "--out DIR"])


def _settings(kind: Any, prefix: str = "") -> Iterator[str]:  # noqa: ANN401 - annotations have no type of their own
    """List settings by their dotted names, with defaults, those of nested records too."""
    hints = get_type_hints(kind)
    for field in fields(kind):
        name = f"{prefix}{field.name}"
        default = _default(field)
        if default is not MISSING:
            values = flattened(encode(default), name)
            yield from (f"{each} = {json.dumps(value, ensure_ascii=False)}" for each, value in values.items())
        elif is_dataclass(hints[field.name]):
            yield from _settings(hints[field.name], f"{name}.")
        else:
            yield f"{name}: {getattr(hints[field.name], '__name__', hints[field.name])}, has to be given"


def _needed(kind: Any) -> dict[str, Json]:  # noqa: ANN401 - as above
    """Return the settings without a default, as the example gives them."""
    hints = get_type_hints(kind)
    bare = [field.name for field in fields(kind) if _default(field) is MISSING]
    return {name: _needed(hints[name]) if is_dataclass(hints[name]) else SAMPLES[name] for name in bare}


def _default(field: Field[Any]) -> object:
    """Return a field's default; `MISSING` where it has none."""
    return field.default if field.default_factory is MISSING else field.default_factory()
