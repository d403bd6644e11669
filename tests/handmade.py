"""Demonstrations drawn with a ruler: a hand goes straight to an object and takes it straight to its goal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from roboscribe.dsl.parser import parse_predicate
from roboscribe.envs.point_world import PointTask
from roboscribe.evidence import Evidence
from roboscribe.subtask_tree import ROOT, TRUE, Node, Tree
from roboscribe.world.layout import ROBOT, FloatArray, Layout
from roboscribe.world.trajectory import Trajectory

Order = Callable[[FloatArray], Sequence[int]]
"""From the objects' goals (N, 2) to the order in which they are taken there."""

HOLD = "‖μ↓xz − {0}↓xz‖ < 0.01"
AT = "‖{0}↓xz − g({0})↓xz‖ < 0.05"


def bottom_up(goals: FloatArray) -> Sequence[int]:
    """Take the lowest goal first."""
    return [int(i) for i in np.argsort(goals[:, 1])]


def top_down(goals: FloatArray) -> Sequence[int]:
    """Take the highest goal first."""
    return bottom_up(goals)[::-1]


def state(layout: Layout, hand: FloatArray, places: FloatArray, goals: FloatArray) -> FloatArray:
    """Write one state (F,) from positions (2,), (N, 2) and (N, 2)."""
    row = np.zeros(layout.size)
    row[layout.columns[ROBOT, "position", False]] = hand
    for i, (place, goal) in enumerate(zip(places, goals, strict=True)):
        row[layout.columns[i, "position", False]] = place
        row[layout.columns[i, "position", True]] = goal
    return row


Choice = Callable[[FloatArray, FloatArray, FloatArray, list[int]], int]
"""From hand (2,), places (N, 2), goals (N, 2) and the entities that are left to the one to take next."""


def nearest_first(hand: FloatArray, places: FloatArray, goals: FloatArray, left: list[int]) -> int:
    """Choose what is nearest to the hand, for `legs`."""
    return min(left, key=lambda i: float(np.linalg.norm(places[i] - hand)))


def legs(
    layout: Layout, hand: FloatArray, places: FloatArray, goals: FloatArray, choose: Choice, steps: int = 12
) -> FloatArray:
    """Draw the states (T, F) of a hand that takes one object after the other to its goal, `steps` frames a leg.

    Objects that lie at their goals are left there.
    """
    places, rows = places.copy(), [state(layout, hand, places, goals)]
    left = [i for i in range(len(goals)) if not np.array_equal(places[i], goals[i])]
    while left:
        i = choose(hand, places, goals, left)
        if i < 0:
            break
        left.remove(i)
        for ends, held in (((hand, places[i].copy()), False), ((places[i].copy(), goals[i]), True)):
            for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
                hand = ends[0] + part * (ends[1] - ends[0])
                places[i] = hand if held else places[i]
                rows.append(state(layout, hand, places, goals))
    return np.stack(rows)


def carry(
    task: PointTask,
    rng: np.random.Generator,
    order: Order,
    steps: int = 12,
    levels: Sequence[int] | None = None,
    *,
    placed: Sequence[int] = (),
) -> Trajectory:
    """Draw one demonstration: objects start left, goals lie right, a stack unless `levels` says otherwise.

    There are `steps` frames a leg; the objects `placed` lie at their goals from the start.
    """
    count = len(task.kinds)
    hand, places = rng.uniform(0.0, 1.0, 2), rng.uniform(0.0, 1.0, (count, 2))
    ranks: FloatArray = rng.permutation(np.asarray(levels or range(count), np.float64))
    goals = np.array([1.5, 0.0]) + ranks[:, None] * np.array([0.0, 0.2])
    if levels:
        goals[:, 0] += 0.2 * np.arange(count)
    for i in placed:
        places[i] = goals[i]
    queue = list(order(goals))

    def next_in_line(hand: FloatArray, places: FloatArray, goals: FloatArray, left: list[int]) -> int:
        return next((i for i in queue if i in left), -1)

    return Trajectory(task.layout, legs(task.layout, hand, places, goals, next_in_line, steps))


def evidence(
    task: PointTask,
    order: Order = bottom_up,
    episodes: int = 20,
    steps: int = 12,
    levels: Sequence[int] | None = None,
) -> Evidence:
    """Collect demonstrations."""
    rng = np.random.default_rng(0)
    return Evidence.of([carry(task, rng, order, steps, levels) for _ in range(episodes)], task.solved)


def node(name: str, text: str, *entities: str, circular: bool = False) -> Node:
    """Build a node from text with a place for each entity."""
    return Node(name, parse_predicate(text.format(*entities)), circular)


def chain(*nodes: Node) -> Tree:
    """Build the tree True ~> ... ~> ψ_R of one path."""
    names = [TRUE, *(n.name for n in nodes), ROOT]
    return Tree((*Tree().nodes, *nodes), tuple(pairwise(names)))
