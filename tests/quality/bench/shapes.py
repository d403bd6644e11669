"""Short names for what many tasks share."""

from __future__ import annotations

from dataclasses import replace

from tests.quality.bench.data import Aim, Kind, Phase

TURN = Aim("angle")
TILT = Aim("tilt")
PLACE = Aim("position")
EXTEND = Aim("extension")
PRESS = Aim("pressed", "above", 0.5)
OPENED = Aim("extension", "above", 0.15)
CLOSED = Aim("extension", "below", 0.06)
TURNED = Aim("angle", "above", 0.9)

BLOCKS = Kind("block", 3)
TOWER = Kind("block", 3, goals="stack")
TURNABLE = Kind("block", turned=("angle",), goal=("position", "angle"))
PUSHED = Kind("block", moves="pushed")
BUTTON = Kind("button", moves="pressed", goal=())
DRAWER = Kind("drawer", moves="slides", goal=("extension",))
BARE_DRAWER = Kind("drawer", moves="slides", goal=())
FAUCET = Kind("faucet", moves="turns", goal=("angle",))
BARE_FAUCET = Kind("faucet", moves="turns", goal=())
MUG = Kind("mug")
BARE_MUG = Kind("mug", goal=())
COASTER = Kind("coaster", moves="fixed", goal=())
LEFT, MIDDLE, RIGHT = (Kind(name, moves="fixed", goal=()) for name in ("left", "middle", "right"))
SCALE = Kind("scale", moves="fixed", goal=(), constants=("weight",))
LAMP = Kind("lamp", moves="fixed", goal=(), constants=("lit",))

SERVE_BLOCKS = Phase("block")
BUILD = Phase("block", order="goal z")
PULL = Phase("drawer", (EXTEND,))
OPEN = Phase("drawer", (OPENED,))
PUSH_BUTTON = Phase("button", (PRESS,))
TURN_FAUCET = Phase("faucet", (TURN,))
MUG_ON_COASTER = Phase("mug", (Aim("position", "inside", 0.06, "coaster"),))
INTO_LEFT, INTO_MIDDLE, INTO_RIGHT = (
    Phase("block", (Aim("position", "inside", 0.1, tray.name),)) for tray in (LEFT, MIDDLE, RIGHT)
)
BY_COLOUR = (replace(INTO_LEFT, only="colour < 0.5"), replace(INTO_RIGHT, only="colour > 0.5"))
