"""Tasks that were set aside before any task was run: nobody looks at them while the learner is written."""

from __future__ import annotations

from dataclasses import replace

from tests.quality.bench.data import Aim, Kind, Phase
from tests.quality.bench.shapes import (
    BARE_DRAWER,
    BARE_FAUCET,
    BARE_MUG,
    BLOCKS,
    BUILD,
    BUTTON,
    COASTER,
    DRAWER,
    FAUCET,
    MUG,
    MUG_ON_COASTER,
    OPEN,
    PLACE,
    PULL,
    PUSH_BUTTON,
    PUSHED,
    SERVE_BLOCKS,
    TOWER,
    TURN,
    TURN_FAUCET,
    TURNABLE,
    TURNED,
)
from tests.quality.bench.task import KinematicTask

_TASKS = (
    KinematicTask("place-four", "place", (Kind("block", 4),), (SERVE_BLOCKS,), plane="xy"),
    KinematicTask(
        "bricks-then-apples-by-x",
        "kinds in turn",
        (Kind("apple", 3), Kind("brick", 2)),
        (Phase("brick"), Phase("apple", order="x")),
        plane="xy",
    ),
    KinematicTask("push-two", "push", (replace(PUSHED, count=2),), (SERVE_BLOCKS,), plane="xy"),
    KinematicTask("some-placed-tower", "served at the start", (replace(TOWER, placed=0.25),), (BUILD,)),
    KinematicTask(
        "place-turn-three",
        "two attributes",
        (replace(TURNABLE, count=3),),
        (Phase("block", (PLACE, TURN)),),
        plane="xy",
    ),
    KinematicTask(
        "bare-drawer-cubes-ride",
        "drawer",
        (BARE_DRAWER, Kind("cube", 3, goals="rides", inside="drawer")),
        (OPEN, Phase("cube")),
    ),
    KinematicTask(
        "mug-drawer-faucet-readings",
        "mug, drawer, faucet",
        (BARE_MUG, COASTER, BARE_DRAWER, BARE_FAUCET),
        (OPEN, MUG_ON_COASTER, Phase("faucet", (TURNED,))),
    ),
    KinematicTask(
        "two-loops-in-any-order",
        "any order",
        (Kind("apple", 2), Kind("brick", 2)),
        (Phase("apple"), Phase("brick")),
        phase_order="random",
    ),
    KinematicTask(
        "peg-cube-slow",
        "conditions",
        (Kind("peg", goals="stack"), Kind("cube", goals="stack")),
        (Phase("peg"), Phase("cube")),
        phase_order="goal z",
        style="slow",
    ),
    KinematicTask(
        "lamp-decides",
        "conditions",
        (Kind("lamp", moves="fixed", goal=(), constants=("lit",)), MUG, DRAWER),
        (Phase("mug"), PULL),
        phase_order="lamp lit",
    ),
    KinematicTask("farthest-goal-first", "order", (BLOCKS,), (Phase("block", order="-goal x"),)),
    KinematicTask(
        "heaviest-first",
        "order",
        (replace(BLOCKS, constants=("weight",)),),
        (Phase("block", order="-weight"),),
        plane="xy",
    ),
    KinematicTask("place-one-in-five-fails", "failing", (BLOCKS,), (SERVE_BLOCKS,), failing=0.2),
    KinematicTask("place-from-ten", "few", (BLOCKS,), (replace(SERVE_BLOCKS, free=True),), demos=10),
    KinematicTask("tower-from-ten", "few", (TOWER,), (BUILD,), demos=10),
    KinematicTask("button-loop-drawer", "loop and steps", (BUTTON, DRAWER, BLOCKS), (PUSH_BUTTON, SERVE_BLOCKS, PULL)),
    KinematicTask("tower-clumsy", "styles", (TOWER,), (BUILD,), style="clumsy"),
    KinematicTask("tower-linger-from-above", "styles", (TOWER,), (BUILD,), style="topdown", stay=15),
    KinematicTask("place-detours", "styles", (BLOCKS,), (SERVE_BLOCKS,), style="detours"),
    KinematicTask("drawer-cubes-slow", "slow", (DRAWER, Kind("cube", 2)), (PULL, Phase("cube")), style="slow"),
    KinematicTask("tower-among-cans", "clutter", (TOWER, Kind("can", 2, goal=())), (BUILD,)),
    KinematicTask(
        "tower-of-two-kinds",
        "tower",
        (Kind("apple", 2, goals="stack"), Kind("brick", 2, goals="stack", level=1)),
        (Phase("apple", order="goal z"), Phase("brick", order="goal z")),
    ),
    KinematicTask(
        "lid-off-then-cubes",
        "own",
        (Kind("lid"), Kind("cube", 2, locked_by="lid"), Kind("pot", moves="fixed", goal=())),
        (Phase("lid"), Phase("cube", (Aim("position"),), order="z")),
    ),
    KinematicTask(
        "button-then-two-in-any-order",
        "any order",
        (BUTTON, MUG, FAUCET),
        (PUSH_BUTTON, Phase("mug"), TURN_FAUCET),
        phase_order="random",
        first=1,
    ),
    KinematicTask(
        "turn-place-by-size",
        "order",
        (replace(TURNABLE, count=3, constants=("size",)),),
        (Phase("block", (TURN, PLACE), order="size"),),
    ),
)
TASKS: tuple[KinematicTask, ...] = tuple(replace(task, held_out=True) for task in _TASKS)
