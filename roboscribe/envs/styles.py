"""Styles in which demonstrations are given: fast or slow, from straight above, with pauses, detours or clumsy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from roboscribe.errors import TaskError

DEFAULT, MIXED = "default", "mixed"


@dataclass(frozen=True)
class Style:
    """How a demonstration is given.

    Args:
        speed: factor on commanded displacements; above 1, full speed is kept for longer.
        noise: factor on the noise.
        above: cross well above everything, and come down vertically.
        pauses: chance that a step begins a pause.
        detours: chance that the way to a block, or with it to its goal, leads over a random way-point.
        misses: chance that the fingers close before the hand has come down on a block.
        drops: chance that a block slips out of the fingers after it was lifted.
        after: states in a row in which the task has been solved when an episode ends.
        patience: length at which an episode is given up, in horizons of the task.
    """

    speed: float = 1.0
    noise: float = 1.0
    above: bool = False
    pauses: float = 0.0
    detours: float = 0.0
    misses: float = 0.0
    drops: float = 0.0
    after: int = 10
    patience: float = 1.0


STYLES = {
    DEFAULT: Style(),
    "brisk": Style(speed=2.0, noise=0.3),
    "slow": Style(speed=1 / 3, noise=1 / 3, patience=4.0),
    "topdown": Style(noise=0.5, above=True, patience=2.0),
    "pauses": Style(pauses=0.1, patience=4.0),
    "detours": Style(detours=0.7, patience=4.0),
    "clumsy": Style(misses=0.5, drops=0.5, patience=4.0),
    "stop": Style(after=1, patience=1.5),
    "linger": Style(after=40, patience=1.5),
}
"""Styles by name. `MIXED` is one of them in every episode."""


def style_names() -> tuple[str, ...]:
    """List the names that `choices` knows."""
    return (*STYLES, MIXED)


def choices(name: str, known: Sequence[str] = tuple(STYLES)) -> tuple[Style, ...]:
    """Return the styles of which every episode draws one.

    Args:
        name: one of `style_names()`.
        known: styles in which the task can be shown.

    Raises:
        TaskError: an unknown name.
    """
    if name == MIXED:
        return tuple(style for other, style in STYLES.items() if other in known)
    if name not in STYLES or name not in known:
        msg = f"unknown style {name!r}: expected one of {', '.join((*known, MIXED))}"
        raise TaskError(msg)
    return (STYLES[name],)
