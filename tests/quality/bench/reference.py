"""The reference program of a task, as text of the language, derived from the phases of its script."""

from __future__ import annotations

from itertools import permutations

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.syntax import Program
from tests.quality.bench.data import Aim, Kind, Phase
from tests.quality.bench.kinematics import TRAVEL
from tests.quality.bench.task import KinematicTask

NEAR = 0.02
"""Distance at which an object counts as held, metres."""
EXACT = 0.6
"""Share of its tolerance within which an attribute counts as being at its goal."""
STRAIGHT = "‖arctan2(g({v})↓xy − {v}↓xy) − arctan2({v}↓xy − μ↓xy)‖ < 0.3 ∧ ‖μ↓xy − {v}↓xy‖ < 0.06"
"""Hand, object and goal lie in a line, and the hand is near."""


def reference(task: KinematicTask) -> Program:
    """Return a right program."""
    return parse_program(program_text(task))


def program_text(task: KinematicTask) -> str:
    """Write the program: gets first, then one part for each phase, in the order or orders that the task has."""
    names = {phase.kind: _letter(task, phase.kind) for phase in task.phases if straight(task, phase)}
    containers = [aim.of for phase in task.phases for aim in phase.aims if aim.of]
    names |= {of: _letter(task, of) for of in containers if task.kind(of).count == 1}
    owners = (bound.split()[2].partition(".")[0] for phase in task.phases for bound in phase.bounds)
    names |= {owner: _letter(task, owner) for owner in owners if owner in {kind.name for kind in task.kinds}}
    if " " in task.phase_order and not task.phase_order.startswith(("goal", "-goal")):
        owner = task.phase_order.split()[0]
        names[owner] = _letter(task, owner)
    gets = [f"  {letter} := get(λ{letter}:{kind}. true)" for kind, letter in names.items()]
    first = [line for phase in task.phases[: task.first] for line in part(task, phase, "  ")]
    rest = _ordered(task, task.phases[task.first :], frozenset(), "  ")
    return "\n".join(["def P(μ : EE):", *gets, *first, *rest, *_leaving(task)])


def straight(task: KinematicTask, phase: Phase) -> bool:
    """Whether a phase is a straight part: one object and no loop."""
    return task.kind(phase.kind).count == 1


def _letter(task: KinematicTask, kind: str) -> str:
    return task.layout.letter(kind)


def _leaving(task: KinematicTask) -> list[str]:
    """Go away from every object, where that is asked."""
    if not task.away:
        return []
    (kind,) = {kind.name for kind in task.kinds}
    o, plane = _letter(task, kind), task.plane
    return [f"  π_leave(μ) until ¬∃{o}'':{kind}. ‖μ↓{plane} − {o}''↓{plane}‖ < {task.away + 0.01:.3g}"]


def _ordered(
    task: KinematicTask, phases: tuple[Phase, ...], known: frozenset[tuple[str, str]], indent: str
) -> list[str]:
    """Write phases one after the other, under conditions on the goals or on a constant where their order varies."""
    if len(phases) == 2 and all(phase.only and straight(task, phase) for phase in phases):
        sides = [part(task, phase, f"{indent}  ") for phase in phases]
        return _branches(_only(task, phases[0], _letter(task, phases[0].kind)), sides[0], sides[1], indent)
    if task.phase_order in ("fixed", "random"):
        return [line for phase in phases for line in part(task, phase, indent)]
    if not task.phase_order.startswith(("goal", "-goal")):
        owner, attribute = task.phase_order.split()
        test, one, other = f"{_letter(task, owner)}↓{attribute} > 0.5", phases, phases[::-1]
        return _branches(test, _plain(task, one, indent), _plain(task, other, indent), indent)
    orders = [order for order in permutations(phases) if known <= _pairs(order)]
    if len(orders) == 1:
        return _plain(task, orders[0], indent)
    a, b = next(
        (one, other)
        for one in phases
        for other in phases
        if phases.index(one) < phases.index(other) and _undecided(orders, one, other)
    )
    field = task.phase_order.split()[1]
    left, right = (f"g({_letter(task, phase.kind)})↓{field}" for phase in (a, b))
    test = f"{right} < {left}" if task.phase_order.startswith("-") else f"{left} < {right}"
    then, otherwise = (
        _ordered(task, phases, known | {pair}, indent + "  ") for pair in ((a.kind, b.kind), (b.kind, a.kind))
    )
    return _branches(test, then, otherwise, indent)


def _undecided(orders: list[tuple[Phase, ...]], one: Phase, other: Phase) -> bool:
    return len({order.index(one) < order.index(other) for order in orders}) == 2


def _pairs(order: tuple[Phase, ...]) -> set[tuple[str, str]]:
    return {(one.kind, other.kind) for i, one in enumerate(order) for other in order[i + 1 :]}


def _plain(task: KinematicTask, phases: tuple[Phase, ...], indent: str) -> list[str]:
    return [line for phase in phases for line in part(task, phase, indent + "  ")]


def _branches(test: str, then: list[str], otherwise: list[str], indent: str) -> list[str]:
    return [f"{indent}if ({test}):", *then, f"{indent}else:", *otherwise]


