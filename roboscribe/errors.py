"""Errors a user may meet. Every message says what, where, found and expected."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches


class RoboScribeError(Exception):
    """Base of every error caused by input; the command line prints it as one line and exits with 2."""


class DemonstrationError(RoboScribeError):
    """A demonstration file, episode, frame or column that cannot be used."""


class ProgramError(RoboScribeError):
    """Program text that does not parse or does not type-check."""


class ArtifactError(RoboScribeError):
    """A saved program, controller, checkpoint or manifest that cannot be trusted."""


class TaskError(RoboScribeError):
    """An unknown task name or a task option out of range."""


@dataclass(frozen=True)
class Fail:
    """Synthesis ended without a program: an expected outcome, therefore a value (exit code 3)."""

    reason: str


def expected(name: str, value: float, least: float, most: float | None = None) -> None:
    """Refuse a setting that is out of range.

    Raises:
        TaskError: it is less than `least`, or more than `most` where that is given.
    """
    if value < least or (most is not None and value > most):
        span = f"at least {least:g}" if most is None else f"{least:g} to {most:g}"
        msg = f"{name}: found {value:g}, expected {span}"
        raise TaskError(msg)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint for a name that is not known, "did you mean tower-5? " for instance; empty where none is near."""
    near = get_close_matches(name, list(known), n=1)
    return f"did you mean {near[0]}? " if near else ""
