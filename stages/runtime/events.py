"""Events of a synthesis, which the console, the tracker and the event log receive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from roboscribe.classifier import Refinement
from roboscribe.dsl.syntax import Predicate, Program
from roboscribe.strips import Strips
from roboscribe.subtask_tree import Tree


@dataclass(frozen=True)
class Ingested:
    """Demonstrations were checked; `report` says how many are kept and why others are not, `profile` how to learn."""

    report: Mapping[str, Any]
    profile: str


@dataclass(frozen=True)
class Programmed:
    """A tree became a program for a goal."""

    goal: str
    program: Program


@dataclass(frozen=True)
class Trained:
    """A program was grounded; `reports` has one entry per new skill, `metrics` is the stage's journal."""

    goal: str
    reports: tuple[Mapping[str, Any], ...]
    metrics: Path


@dataclass(frozen=True)
class RolledOut:
    """A grounded program was tried; `counts` and `table` are figures and episodes."""

    goal: str
    counts: Mapping[str, Any]
    table: Path


class Decision:
    """What Algorithm 1 decides; it simulates nothing."""


@dataclass(frozen=True)
class Refined(Decision):
    """A comparison of demonstrations and failures gave a subgoal.

    Args:
        refinement: with what was passed over and why.
        table: its file.
        tree: the tree with the subgoal.
        explained: demonstrations that the program of this tree explains.
        demonstrations: how many there are.
        strips: where the subgoal holds along each of them.
    """

    refinement: Refinement
    table: Path
    tree: Tree
    explained: int
    demonstrations: int
    strips: Strips


@dataclass(frozen=True)
class Abandoned(Decision):
    """A line of refinements ended without a program that is good enough, and this is why; another is taken up."""

    reason: str


@dataclass(frozen=True)
class Retrained(Decision):
    """A promising program, which succeeded in the share `success` of its episodes, is trained on."""

    success: float


@dataclass(frozen=True)
class Loosened(Decision):
    """A program was tried with a subgoal that asks for less; `helps` where it succeeds more often with that."""

    subgoal: str
    predicate: Predicate
    success: float
    helps: bool


@dataclass(frozen=True)
class Removed(Decision):
    """A subgoal was taken out again; the program succeeds as often without it."""

    subgoal: str
    success: float


@dataclass(frozen=True)
class Evaluated:
    """The final program was evaluated."""

    figures: Mapping[str, Any]
    table: Path


@dataclass(frozen=True)
class Packaged:
    """The final program lies in a directory of its own."""

    program: Program
    tree: Tree
    directory: Path


@dataclass(frozen=True)
class Filmed:
    """An episode of the final program was filmed."""

    video: Path


@dataclass(frozen=True)
class Failed:
    """There is no program, and this is why."""

    reason: str


Event: TypeAlias = (
    Ingested
    | Programmed
    | Trained
    | RolledOut
    | Refined
    | Abandoned
    | Retrained
    | Loosened
    | Removed
    | Evaluated
    | Packaged
    | Filmed
    | Failed
)
EventCallback: TypeAlias = Callable[[Event], None]
