"""Candidates per second of the loop-guard search beside a plain interpreter on the same candidates, and its growth.

    python -m tests.benchmarks.bench_guard_search

Both see the examples that demonstrations of a tower give. The search judges every conjunction of up to three literals;
the interpreter walks the syntax of a sample of the same conjunctions, example by example, as one would write it first.
Their truth tables are compared bit by bit. Processor time, so that other programs hardly matter.
"""

from __future__ import annotations

import sys
from math import atan2, hypot
from time import process_time
from typing import assert_never

import numpy as np

from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.rewrite import conjunction
from roboscribe.dsl.syntax import (
    And,
    Arctan2,
    Const,
    Diff,
    Exists,
    Goal,
    Greater,
    Less,
    Norm,
    Not,
    NotNull,
    Or,
    Predicate,
    Proj,
    Robot,
    Solved,
    Term,
    Truth,
)
from roboscribe.envs.point_world import PointTask
from roboscribe.evidence import Evidence
from roboscribe.loop_guard import Examples, guard_atoms, loop_examples
from roboscribe.search.topdown import Atoms, enumerate_conjunctions, literals
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree
from roboscribe.world.layout import ROBOT, BoolArray, FloatArray, Layout

EPISODES = 20
SAMPLE = 6
SIZES = ((5, 1_000), (5, 3_000), (5, 10_000), (5, 30_000), (3, 10_000), (4, 10_000), (6, 10_000), (7, 10_000))
"""Objects and examples."""
TOLERANCE = 0.02
AT = Node("at", parse_predicate("‖b1↓xz − g(b1)↓xz‖ < 0.04"), circular=True)
HOLD = Node("hold", parse_predicate("‖μ↓xz − b1↓xz‖ < 0.02"))
TREE = Tree((*Tree().nodes, HOLD, AT), ((TRUE, "hold"), ("hold", "at"), ("at", ROOT)))


def value(term: Term, row: FloatArray, names: dict[str, int], layout: Layout) -> list[float]:
    """Evaluate a term in one state."""
    match term:
        case Const(number):
            return [number]
        case Norm(of):
            return [hypot(*value(of, row, names, layout))]
        case Arctan2(of):
            x, y = value(of, row, names, layout)
            return [atan2(y, x)]
        case Diff(left, right):
            pairs = zip(value(left, row, names, layout), value(right, row, names, layout), strict=True)
            return [a - b for a, b in pairs]
        case Proj(owner, field):
            goal = isinstance(owner, Goal)
            owner = owner.of if isinstance(owner, Goal) else owner
            index = ROBOT if isinstance(owner, Robot) else names[owner.name]
            found = layout.type_of(index).find(field, goal)
            if found is None:
                raise ValueError(field)
            start = layout.columns[index, found[0].name, goal].start
            return [float(row[start + i]) for i in found[1]]
        case _:
            assert_never(term)


def true(p: Predicate, row: FloatArray, names: dict[str, int], layout: Layout) -> bool:
    """Decide a predicate in one state."""
    match p:
        case Less(left, right):
            return value(left, row, names, layout)[0] < value(right, row, names, layout)[0]
        case Greater(left, right):
            return value(left, row, names, layout)[0] > value(right, row, names, layout)[0]
        case Not(of):
            return not true(of, row, names, layout)
        case And(left, right):
            return true(left, row, names, layout) and true(right, row, names, layout)
        case Or(left, right):
            return true(left, row, names, layout) or true(right, row, names, layout)
        case Exists(var, kind, body):
            return any(true(body, row, {**names, var.name: e}, layout) for e in layout.of_type(kind))
        case Truth():
            return True
        case NotNull() | Solved():
            raise ValueError(p)
        case _:
            assert_never(p)


def sample(atoms: Atoms) -> list[tuple[Predicate, BoolArray]]:
    """Draw conjunctions of one to three literals, with the table (X,) that the search gives them."""
    rng = np.random.default_rng(0)
    table = literals(atoms)
    drawn = [rng.choice(len(table), size=1 + i % 3, replace=False) for i in range(SAMPLE)]
    return [
        (conjunction([table[i].predicate for i in chosen]), np.all([table[i].truth for i in chosen], axis=0))
        for chosen in drawn
    ]


def plain(candidates: list[tuple[Predicate, BoolArray]], examples: Examples, layout: Layout) -> float:
    """Interpret candidates on every example; returns candidates per second.

    Raises:
        RuntimeError: a truth table differs from the search's.
    """
    start = process_time()
    for predicate, table in candidates:
        pairs = zip(examples.states, examples.entities.tolist(), strict=True)
        slow = [true(predicate, row, {"b1": entity}, layout) for row, entity in pairs]
        if not np.array_equal(slow, table):
            msg = f"{predicate}: the tables differ in {int(np.sum(slow != table))} of {len(table)} examples"
            raise RuntimeError(msg)
    return len(candidates) / (process_time() - start)


def measure(objects: int, count: int) -> str:
    """Search, and interpret a sample, for a tower of `objects` on `count` examples; returns a line of the table."""
    task = PointTask(f"point-tower-{objects}", ("block",) * objects, goals="stack", order="height", horizon=600)
    evidence = Evidence.of(task.demonstrate(EPISODES, 0), task.solved)
    examples = loop_examples(evidence, AT.predicate, "b1", np.zeros(EPISODES, np.int64))
    examples = examples[np.linspace(0, len(examples.entities) - 1, count).astype(np.int64)]
    start = process_time()
    atoms = guard_atoms(examples, evidence, "b1", (AT.predicate,))
    tabulated = process_time()
    found = enumerate_conjunctions(atoms, examples.positive, TOLERANCE)
    asked = process_time()
    # Without positive examples no literal rejects any, so all stay in play and the whole space is judged.
    everything = enumerate_conjunctions(atoms, np.zeros_like(examples.positive), 0.0)
    done = process_time()
    slow = plain(sample(atoms), examples, task.layout)
    fast = everything.candidates / (done - asked)
    return (
        f"{objects:8}{count:10,}{tabulated - start:9.2f}{asked - tabulated:9.2f}{everything.candidates:14,}"
        f"{fast:14,.0f}{slow:14,.2f}  {found.best}\n"
    )


def main() -> None:
    """Print the table."""
    out = sys.stdout.write
    out(f"Loop guard of a tower, one processor; truth tables of {SAMPLE} candidates a row compared bit by bit\n")
    out(f"{'objects':>8}{'examples':>10}{'atoms s':>9}{'guard s':>9}{'candidates':>14}")
    out(f"{'search /s':>14}{'plain /s':>14}  guard\n")
    for objects, count in SIZES:
        out(measure(objects, count))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
