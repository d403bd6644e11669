"""Judges a program: its parts in order, what each ends with, its guards, its conditions, and its success."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from roboscribe.dsl.rewrite import controllers, free_vars, walk
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Get, If, Predicate, Program, Run, Seq, Statement, Truth, While
from roboscribe.world.layout import BoolArray, FloatArray
from tests.quality.bench.data import Phase
from tests.quality.bench.situations import endings, finished, moments
from tests.quality.bench.task import KinematicTask

ENOUGH = 0.95
"""Share of episodes that must succeed, and of situations in which a guard must be right."""
MOSTLY = 0.9
"""Share of situations in which what ends a part must be right: thresholds are the learner's own."""


@dataclass(frozen=True)
class Found:
    """A program, taken apart as far as every path through it needs: its statements, and the type of each variable."""

    items: tuple[Statement, ...]
    types: dict[str, str]


@dataclass(frozen=True)
class Matched:
    """How far a program agrees with a list of parts: the next statement, and what is wrong ("" for nothing)."""

    next: int
    problem: str = ""


def judge(task: KinematicTask, program: Program, rollouts: Rollouts) -> str:
    """Return what is wrong with a program; nothing if it is right.

    Args:
        task: with its answer.
        program: what was found.
        rollouts: the program at work on fresh seeds.
    """
    if all(phase.only and len(task.of_kind(phase.kind)) == 1 for phase in task.phases):
        problem = judge_choice(task, program, rollouts)
    elif task.phase_order in ("fixed", "random"):
        problem = judge_parts(task, program)
    else:
        problem = judge_conditions(task, program, rollouts)
    rate = float(rollouts.success.mean())
    return problem or ("" if rate >= ENOUGH else f"it succeeds in only {rate:.0%} of fresh episodes")


def judge_parts(task: KinematicTask, program: Program) -> str:
    """Compare the parts of a program without conditions with those of the answer, in any order that is right."""
    if any(isinstance(node, If) for node in walk(program)):
        return "a condition where none is needed"
    found = Found(tuple(_flat(program.body)), _types(program))
    start, rest = task.phases[: task.first], task.phases[task.first :]
    orders = permutations(rest) if task.phase_order == "random" else [rest]
    matches = [_match(task, found, (*start, *order)) for order in orders]
    if any(not match.problem for match in matches):
        return ""
    return max(matches, key=lambda match: match.next).problem


def _match(task: KinematicTask, found: Found, phases: tuple[Phase, ...]) -> Matched:
    """Go through the statements of a program, part by part."""
    at = 0
    for phase in phases:
        while at < len(found.items) and isinstance(found.items[at], Get):
            at += 1
        part = _loop(task, found, phase, at) if _is_loop(task, phase, found, at) else _straight(task, found, phase, at)
        if part.problem:
            return part
        at = part.next
    left: list[Statement] = [item for item in found.items[at:] if not isinstance(item, Get)]
    if task.away:
        return Matched(at, _leaves(task, left))
    return Matched(at, f"{_shown(left[0])} is redundant" if left else "")


def _is_loop(task: KinematicTask, phase: Phase, found: Found, at: int) -> bool:
    """Whether a part has to be a loop; where either will do, whether it is one."""
    if phase.shape == "either":
        return at < len(found.items) and isinstance(found.items[at], While)
    return phase.shape == "loop" or (not phase.shape and task.kind(phase.kind).count > 1)


def most(task: KinematicTask, phase: Phase) -> int:
    """Count the controllers that a part may have at most."""
    return len(phase.aims) + (2 if task.kind(phase.kind).moves == "pushed" else 1)


def _straight(task: KinematicTask, found: Found, phase: Phase, at: int) -> Matched:
    """Read controllers up to the one that serves the object."""
    begin = at
    count = 0
    while at < len(found.items):
        item = found.items[at]
        at += 1
        if isinstance(item, While):
            return Matched(begin, f"a loop where {phase.kind} is expected, served once")
        if isinstance(item, Run):
            count += 1
            if _ends(task, found, phase, item):
                many = f"{count} controllers for {phase.kind}, expected at most {most(task, phase)}"
                return Matched(at, many if count > most(task, phase) else "")
    return Matched(begin, f"nothing serves {phase.kind} ({_aims(phase)}) where that is expected")


def _loop(task: KinematicTask, found: Found, phase: Phase, at: int) -> Matched:
    """Read a loop over the objects of a phase."""
    if at >= len(found.items):
        return Matched(at, f"no loop over {phase.kind} ({_aims(phase)})")
    item = found.items[at]
    if not isinstance(item, While) or not isinstance(item.guard, Get):
        return Matched(at, f"{_shown(item)} where a loop over {phase.kind} ({_aims(phase)}) is expected")
    if item.guard.type != phase.kind:
        return Matched(at, f"a loop over {item.guard.type} where one over {phase.kind} is expected")
    body = list(_flat(item.body))
    runs = [part for part in body if isinstance(part, Run)]
    if any(isinstance(part, While) for part in body) or not runs:
        return Matched(at, f"a loop inside the loop over {phase.kind}")
    if not _ends(task, found, phase, runs[-1]):
        return Matched(at, f"the loop over {phase.kind} ends with {_shown(runs[-1])}, expected {_aims(phase)}")
    if len(runs) > most(task, phase):
        return Matched(at, f"{len(runs)} controllers in the loop over {phase.kind}, expected {most(task, phase)}")
    problem = judge_guard(task, phase, item.guard, found.types)
    return Matched(at if problem else at + 1, problem)


