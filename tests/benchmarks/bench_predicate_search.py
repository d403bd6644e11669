"""Seconds of one LEARNCLASSIFIER over ten thousand failing states, and its share per two hundred expressions.

    python -m tests.benchmarks.bench_predicate_search

Demonstrations are those of the tower tasks; failing states come from random actions. Processor time, so that other
programs hardly matter.
"""

from __future__ import annotations

import sys
from time import process_time

import numpy as np

from roboscribe import classifier
from roboscribe.envs.catalogue import make_task
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.search.features import enumerate_features
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.world.layout import FloatArray
from roboscribe.world.task import Task

STATES, EXPRESSIONS = 10_000, 200
WORLDS = 64
TASKS = ("pick-place-1", "tower-3", "tower-5")


def failing_states(task: Task) -> FloatArray:
    """Act at random in many worlds at once until there are enough states (STATES, F)."""
    world, rows, rng = task.world(WORLDS), np.arange(WORLDS), np.random.default_rng(0)
    states = [world.reset(rows, rows).copy()]
    while len(states) * WORLDS < STATES:
        states.append(world.step(rows, rng.uniform(-1.0, 1.0, (WORLDS, task.action_size))).copy())
    return np.concatenate(states)[:STATES]


def measure(name: str) -> str:
    """Learn one predicate; return a row of the table."""
    task = make_task(name)
    evidence, negatives = Evidence.of(task.demonstrate(50, 0), task.solved), failing_states(task)
    expressions = len(enumerate_features(evidence.layout, list(evidence.types)))
    start = process_time()
    found = classifier.learn_classifier(negatives, evidence, Tree(), ROOT)
    seconds = process_time() - start
    best = found.reason if isinstance(found, Fail) else found.node.predicate
    frames = len(evidence.states)
    return f"{name:14}{expressions:12}{frames:8}{seconds:9.2f}{seconds * EXPRESSIONS / expressions:9.2f}  {best}\n"


def main() -> None:
    """Print the table."""
    classifier.MOST_NEGATIVES = STATES  # the learner thins them out; here all count
    sys.stdout.write(f"{'task':14}{'expressions':>12}{'frames':>8}{'seconds':>9}{'per 200':>9}  predicate\n")
    for name in TASKS:
        sys.stdout.write(measure(name))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
