"""What is asked for, as a TOML file and as `name=value` on the command line; every field by its dotted name."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json
from roboscribe.stages.runtime.configuration import decode, encode, flattened
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan

CONFIG = "config.toml"
DEMONSTRATIONS = "demonstrations"


def read_settings(path: Path) -> dict[str, Any]:
    """Read a file of settings.

    Raises:
        ArtifactError: it cannot be read, or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        msg = f"{path}: cannot be read as settings ({error}), expected TOML like the {CONFIG} beside each run"
        raise ArtifactError(msg) from error


def with_setting(settings: Mapping[str, Any], assignment: str) -> dict[str, Any]:
    """Return settings with one more.

    Args:
        settings: nested, left as they are.
        assignment: "training.learner.worlds=32"; the value is TOML's, or else plain text.

    Raises:
        ArtifactError: it is no assignment.
    """
    name, sign, text = assignment.partition("=")
    if not sign or not all(part.isidentifier() for part in name.split(".")):
        msg = f"--set {assignment}: found no assignment, expected NAME=VALUE, for instance training.budget=100000"
        raise ArtifactError(msg)
    return merged(settings, _nested(name.split("."), _value(text)))


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Lay settings over others, name by name."""
    found = dict(below)
    for key, value in above.items():
        own = found.get(key)
        both = isinstance(own, Mapping) and isinstance(value, Mapping)
        found[key] = merged(own, value) if both else value  # type: ignore[arg-type]  # `both` says what `own` is
    return found


def to_plan(settings: Mapping[str, Any], where: str = "settings") -> SynthesisPlan:
    """Read what is asked for; what is left out is as usual.

    Args:
        settings: nested.
        where: named in messages.

    Raises:
        ArtifactError: an unknown name, or a value of another type.
    """
    own = {name: value for name, value in settings.items() if name != DEMONSTRATIONS}
    plan = decode(SynthesisPlan, own, where)
    given = settings.get(DEMONSTRATIONS)
    return plan if given is None else replace(plan, demonstrations=Path(str(given)))


def to_toml(plan: SynthesisPlan) -> str:
    """Spell everything that is asked for, the usual included; what is None is left out."""
    encoded = encode(replace(plan, demonstrations=None))
    assert isinstance(encoded, Mapping)
    given = {} if plan.demonstrations is None else {DEMONSTRATIONS: str(plan.demonstrations)}
    return "\n".join([*_spelled({**encoded, **given}, ()), ""])


def assignments(plan: SynthesisPlan, usual: SynthesisPlan, known: Sequence[str]) -> list[str]:
    """Spell what differs from a usual plan and has no option of its own, as `--set` takes it."""
    own, others = (flattened(encode(replace(each, demonstrations=None))) for each in (plan, usual))
    differing = {name: value for name, value in own.items() if value != others.get(name) and name not in known}
    return [f"{name}={json.dumps(value, ensure_ascii=False)}" for name, value in differing.items() if value is not None]


def _nested(names: Sequence[str], value: Json) -> dict[str, Any]:
    """Wrap a value in its names."""
    for name in reversed(names[1:]):
        value = {name: value}
    return {names[0]: value}


def _value(text: str) -> Any:  # noqa: ANN401 - whatever TOML holds
    """Read a value of TOML; what is none is text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _spelled(settings: Mapping[str, Json], above: tuple[str, ...]) -> list[str]:
    """Spell a table and the tables in it; numbers, text and lists are spelled as in JSON."""
    plain = {name: value for name, value in settings.items() if value is not None and not isinstance(value, Mapping)}
    lines = [f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in plain.items()]
    if above and plain:
        lines = ["", f"[{'.'.join(above)}]", *lines]
    for name, value in settings.items():
        if isinstance(value, Mapping):
            lines += _spelled(value, (*above, name))
    return lines