def _ends(task: KinematicTask, found: Found, phase: Phase, run: Run) -> bool:
    """Whether the goal of a controller means that an object of the phase is served."""
    shown = endings(task, phase)
    truth = [
        (
            _holds(task, found.types, run.until, e.before, phase.kind, e.entity),
            _after(task, found, run, phase, e.entity, e.after),
        )
        for e in shown
    ]
    before = np.concatenate([one for one, _ in truth])
    after = np.concatenate([other for _, other in truth])
    return bool((~before).mean() >= MOSTLY and after.mean() >= MOSTLY)


def _after(task: KinematicTask, found: Found, run: Run, phase: Phase, entity: int, states: FloatArray) -> BoolArray:
    return _holds(task, found.types, run.until, states, phase.kind, entity)


def _holds(
    task: KinematicTask, types: dict[str, str], predicate: Predicate, states: FloatArray, kind: str, entity: int
) -> BoolArray:
    """Evaluate a predicate with its variables of one kind bound to an entity, others to the first of their type."""
    names = [name for name in free_vars(predicate) if name in types]
    binding = {name: entity if types[name] == kind else task.of_kind(types[name])[0] for name in names}
    return holds(predicate, states, binding, task.layout, task.solved)


def judge_guard(task: KinematicTask, phase: Phase, get: Get, types: dict[str, str]) -> str:
    """Compare whom a guard admits with whom the answer admits, whenever somebody has to be chosen."""
    chosen = moments(task, phase)
    states = np.stack([moment.state for moment in chosen])
    members = task.of_kind(phase.kind)
    others = {n: task.of_kind(types[n])[0] for n in free_vars(get.where) if n in types and n != get.var.name}
    admits = np.stack(
        [holds(get.where, states, {**others, get.var.name: e}, task.layout, task.solved) for e in members], axis=1
    )
    allowed = np.array([[e in moment.allowed for e in members] for moment in chosen])
    waiting = np.array([[e in moment.waiting for e in members] for moment in chosen])
    if (admits & ~waiting).any(axis=1).mean() > 1 - ENOUGH:
        return f"the guard of the loop over {phase.kind} admits what is served already"
    somebody = admits.any(axis=1) == waiting.any(axis=1)
    agree = somebody if phase.free else (admits == allowed).all(axis=1)
    if agree.mean() >= ENOUGH:
        return ""
    kind = "admits others than" if (admits & ~allowed).any() else "refuses some of"
    return f"the guard of the loop over {phase.kind} {kind} those whose turn it is ({phase.order})"


def judge_choice(task: KinematicTask, program: Program, rollouts: Rollouts) -> str:
    """Compare the one condition of a program with what decides which phase the only object of a kind goes through."""
    tests = [node.test for node in walk(program) if isinstance(node, If)]
    if len(tests) != 1:
        return f"{len(tests)} conditions, expected one"
    states, phase = np.stack([shown.states[0] for shown in rollouts.trajectories]), task.phases[0]
    (entity,) = task.of_kind(phase.kind)
    truth = _holds(task, _types(program), tests[0], states, phase.kind, entity)
    agrees = float(np.mean(truth == task.member(states, phase, entity)))
    return "" if max(agrees, 1.0 - agrees) >= ENOUGH else "the condition is not about what decides"


def judge_conditions(task: KinematicTask, program: Program, rollouts: Rollouts) -> str:
    """Compare the order in which kinds are served with what the initial state asks for; count the controllers."""
    names = {run.controller for run in controllers(program)}
    limit = sum(most(task, phase) for phase in task.phases)
    if len(names) > limit:
        return f"{len(names)} controllers, expected at most {limit}"
    shown = [t.states for t, won in zip(rollouts.trajectories, rollouts.success, strict=True) if won]
    right = [_order(task, states) == task.sequence(states[0]) for states in shown]
    if shown and np.mean(right) < ENOUGH:
        return f"the order that the initial state asks for is kept in only {np.mean(right):.0%} of the episodes"
    return ""


def _order(task: KinematicTask, states: FloatArray) -> tuple[Phase, ...]:
    """Phases in the order in which they were over."""
    return tuple(sorted(task.phases, key=lambda phase: int(task.done(states, phase).argmax())))


def _leaves(task: KinematicTask, items: list[Statement]) -> str:
    """Check that a single controller goes away from all objects at the end."""
    runs = [item for item in items if isinstance(item, Run)]
    if len(items) != 1 or len(runs) != 1:
        return f"{len(items)} statements after the last part, expected one controller that goes away"
    near, far = finished(task)
    types = {name: task.phases[-1].kind for name in free_vars(runs[0].until)}
    last = task.of_kind(task.phases[-1].kind)[-1]
    here, there = (_holds(task, types, runs[0].until, s, task.phases[-1].kind, last) for s in (near, far))
    away = bool((~here).mean() >= MOSTLY and there.mean() >= MOSTLY)
    return "" if away else f"{_shown(runs[0])} where going away is expected"


def _flat(statement: Statement) -> Iterator[Statement]:
    """Take sequences apart."""
    if isinstance(statement, Seq):
        for part in statement.parts:
            yield from _flat(part)
    else:
        yield statement


def _types(program: Program) -> dict[str, str]:
    return {node.var.name: node.type for node in walk(program) if isinstance(node, Get)}


def _aims(phase: Phase) -> str:
    return ", then ".join(f"{aim.attribute} {aim.to}" for aim in phase.aims)


def _shown(statement: Statement) -> str:
    """Name a statement in a few words."""
    match statement:
        case Run(name, _, until):
            return f"π_{name} until {until}"
        case While(guard, _):
            return f"a loop over {guard.type}" if isinstance(guard, Get) else "a loop without an object"
        case Get(var, kind, where):
            return f"{var} := get of {kind}{'' if where == Truth() else ' where …'}"
        case _:
            return "a condition"
