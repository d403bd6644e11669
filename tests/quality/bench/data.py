"""The words in which a task is written: kinds of objects, what is to be done to them, and how it is shown."""

from __future__ import annotations

from dataclasses import dataclass

MOVES = ("grasped", "pushed", "slides", "turns", "pressed", "fixed")
"""Dynamics of a kind, see `Kind.moves`."""
JOINTS = {"slides": "extension", "turns": "angle", "pressed": "pressed"}
"""The scalar that the hand changes, by dynamics."""
UNITS = {"extension": "m", "depth": "m", "angle": "rad", "tilt": "rad", "size": "m"}
"""Unit of each scalar attribute; "1" where it is not listed."""
TOLERANCES = {"position": 0.03, "extension": 0.02, "depth": 0.02, "angle": 0.1, "tilt": 0.1}
"""How near its goal an attribute has to come, metres or radians."""


@dataclass(frozen=True)
class Kind:
    """A type of objects.

    Args:
        name: what the type is called.
        count: how many there are.
        moves: "grasped" dragged by closed fingers; "pushed" by a hand without fingers; "slides" along an axis by its
            handle; "turns" about a hinge by its handle; "pressed" for good by fingers that close on it; "fixed".
        turned: angles about which a held object is turned, each by an action of its own.
        joint: the scalar that changes; by default that of `JOINTS`.
        axis: along which a sliding joint goes.
        goal: attributes for which a goal is given.
        goals: how goals of positions are drawn: "free", "stack" (one above the other, levels dealt out at random over
            all kinds), "row", "rides" (in `inside`, and moving with it).
        inside: the container that the object moves along with once it lies there.
        level: in the stack, kinds of a higher level lie above those of a lower one.
        placed: share of the objects that lie at their goals from the start.
        served: how many objects lie at their goals from the start in every episode.
        start: "scattered" or "line".
        constants: attributes that never change: "weight", "size" (one in each part of their range), "mass" (anywhere in
            its range), "colour", "lit" (0 or 1).
        initial: whether the state says what the joint was at the start, as `initial_extension` or the like.
        locked_by: a kind whose first phase must be over before this one can be moved, and still be.
    """

    name: str
    count: int = 1
    moves: str = "grasped"
    turned: tuple[str, ...] = ()
    joint: str = ""
    axis: int = 0
    goal: tuple[str, ...] = ("position",)
    goals: str = "free"
    inside: str = ""
    level: int = 0
    placed: float = 0.0
    served: int = 0
    start: str = "scattered"
    constants: tuple[str, ...] = ()
    initial: bool = False
    locked_by: str = ""

    @property
    def scalar(self) -> str:
        """Name of the joint's scalar; empty for objects that are no joints."""
        return self.joint or JOINTS.get(self.moves, "")

    @property
    def loose(self) -> bool:
        """Whether the object moves about freely."""
        return self.moves in ("grasped", "pushed")


@dataclass(frozen=True)
class Aim:
    """What must become true of one attribute of an object.

    Args:
        attribute: which one.
        to: "goal" (within its tolerance), "above" or "below" a value, "right of" it along the first axis, "risen" by a
            value since the start, or "inside" a container, within `value` of the position of the nearest one.
        value: of all but the first.
        of: the container's kind.
    """

    attribute: str = "position"
    to: str = "goal"
    value: float = 0.0
    of: str = ""

    @property
    def tolerance(self) -> float:
        """How near to its goal the attribute has to be."""
        return TOLERANCES.get(self.attribute, 0.1)


@dataclass(frozen=True)
class Phase:
    """A part of the script: every object of a kind is served, one after the other.

    Args:
        kind: whom it is about.
        aims: what is done to each, in this order.
        order: who comes first: "any"; the nearest to the "hand" at each choice; or the least "goal z", "x", "weight"
            and the like; after a minus sign the greatest.
        only: leaves out the others: "colour < 0.5", "colour > 0.3 and colour < 0.7", or "weight < scale.weight" of
            another kind, "mass is greatest" and "mass not greatest" of its own.
        passing: what it achieves need not last to the end.
        shape: "loop" or "straight" or "either"; by default a loop where there are several objects.
        free: any order of the objects is right, though the demonstrations may seem to show one.
    """

    kind: str
    aims: tuple[Aim, ...] = (Aim(),)
    order: str = "any"
    only: str = ""
    passing: bool = False
    shape: str = ""
    free: bool = False

    @property
    def bounds(self) -> tuple[str, ...]:
        """What `only` asks for, one comparison each."""
        return tuple(self.only.split(" and ")) if self.only else ()


@dataclass(frozen=True)
class Style:
    """How a demonstrator moves.

    Args:
        speed: greatest share of the hand's full speed.
        pause: chance per step of standing still for a while.
        detour: chance of going round by a random place, on the way to an object and on the way to its goal.
        drop: chance per step of losing what it carries.
        above: whether objects are approached, and goals reached, from above.
    """

    speed: float = 1.0
    pause: float = 0.0
    detour: float = 0.0
    drop: float = 0.0
    above: bool = False


STYLES = {
    "brisk": Style(),
    "slow": Style(speed=1 / 3),
    "pauses": Style(pause=0.05),
    "detours": Style(detour=0.6),
    "clumsy": Style(drop=0.04),
    "topdown": Style(above=True),
}
"""Styles by name; "mixed" is any of them."""
