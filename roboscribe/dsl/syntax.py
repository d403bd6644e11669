"""Syntax of the language (Fig. 5 and 12), as frozen data.

Predicates over named entities (Fig. 12) and over program variables (Fig. 5) are one datatype: an entity's name is a
free variable. Meaning, printing, typing, rewriting and reward are functions in modules of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias


class Printed:
    """Mixin: `str` of any node is its canonical text."""

    __slots__ = ()

    def __str__(self) -> str:
        """Print on one line, as the parser reads it."""
        from roboscribe.dsl.printer import text

        return text(self)  # type: ignore[arg-type]  # every class that mixes this in is a node


@dataclass(frozen=True)
class Robot(Printed):
    """μ, the end effector."""


@dataclass(frozen=True)
class Var(Printed):
    """v or e_i: a variable that binds an entity."""

    name: str


@dataclass(frozen=True)
class Goal(Printed):
    """g(v): the goal of the entity that v binds."""

    of: Var


Object: TypeAlias = Robot | Var | Goal


@dataclass(frozen=True)
class Proj(Printed):
    """α↓field: some components of one attribute, for instance xyz, xy, z, opening, angle."""

    of: Object
    field: str


@dataclass(frozen=True)
class Diff(Printed):
    """α − α; a difference of angles (unit rad) is wrapped to [−π, π]."""

    left: Term
    right: Term


@dataclass(frozen=True)
class Norm(Printed):
    """‖α‖, Euclidean; of a scalar its absolute value."""

    of: Term


@dataclass(frozen=True)
class Arctan2(Printed):
    """arctan2(α) of a planar vector (x, y): the angle of y over x, in rad."""

    of: Term


@dataclass(frozen=True)
class Const(Printed):
    """φ, a learned constant."""

    value: float


Term: TypeAlias = Proj | Diff | Norm | Arctan2 | Const


@dataclass(frozen=True)
class Truth(Printed):
    """True."""


@dataclass(frozen=True)
class Solved(Printed):
    """ψ_R: the task's own goal test, a black box that can be asked but not read."""


@dataclass(frozen=True)
class Less(Printed):
    """α < α or α < φ."""

    left: Term
    right: Term


@dataclass(frozen=True)
class Greater(Printed):
    """α > φ."""

    left: Term
    right: Const


@dataclass(frozen=True)
class NotNull(Printed):
    """v ≠ null."""

    of: Var


@dataclass(frozen=True)
class Not(Printed):
    """¬P."""

    of: Predicate


@dataclass(frozen=True)
class And(Printed):
    """P ∧ P."""

    left: Predicate
    right: Predicate


@dataclass(frozen=True)
class Or(Printed):
    """P ∨ P."""

    left: Predicate
    right: Predicate


@dataclass(frozen=True)
class Exists(Printed):
    """∃v:τ. P over the entities of one type."""

    var: Var
    type: str
    body: Predicate


Predicate: TypeAlias = Truth | Solved | Less | Greater | NotNull | Not | And | Or | Exists
Atom: TypeAlias = Less | Greater


@dataclass(frozen=True)
class Get(Printed):
    """v := get(λv:τ. P): bind v to an entity for which P holds, or to null."""

    var: Var
    type: str
    where: Predicate


@dataclass(frozen=True)
class While(Printed):
    """while (P) {S}, or while ((v := get(λv:τ. P)) ≠ null) {S}."""

    guard: Get | Predicate
    body: Statement


@dataclass(frozen=True)
class If(Printed):
    """if (P) S else S."""

    test: Predicate
    then: Statement
    otherwise: Statement


@dataclass(frozen=True)
class Seq(Printed):
    """S; S; … — the empty sequence does nothing. A sequence is never nested directly in a sequence."""

    parts: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class Run(Printed):
    """π_name(args) until P: the abstract action π[φ] of Sec. 2.3, one low-level controller run until φ holds.

    `args` are μ, variables and goals of variables, all that the controller may look at.
    """

    controller: str
    args: tuple[Object, ...]
    until: Predicate


Statement: TypeAlias = Get | While | If | Seq | Run


@dataclass(frozen=True)
class Program(Printed):
    """def name(μ : EE): body."""

    name: str
    body: Statement