def part(task: KinematicTask, phase: Phase, indent: str) -> list[str]:
    """Write one phase: straight for one object, else a loop."""
    kind, v = task.kind(phase.kind), _letter(task, phase.kind)
    tag = f"{kind.name}{task.phases.index(phase)}"
    if straight(task, phase):
        return [indent + line for line in _runs(task, phase, kind, v, tag)]
    head = f"{indent}while ({v} := get(λ{v}:{kind.name}. {guard(task, phase, v)})) ≠ null:"
    return [head, *(f"{indent}  {line}" for line in _runs(task, phase, kind, v, tag))]


def guard(task: KinematicTask, phase: Phase, v: str) -> str:
    """Write which objects may come next: those not served, and none that is not served ranks before them."""
    other = f"{v}'"
    only = f"{_only(task, phase, v)} ∧ " if phase.only else ""
    mine, theirs = (f"¬({all_met(task, phase, name)})" for name in (v, other))
    if phase.order == "any":
        return f"{only}{mine}"
    restricted = f"{_only(task, phase, other)} ∧ " if phase.only else ""
    return f"{only}{mine} ∧ ¬∃{other}:{phase.kind}. {_before(task, phase.order, other, v)} ∧ {restricted}{theirs}"


def _only(task: KinematicTask, phase: Phase, v: str) -> str:
    def side(value: str) -> str:
        owner, _, attribute = value.partition(".")
        return f"{_letter(task, owner)}↓{attribute}" if owner.isalpha() else value

    def said(attribute: str, sign: str, value: str) -> str:
        if value != "greatest":
            return f"{v}↓{attribute} {sign} {side(value)}"
        return f"{'¬' if sign == 'is' else ''}∃{v}'':{phase.kind}. {v}↓{attribute} < {v}''↓{attribute}"

    return " ∧ ".join(f"({said(*bound.split())})" for bound in phase.bounds)


def _before(task: KinematicTask, order: str, one: str, other: str) -> str:
    if order.startswith("-"):
        return _before(task, order[1:], other, one)
    return f"{_rank(task, order, one)} < {_rank(task, order, other)}"


def _rank(task: KinematicTask, order: str, v: str) -> str:
    match order.split():
        case ["hand"]:
            return f"‖μ↓{task.plane} − {v}↓{task.plane}‖"
        case ["goal", letter]:
            return f"g({v})↓{letter}"
        case _:
            return f"{v}↓{order}"


def _runs(task: KinematicTask, phase: Phase, kind: Kind, v: str, tag: str) -> list[str]:
    """Write the controllers of a phase: get hold of the object, then one for each aim."""
    if kind.moves == "pushed":
        grasp = f"π_align_{tag}(μ, {v}, g({v})) until {STRAIGHT.format(v=v)}"
    else:
        grasp = f"π_hold_{tag}(μ, {v}) until ‖μ↓{task.plane} − {v}↓{task.plane}‖ < {NEAR}"
    lines = [grasp]
    for i, aim in enumerate(phase.aims):
        kept = " ∧ ".join(met(task, earlier, v) for earlier in phase.aims[: i + 1])
        lines.append(f"π_{aim.attribute}_{tag}({_arguments(task, phase, phase.aims[: i + 1], v)}) until {kept}")
    return lines


def _arguments(task: KinematicTask, phase: Phase, aims: tuple[Aim, ...], v: str) -> str:
    goals = [f"g({v})"] if any(aim.to == "goal" for aim in aims) else []
    containers = [_letter(task, aim.of) for aim in aims if aim.of and task.kind(aim.of).count == 1]
    return ", ".join(["μ", v, *goals, *containers])


def all_met(task: KinematicTask, phase: Phase, v: str) -> str:
    """Write that an object is served."""
    return " ∧ ".join(met(task, aim, v) for aim in phase.aims)


def met(task: KinematicTask, aim: Aim, v: str) -> str:
    """Write that an aim is met, a little more strictly than the task asks."""
    field = task.plane if aim.attribute == "position" else aim.attribute
    mine = f"{v}↓{field}"
    match aim.to:
        case "goal":
            return f"‖{mine} − g({v})↓{field}‖ < {EXACT * aim.tolerance:.3g}"
        case "inside":
            letter = _letter(task, aim.of)
            if task.kind(aim.of).count == 1:
                return f"‖{mine} − {letter}↓{field}‖ < {0.8 * aim.value:.3g}"
            return f"∃{letter}':{aim.of}. ‖{mine} − {letter}'↓{field}‖ < {0.8 * aim.value:.3g}"
        case "below":
            return f"{mine} < {0.8 * aim.value:.3g}"
        case "right of":
            return f"{v}↓{task.plane[0]} > {aim.value + 0.005:.3g}"
        case "risen":
            return f"{mine} − {v}↓initial_{field} > {1.05 * aim.value:.3g}"
        case _:
            return f"{mine} > {min(1.05 * aim.value, 0.97 * TRAVEL.get(aim.attribute, aim.value * 2)):.3g}"
