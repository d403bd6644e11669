"""Programs as flat code: control flow becomes jumps, so that a batch of rows can each stand at another instruction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, assert_never

from roboscribe.dsl.rewrite import free_vars, run_variables
from roboscribe.dsl.syntax import Get, If, Predicate, Program, Run, Seq, Statement, While

NOWHERE = -1
"""Target of a jump that is never taken."""


@dataclass(frozen=True)
class Act:
    """Run controller number `index` until `until` holds; on time-out go to `head`, the innermost loop, if any."""

    index: int
    controller: str
    until: Predicate
    variables: tuple[str, ...]
    needs: tuple[str, ...]
    head: int


@dataclass(frozen=True)
class Bind:
    """Bind a variable to an entity; where there is none, bind null and go to `null` unless that is NOWHERE."""

    var: str
    type: str
    where: Predicate
    needs: tuple[str, ...]
    null: int = NOWHERE


@dataclass(frozen=True)
class Branch:
    """Go on if the predicate holds, else go to `otherwise`."""

    predicate: Predicate
    needs: tuple[str, ...]
    otherwise: int = NOWHERE


@dataclass(frozen=True)
class Jump:
    """Go to `target`."""

    target: int


@dataclass(frozen=True)
class End:
    """The program is over."""


Instruction: TypeAlias = Act | Bind | Branch | Jump | End


def compile_program(program: Program) -> tuple[Instruction, ...]:
    """Flatten a program.

    Instruction i is followed by i + 1 unless it says otherwise. `Act.index` numbers controllers in textual order.

    Source: Fig. 14, with every rule's continuation made explicit.
    """
    code = _Code([], 0)
    code.statement(program.body, NOWHERE)
    return (*code.instructions, End())


@dataclass
class _Code:
    instructions: list[Instruction]
    acts: int

    def statement(self, statement: Statement, head: int) -> None:
        """Append the code of a statement inside the loop that starts at `head`."""
        match statement:
            case Seq(parts):
                for part in parts:
                    self.statement(part, head)
            case Run():
                self.act(statement, head)
            case Get():
                self.instructions.append(_bind(statement, NOWHERE))
            case While():
                self.loop(statement)
            case If():
                self.branch(statement, head)
            case _:
                assert_never(statement)

    def act(self, run: Run, head: int) -> None:
        """Append one controller."""
        act = Act(self.acts, run.controller, run.until, run_variables(run), free_vars(run.until), head)
        self.instructions.append(act)
        self.acts += 1

    def loop(self, loop: While) -> None:
        """Append guard, body and the jump back; then the guard knows where the loop ends."""
        head = len(self.instructions)
        self.instructions.append(Jump(NOWHERE))
        self.statement(loop.body, head)
        self.instructions.append(Jump(head))
        after = len(self.instructions)
        guard = loop.guard
        self.instructions[head] = (
            _bind(guard, after) if isinstance(guard, Get) else Branch(guard, free_vars(guard), after)
        )

    def branch(self, branch: If, head: int) -> None:
        """Append test, first branch, jump over the second, second branch."""
        test = len(self.instructions)
        self.instructions.append(Jump(NOWHERE))
        self.statement(branch.then, head)
        over = len(self.instructions)
        self.instructions.append(Jump(NOWHERE))
        self.statement(branch.otherwise, head)
        self.instructions[test] = Branch(branch.test, free_vars(branch.test), over + 1)
        self.instructions[over] = Jump(len(self.instructions))


def _bind(get: Get, null: int) -> Bind:
    needs = tuple(name for name in free_vars(get.where) if name != get.var.name)
    return Bind(get.var.name, get.type, get.where, needs, null)
