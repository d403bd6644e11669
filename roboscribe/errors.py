"""Errors a user may meet. Every message says what, where, found and expected."""

from __future__ import annotations

from dataclasses import dataclass


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
