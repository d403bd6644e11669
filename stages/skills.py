"""Libraries of controllers on disk: what each sees in JSON, its weights in safetensors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from roboscribe.dsl.interpreter import Controller
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import text
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.envs.point_world import Lookahead, PointTask
from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import Json, write_file
from roboscribe.rl.skill import Skill
from roboscribe.world.task import Task
from stages.files import read_json, write_json

if TYPE_CHECKING:
    from numpy.typing import NDArray

Library: TypeAlias = Mapping[str, Skill | Lookahead]
Arrays: TypeAlias = "Mapping[str, NDArray[Any]]"

DESCRIPTIONS, WEIGHTS = "controllers.json", "controllers.safetensors"
SCRIPT = "lookahead"
"""Key that tells a scripted controller's description from a learned one's."""


def to_parts(library: Library) -> tuple[dict[str, Json], dict[str, Any]]:
    """Return descriptions by name, and weights by flat name (`hold.0.weight`)."""
    descriptions: dict[str, Json] = {}
    weights: dict[str, Any] = {}
    for name, skill in library.items():
        if isinstance(skill, Lookahead):
            script = text(Program(name, skill.run))
            descriptions[name] = {SCRIPT: script, "scales": dict(skill.scales), "seed": skill.seed}
        else:
            description, arrays = skill.to_parts()
            descriptions[name] = plain(description)
            weights.update({f"{name}.{part}": array for part, array in arrays.items()})
    return descriptions, weights


def from_parts(
    descriptions: Mapping[str, Json], weights: Arrays, task: Task, where: str = "controllers"
) -> dict[str, Skill | Lookahead]:
    """Read what `to_parts` gave.

    Raises:
        ArtifactError: descriptions and weights do not fit together, or not the task.
    """
    return {name: _skill(name, description, weights, task, where) for name, description in descriptions.items()}


def write_library(out: Path, library: Library) -> None:
    """Write a library's two files."""
    descriptions, weights = to_parts(library)
    write_file(out / WEIGHTS, safetensors.save({name: np.ascontiguousarray(a) for name, a in weights.items()}))
    write_json(out / DESCRIPTIONS, descriptions)


def read_library(descriptions: Path, weights: Path, task: Task) -> dict[str, Skill | Lookahead]:
    """Read a library's two files.

    Raises:
        ArtifactError: one of them is damaged, or they do not fit the task.
    """
    try:
        arrays = safetensors.load_file(weights)
    except (OSError, SafetensorError) as error:
        msg = f"{weights}: cannot be read as safetensors ({error})"
        raise ArtifactError(msg) from error
    return from_parts(read_json(descriptions), arrays, task, str(weights))


def as_controllers(library: Mapping[str, Controller]) -> dict[str, Controller]:
    """Return the library as the interpreter takes it."""
    return dict(library)


def _skill(name: str, description: Json, weights: Arrays, task: Task, where: str) -> Skill | Lookahead:
    if not isinstance(description, Mapping):
        msg = f"{where}: controller {name} is described by {description!r}, expected a JSON object"
        raise ArtifactError(msg)
    if SCRIPT in description:
        return _scripted(name, description, task, where)
    own = {key.removeprefix(f"{name}."): array for key, array in weights.items() if key.startswith(f"{name}.")}
    return Skill.from_parts(name, description, own, task.layout)


def _scripted(name: str, description: Mapping[str, Any], task: Task, where: str) -> Lookahead:
    if not isinstance(task, PointTask):
        msg = f"{where}: controller {name} is scripted for point tasks, found task {task.name}"
        raise ArtifactError(msg)
    (run,) = controllers(parse_program(str(description[SCRIPT])))
    scales = {str(term): float(scale) for term, scale in description["scales"].items()}
    return Lookahead(task, run, scales, int(description["seed"]))


def plain(value: object) -> Json:
    """Return a value with tuples as JSON lists, so that it equals what is read back."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    assert value is None or isinstance(value, bool | int | float | str), f"{value!r} is no JSON"
    return value
