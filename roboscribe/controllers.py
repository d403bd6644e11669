"""Libraries of controllers: learned ones, those that a task brings, and both as JSON descriptions with weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, runtime_checkable

from numpy.typing import NDArray

from roboscribe.dsl.interpreter import Controller
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import text
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program, Run
from roboscribe.errors import ArtifactError, TaskError
from roboscribe.io.atomic import Json
from roboscribe.reward import atom_term, atoms
from roboscribe.rl.skill import Skill
from roboscribe.subtask_tree import Tree
from roboscribe.world.layout import FloatArray, IntArray
from roboscribe.world.task import Task

Arrays: TypeAlias = Mapping[str, NDArray[Any]]
SCRIPT = "script"
"""Key that tells a scripted controller's description from a learned one's."""


@runtime_checkable
class BringsControllers(Protocol):
    """A task with controllers of its own, which profile `scripted` takes instead of learned ones."""

    def controller(self, run: Run, scales: Mapping[str, float], seed: int) -> Controller:
        """Return a controller for a statement.

        Args:
            run: the statement.
            scales: spread of each term of its `until`, in the term's unit.
            seed: decides everything random.
        """


@dataclass(frozen=True, eq=False)
class Scripted:
    """A controller that a task brings, with what it takes to ask the task for it again."""

    run: Run
    scales: Mapping[str, float]
    seed: int
    controller: Controller

    @classmethod
    def of(cls, task: Task, run: Run, scales: Mapping[str, float], seed: int) -> Scripted:
        """Ask a task for the controller of a statement.

        Raises:
            TaskError: the task brings none.
        """
        if not isinstance(task, BringsControllers):
            msg = f"profile scripted: task {task.name} brings no controllers; expected one with a method `controller`"
            raise TaskError(msg)
        return cls(run, scales, seed, task.controller(run, scales, seed))

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return actions (R, A) in [-1, 1] for states (R, F) and bound entities (R, n)."""
        return self.controller.act(states, entities)


Library: TypeAlias = Mapping[str, Skill | Scripted]
"""Controllers by name."""


def scripted(task: Task, program: Program, tree: Tree, known: Library, seed: int) -> dict[str, Scripted]:
    """Return the task's own controller for every statement of a program that the library lacks.

    Raises:
        TaskError: the task brings none.
    """
    new = {run.controller: run for run in controllers(program) if run.controller not in known}
    return {name: Scripted.of(task, run, _scales(run, tree), seed) for name, run in new.items()}


def _scales(run: Run, tree: Tree) -> dict[str, float]:
    """Rename the spreads learned with a node, which speak of named entities, to the program's variables."""
    node = next((node for node in tree.nodes if node.name == run.controller), None)
    if node is None:
        return {}
    pairs = zip(atoms(run.until), atoms(node.predicate), strict=True)
    return {str(atom_term(mine)): node.scales.get(str(atom_term(theirs)), 1.0) for mine, theirs in pairs}


def to_parts(library: Library) -> tuple[dict[str, Json], dict[str, Any]]:
    """Return descriptions by name, and weights by flat name (`hold.0.weight`)."""
    descriptions: dict[str, Json] = {}
    weights: dict[str, Any] = {}
    for name, controller in library.items():
        if isinstance(controller, Scripted):
            script = text(Program(name, controller.run))
            descriptions[name] = {SCRIPT: script, "scales": dict(controller.scales), "seed": controller.seed}
        else:
            description, arrays = controller.to_parts()
            descriptions[name] = plain(description)
            weights.update({f"{name}.{part}": array for part, array in arrays.items()})
    return descriptions, weights


def from_parts(
    descriptions: Mapping[str, Json], weights: Arrays, task: Task, where: str = "controllers"
) -> dict[str, Skill | Scripted]:
    """Read what `to_parts` gave.

    Raises:
        ArtifactError: descriptions and weights do not fit together, or not the task.
    """
    return {name: _controller(name, description, weights, task, where) for name, description in descriptions.items()}


def _controller(name: str, description: Json, weights: Arrays, task: Task, where: str) -> Skill | Scripted:
    if not isinstance(description, Mapping):
        msg = f"{where}: controller {name} is described by {description!r}, expected a JSON object"
        raise ArtifactError(msg)
    if SCRIPT in description:
        return _scripted(name, description, task, where)
    own = {key.removeprefix(f"{name}."): array for key, array in weights.items() if key.startswith(f"{name}.")}
    return Skill.from_parts(name, description, own, task.layout)


def _scripted(name: str, description: Mapping[str, Any], task: Task, where: str) -> Scripted:
    (run,) = controllers(parse_program(str(description[SCRIPT])))
    scales = {str(term): float(scale) for term, scale in description["scales"].items()}
    try:
        return Scripted.of(task, run, scales, int(description["seed"]))
    except TaskError as error:
        msg = f"{where}: controller {name} is one that a task brings, and task {task.name} brings none"
        raise ArtifactError(msg) from error


def plain(value: object) -> Json:
    """Return a value with tuples as JSON lists, so that it equals what is read back."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    assert value is None or isinstance(value, bool | int | float | str), f"{value!r} is no JSON"
    return value
