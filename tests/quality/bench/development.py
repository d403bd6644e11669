"""Tasks to develop with. Those that were set aside are in `held_out`."""

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
    BY_COLOUR,
    CLOSED,
    COASTER,
    DRAWER,
    EXTEND,
    FAUCET,
    INTO_LEFT,
    INTO_MIDDLE,
    INTO_RIGHT,
    LAMP,
    LEFT,
    MIDDLE,
    MUG,
    MUG_ON_COASTER,
    OPEN,
    PLACE,
    PULL,
    PUSH_BUTTON,
    PUSHED,
    RIGHT,
    SCALE,
    SERVE_BLOCKS,
    TILT,
    TOWER,
    TURN,
    TURN_FAUCET,
    TURNABLE,
)
from tests.quality.bench.task import KinematicTask

TASKS: tuple[KinematicTask, ...] = (
    # place: free goals, any order
    KinematicTask("place-one", "place", (Kind("block"),), (SERVE_BLOCKS,)),
    KinematicTask("place-two", "place", (Kind("block", 2),), (SERVE_BLOCKS,)),
    KinematicTask("place-three-in-space", "place", (BLOCKS,), (SERVE_BLOCKS,), plane="xyz"),
    # all of one kind, then all of another
    KinematicTask(
        "apples-then-bricks",
        "kinds in turn",
        (Kind("apple", 2), Kind("brick", 2)),
        (Phase("apple"), Phase("brick")),
    ),
    # pushing
    KinematicTask("push-one", "push", (PUSHED,), (SERVE_BLOCKS,), plane="xy"),
    KinematicTask("push-three", "push", (replace(PUSHED, count=3),), (SERVE_BLOCKS,), plane="xy"),
    # some are served already
    KinematicTask("some-placed", "served at the start", (replace(BLOCKS, placed=0.3),), (SERVE_BLOCKS,)),
    # two attributes of one object
    KinematicTask("turn-place-one", "two attributes", (TURNABLE,), (Phase("block", (TURN, PLACE)),)),
    KinematicTask(
        "turn-place-three", "two attributes", (replace(TURNABLE, count=3),), (Phase("block", (TURN, PLACE)),)
    ),
    KinematicTask("place-turn-one", "two attributes", (TURNABLE,), (Phase("block", (PLACE, TURN)),)),
    # drawers
    KinematicTask("drawer-cubes", "drawer", (DRAWER, Kind("cube", 3)), (PULL, Phase("cube"))),
    KinematicTask(
        "drawer-cubes-ride",
        "drawer",
        (DRAWER, Kind("cube", 3, goals="rides", inside="drawer")),
        (PULL, Phase("cube")),
    ),
    KinematicTask(
        "drawer-cubes-inside",
        "drawer",
        (BARE_DRAWER, Kind("cube", 2, goal=(), inside="drawer")),
        (OPEN, Phase("cube", (Aim("position", "inside", 0.1, "drawer"),))),
        plane="xy",
    ),
    KinematicTask(
        "drawer-closed-again",
        "drawer",
        (BARE_DRAWER, Kind("cube", 2, goals="rides", inside="drawer", locked_by="drawer")),
        (replace(OPEN, passing=True), Phase("cube"), Phase("drawer", (CLOSED,))),
    ),
    # mug, drawer, faucet
    KinematicTask(
        "mug-drawer-faucet",
        "mug, drawer, faucet",
        (MUG, DRAWER, FAUCET),
        (Phase("mug"), PULL, TURN_FAUCET),
    ),
    KinematicTask(
        "mug-drawer-faucet-initial",
        "mug, drawer, faucet",
        (BARE_MUG, COASTER, replace(BARE_DRAWER, initial=True), replace(BARE_FAUCET, initial=True)),
        (
            MUG_ON_COASTER,
            Phase("drawer", (Aim("extension", "risen", 0.12),)),
            Phase("faucet", (Aim("angle", "risen", 0.8),)),
        ),
    ),
    KinematicTask(
        "mug-drawer-faucet-slow",
        "slow",
        (MUG, DRAWER, FAUCET),
        (Phase("mug"), PULL, TURN_FAUCET),
        style="slow",
    ),
    # independent branches
    KinematicTask(
        "two-in-any-order",
        "any order",
        (MUG, DRAWER),
        (Phase("mug"), PULL),
        phase_order="random",
    ),
    KinematicTask(
        "three-in-any-order",
        "any order",
        (MUG, DRAWER, FAUCET),
        (Phase("mug"), PULL, TURN_FAUCET),
        phase_order="random",
    ),
    # conditions
    KinematicTask(
        "peg-cube-by-height",
        "conditions",
        (Kind("peg", goals="stack"), Kind("cube", goals="stack")),
        (Phase("peg"), Phase("cube")),
        phase_order="goal z",
    ),
    KinematicTask(
        "three-kinds-by-height",
        "conditions",
        (Kind("peg", goals="stack"), Kind("cube", goals="stack"), Kind("ring", goals="stack")),
        (Phase("peg"), Phase("cube"), Phase("ring")),
        phase_order="goal z",
    ),
    # loops in an order of their own
    KinematicTask("by-weight", "order", (replace(BLOCKS, constants=("weight",)),), (Phase("block", order="weight"),)),
    KinematicTask("biggest-first", "order", (replace(BLOCKS, constants=("size",)),), (Phase("block", order="-size"),)),
    KinematicTask("from-left-to-right", "order", (BLOCKS,), (Phase("block", order="x"),)),
    KinematicTask("nearest-to-the-hand", "order", (BLOCKS,), (Phase("block", order="hand"),)),
    # demonstrations that fail
    KinematicTask("place-one-in-ten-fails", "failing", (BLOCKS,), (SERVE_BLOCKS,), failing=0.1),
    KinematicTask("tower-one-in-five-fails", "failing", (TOWER,), (BUILD,), failing=0.2),
    KinematicTask("drawer-one-in-ten-fails", "failing", (DRAWER, MUG), (PULL, Phase("mug")), failing=0.1),
    # few demonstrations
    KinematicTask("place-from-two", "few", (BLOCKS,), (replace(SERVE_BLOCKS, free=True),), demos=2),
    KinematicTask("place-from-five", "few", (BLOCKS,), (replace(SERVE_BLOCKS, free=True),), demos=5),
    KinematicTask("tower-from-five", "few", (TOWER,), (BUILD,), demos=5),
    # a loop among single steps
    KinematicTask("button-then-loop", "loop and steps", (BUTTON, BLOCKS), (PUSH_BUTTON, SERVE_BLOCKS)),
    KinematicTask("loop-then-button", "loop and steps", (BUTTON, BLOCKS), (SERVE_BLOCKS, PUSH_BUTTON)),
    KinematicTask(
        "loop-loop-button",
        "loop and steps",
        (Kind("apple", 2), Kind("brick", 2), BUTTON),
        (Phase("apple"), Phase("brick"), PUSH_BUTTON),
    ),
    # styles
    KinematicTask("place-clumsy", "styles", (BLOCKS,), (SERVE_BLOCKS,), style="clumsy"),
    KinematicTask("tower-slow", "slow", (TOWER,), (BUILD,), style="slow"),
    KinematicTask("tower-mixed", "styles", (TOWER,), (BUILD,), style="mixed"),
    KinematicTask("tower-stop-at-once", "styles", (TOWER,), (BUILD,), stay=0),
    KinematicTask("place-pauses", "styles", (BLOCKS,), (SERVE_BLOCKS,), style="pauses"),
    # clutter
    KinematicTask("clutter-of-another-kind", "clutter", (BLOCKS, Kind("can", 3, goal=())), (SERVE_BLOCKS,)),
    KinematicTask("clutter-of-the-same-kind", "clutter", (Kind("block", 4, served=2),), (SERVE_BLOCKS,)),
    KinematicTask(
        "clutter-all-but-one", "clutter", (Kind("block", 3, served=2),), (replace(SERVE_BLOCKS, shape="either"),)
    ),
    # towers
    KinematicTask("tower", "tower", (TOWER,), (BUILD,)),
    KinematicTask("tower-hand-away", "tower", (TOWER,), (BUILD,), away=0.2),
    KinematicTask("place-one-hand-away", "leaving", (Kind("block"),), (SERVE_BLOCKS,), away=0.2),
    KinematicTask("faucet-hand-away", "leaving", (FAUCET,), (TURN_FAUCET,), away=0.2),
    KinematicTask("button-hand-away", "leaving", (BUTTON,), (PUSH_BUTTON,), away=0.2),
    KinematicTask("drawer-hand-away", "leaving", (BARE_DRAWER,), (OPEN,), away=0.2),
    # our own
    KinematicTask(
        "three-attributes",
        "own",
        (Kind("block", turned=("angle", "tilt"), goal=("position", "angle", "tilt")),),
        (Phase("block", (TURN, TILT, PLACE)),),
    ),
    KinematicTask(
        "key-door-loop",
        "own",
        (
            Kind("key"),
            Kind("door", moves="slides", goal=("extension",), locked_by="key"),
            Kind("block", 2, locked_by="door"),
        ),
        (Phase("key"), Phase("door", (EXTEND,)), SERVE_BLOCKS),
    ),
    KinematicTask(
        "sort-by-colour",
        "own",
        (
            LEFT,
            RIGHT,
            Kind("block", 4, goal=(), constants=("colour",)),
        ),
        BY_COLOUR,
    ),
    KinematicTask(
        "sort-into-three",
        "own",
        (
            LEFT,
            MIDDLE,
            RIGHT,
            Kind("block", 4, goal=(), constants=("weight",)),
        ),
        (
            replace(INTO_LEFT, only="weight < 0.5"),
            replace(INTO_MIDDLE, only="weight > 0.5 and weight < 1.5"),
            replace(INTO_RIGHT, only="weight > 1.5"),
        ),
    ),
    KinematicTask(
        "sort-into-three-clumsy",
        "own",
        (LEFT, MIDDLE, RIGHT, Kind("block", 4, goal=(), constants=("weight",))),
        (
            replace(INTO_LEFT, only="weight > 1.4"),
            replace(INTO_MIDDLE, only="weight < 1.4 and weight > 0.6"),
            replace(INTO_RIGHT, only="weight < 0.6"),
        ),
        style="clumsy",
    ),
    KinematicTask(
        "clear-the-left-side",
        "own",
        (Kind("block", 4, goal=()),),
        (Phase("block", (Aim("position", "right of", 0.7),)),),
        plane="xy",
    ),
    KinematicTask(
        "each-into-any-bin",
        "own",
        (Kind("bin", 2, moves="fixed", goal=()), Kind("block", 3, goal=())),
        (Phase("block", (Aim("position", "inside", 0.1, "bin"),)),),
    ),
    KinematicTask(
        "lighter-than-the-scale",
        "conditions",
        (LEFT, RIGHT, SCALE, Kind("block", goal=(), constants=("weight",))),
        (replace(INTO_LEFT, only="weight < scale.weight"), replace(INTO_RIGHT, only="weight > scale.weight")),
    ),
    KinematicTask(
        "heaviest-to-the-left",
        "own",
        (LEFT, Kind("block", 3, constants=("mass",))),
        (replace(INTO_LEFT, only="mass is greatest"), replace(SERVE_BLOCKS, only="mass not greatest")),
    ),
    KinematicTask(
        "left-or-right",
        "conditions",
        (
            LEFT,
            RIGHT,
            Kind("block", goal=(), constants=("colour",)),
        ),
        BY_COLOUR,
    ),
    KinematicTask(
        "button-drawer-faucet-readings",
        "mug, drawer, faucet",
        (BUTTON, BARE_DRAWER, BARE_FAUCET),
        (PUSH_BUTTON, OPEN, Phase("faucet", (Aim("angle", "above", 0.9),))),
    ),
    KinematicTask(
        "button-then-by-height",
        "conditions",
        (BUTTON, Kind("peg", goals="stack"), Kind("cube", goals="stack")),
        (PUSH_BUTTON, Phase("peg"), Phase("cube")),
        phase_order="goal z",
        first=1,
    ),
    KinematicTask("tower-in-space", "tower", (TOWER,), (BUILD,), plane="xyz"),
    KinematicTask(
        "plunger-then-loop",
        "loop and steps",
        (Kind("plunger", moves="slides", joint="depth", axis=-1, goal=()), Kind("block", 2)),
        (Phase("plunger", (Aim("depth", "above", 0.18),)), SERVE_BLOCKS),
        plane="xyz",
    ),
    KinematicTask(
        "line-to-row",
        "order",
        (Kind("block", 4, goals="row", start="line"),),
        (Phase("block", order="goal x"),),
    ),
    # once outside the bench, and not found there
    KinematicTask(
        "readings-in-any-order",
        "any order",
        (BUTTON, Kind("lever", moves="turns", goal=()), BARE_DRAWER),
        (PUSH_BUTTON, Phase("lever", (Aim("angle", "above", 0.9),)), OPEN),
        phase_order="random",
    ),
    KinematicTask(
        "two-towers",
        "tower",
        (Kind("apple", 2, goals="stack"), Kind("brick", 2, goals="stack", level=1)),
        (Phase("apple", order="goal z"), Phase("brick", order="goal z")),
    ),
    KinematicTask(
        "only-the-red-ones",
        "own",
        (Kind("block", 4, constants=("colour",)),),
        (Phase("block", only="colour > 0.5"),),
    ),
    KinematicTask(
        "button-then-nearest",
        "order",
        (BUTTON, BLOCKS),
        (PUSH_BUTTON, Phase("block", order="hand")),
    ),
    KinematicTask(
        "loop-then-farthest",
        "order",
        (Kind("apple", 2), Kind("brick", 3)),
        (Phase("apple"), Phase("brick", order="-hand")),
    ),
    KinematicTask(
        "light-left-heavy-right",
        "conditions",
        (LEFT, RIGHT, Kind("block", goal=(), constants=("weight",))),
        (replace(INTO_LEFT, only="weight < 1.0"), replace(INTO_RIGHT, only="weight > 1.0")),
    ),
    KinematicTask("two-by-a-lamp", "conditions", (LAMP, MUG, DRAWER), (Phase("mug"), PULL), phase_order="lamp lit"),
    KinematicTask(
        "three-by-a-lamp",
        "conditions",
        (LAMP, MUG, DRAWER, FAUCET),
        (Phase("mug"), PULL, TURN_FAUCET),
        phase_order="lamp lit",
    ),
)
