"""Settings of stages as JSON: frozen dataclasses of plain values, tuples and other such dataclasses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, NoReturn, TypeVar, Union, get_args, get_origin, get_type_hints

from roboscribe.errors import ArtifactError, did_you_mean
from roboscribe.io.atomic import Json

T = TypeVar("T")


def encode(value: object) -> Json:
    """Encode a settings value as JSON.

    Raises:
        TypeError: a value of a kind that settings may not hold.
    """
    match value:
        case None | bool() | int() | float() | str():
            return value
        case tuple() | list():
            return [encode(item) for item in value]
        case Mapping():
            return {str(key): encode(item) for key, item in value.items()}
        case _ if is_dataclass(value) and not isinstance(value, type):
            return {field.name: encode(getattr(value, field.name)) for field in fields(value)}
        case _:
            pass
    msg = f"settings hold {type(value).__name__} {value!r}; expected numbers, text, tuples or frozen dataclasses"
    raise TypeError(msg)


def flattened(value: Json, name: str = "") -> dict[str, Json]:
    """Spread nested settings out: every plain value by its dotted name, "training.ppo.worlds" for instance."""
    if not isinstance(value, Mapping):
        return {name: value}
    found: dict[str, Json] = {}
    for key, item in value.items():
        found |= flattened(item, f"{name}.{key}" if name else str(key))
    return found


def decode(kind: type[T], value: Json, where: str = "settings") -> T:
    """Read what `encode` wrote.

    Args:
        kind: the dataclass.
        value: JSON.
        where: named in messages.

    Raises:
        ArtifactError: an unknown or missing name, or a value of another type.
    """
    decoded: T = _decode(kind, value, where)
    return decoded


def _decode(kind: Any, value: Json, where: str) -> Any:  # noqa: ANN401 - annotations have no type of their own
    """Read a value of any annotation that settings use."""
    origin = get_origin(kind)
    if origin in (Union, UnionType):
        return _union(get_args(kind), value, where)
    if origin is Literal:
        if value not in get_args(kind):
            _refuse(where, value, " or ".join(map(repr, get_args(kind))))
        return value
    if origin is tuple and isinstance(value, list):
        return tuple(_decode(get_args(kind)[0], item, where) for item in value)
    if is_dataclass(kind) and isinstance(value, Mapping):
        return _dataclass(kind, value, where)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if isinstance(kind, type) and isinstance(value, kind) and isinstance(value, bool) == (kind is bool):
        return value
    _refuse(where, value, _spelled(kind))


def _union(kinds: tuple[Any, ...], value: Json, where: str) -> Any:  # noqa: ANN401 - as above
    """Read None, or one of several dataclasses: the first that knows all the names given."""
    inner = [kind for kind in kinds if kind is not NoneType]
    if value is None and len(inner) < len(kinds):
        return None
    known = [{field.name for field in fields(kind)} if is_dataclass(kind) else set() for kind in inner]
    given = set(value) if isinstance(value, Mapping) else set()
    fitting = [kind for kind, names in zip(inner, known, strict=True) if given <= names]
    return _decode(fitting[0] if fitting else inner[0], value, where)


def _dataclass(kind: Any, value: Mapping[str, Json], where: str) -> Any:  # noqa: ANN401 - as above
    """Read a dataclass; names left out keep their defaults."""
    hints = get_type_hints(kind)
    names = {field.name for field in fields(kind)}
    unknown = set(value) - names
    if unknown:
        hint = did_you_mean(min(unknown), names)
        _refuse(where, ", ".join(sorted(unknown)), f"{', '.join(sorted(names))}{hint and f'; {hint.strip()}'}")
    try:
        return kind(**{name: _decode(hints[name], item, f"{where}.{name}") for name, item in value.items()})
    except TypeError as error:
        _refuse(where, str(error), ", ".join(sorted(names)))


def _spelled(kind: Any) -> str:  # noqa: ANN401 - as above
    """Say what a value of some annotation looks like; of a record, which names it has."""
    if is_dataclass(kind):
        return f"an object with {', '.join(field.name for field in fields(kind))}"
    return str(getattr(kind, "__name__", kind))


def _refuse(where: str, found: object, expected: str) -> NoReturn:
    """Raise an ArtifactError that says what was found and what was expected."""
    msg = f"{where}: found {found!r}, expected {expected}"
    raise ArtifactError(msg)
