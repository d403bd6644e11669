"""A run's event log as chapters: what was tried, what was learned from its failures, what was given up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias, assert_never

from roboscribe.dsl.printer import text
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.stages.runtime.events import (
    Abandoned,
    Evaluated,
    Failed,
    Filmed,
    Ingested,
    Loosened,
    Packaged,
    Programmed,
    Refined,
    Removed,
    Retrained,
    RolledOut,
    Trained,
)
from roboscribe.stages.tracking.event_log import EventLog, LoggedEvent
from roboscribe.subtask_tree import ROOT
from roboscribe.success_rate import wilson


@dataclass(frozen=True)
class SkillTraining:
    """How one controller was learned within an attempt.

    Args:
        report: what the learner said.
        curves: its figures over its control steps, by name.
    """

    report: Mapping[str, Any]
    curves: Mapping[str, list[list[float]]]


@dataclass(frozen=True)
class Attempt:
    """A program that was trained and tried.

    Args:
        goal: what it was to reach.
        program: the program.
        skills: what was learned for it.
        library: directory of its controllers; None where nothing was trained.
        counts: what trying it gave; empty where it was not tried.
        failing: number, seed, divergence and steps of each episode that failed.
        steps: control steps of the whole run when it had been tried.
    """

    goal: str
    program: Program
    skills: tuple[SkillTraining, ...] = ()
    library: Path | None = None
    counts: Mapping[str, Any] = field(default_factory=dict)
    failing: tuple[tuple[int, ...], ...] = ()
    steps: int = 0

    @property
    def rate(self) -> float:
        """Share of the episodes that reached the goal."""
        return int(self.counts["successes"]) / int(self.counts["episodes"])

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % Wilson interval."""
        return wilson(int(self.counts["successes"]), int(self.counts["episodes"]))

    @property
    def controllers(self) -> str:
        """Names of its controllers."""
        return " ".join(f"π_{run.controller}" for run in controllers(self.program))


@dataclass(frozen=True)
class Remark:
    """A decision, as a sentence."""

    said: str


Chapter: TypeAlias = Attempt | Refined | Remark


@dataclass(frozen=True)
class Chapters:
    """A run, chapter by chapter.

    Args:
        chapters: in the order in which they happened.
        demonstrations: what was said about the demonstrations.
        profile: what was learned from.
        evaluation: figures of the final evaluation; empty where there was none.
        failing: episodes of the final evaluation that failed.
        video: film of an episode of it.
    """

    read_chapters: tuple[Chapter, ...] = ()
    demonstrations: Mapping[str, Any] = field(default_factory=dict)
    profile: str = ""
    evaluation: Mapping[str, Any] = field(default_factory=dict)
    failing: tuple[tuple[int, ...], ...] = ()
    video: Path | None = None

    @property
    def tried(self) -> tuple[Attempt, ...]:
        """Attempts that were tried."""
        return tuple(each for each in self.read_chapters if isinstance(each, Attempt) and each.counts)

    @property
    def refinements(self) -> tuple[Refined, ...]:
        """Refinements in order."""
        return tuple(each for each in self.read_chapters if isinstance(each, Refined))

    @property
    def solving(self) -> tuple[Attempt, ...]:
        """Attempts at the task itself."""
        return tuple(each for each in self.tried if each.goal == ROOT)


def read_chapters(account: EventLog | None) -> Chapters:
    """Read an event log; without one there are no chapters.

    Raises:
        ArtifactError: it cannot be read.
    """
    reader = _Reader()
    for told in () if account is None else account.entries:
        reader.read(told)
    return Chapters(tuple(reader.read_chapters), **reader.found)


class _Reader:
    """Sorts events into chapters."""

    def __init__(self) -> None:
        self.read_chapters: list[Chapter] = []
        self.found: dict[str, Any] = {}
        self._steps = 0

    def read(self, told: LoggedEvent) -> None:
        event = told.event
        match event:
            case Ingested(report, profile):
                self.found |= {"demonstrations": report, "profile": profile}
            case Programmed(goal, program):
                self.read_chapters.append(Attempt(goal, program))
            case Trained():
                self._latest(lambda attempt: self._trained(attempt, event, told.more))
            case RolledOut():
                self._latest(lambda attempt: self._rolled_out(attempt, event, told.more))
            case Refined():
                self.read_chapters.append(event)
            case Abandoned() | Retrained() | Loosened() | Removed() | Failed():
                self.read_chapters.append(Remark(_remark(event)))
            case Evaluated(figures, _):
                self.found |= {"evaluation": figures, "failing": _episodes(told.more)}
            case Packaged():
                pass
            case Filmed(video):
                self.found["video"] = video
            case _:
                assert_never(event)

    def _latest(self, change: Callable[[Attempt], Attempt]) -> None:
        """Change the latest attempt."""
        place = max(i for i, chapter in enumerate(self.read_chapters) if isinstance(chapter, Attempt))
        attempt = self.read_chapters[place]
        assert isinstance(attempt, Attempt)
        self.read_chapters[place] = change(attempt)

    def _trained(self, attempt: Attempt, event: Trained, more: Mapping[str, Any]) -> Attempt:
        self._steps += sum(int(report["control_steps"]) for report in event.reports)
        curves = more.get("curves", {})
        skills = tuple(SkillTraining(report, curves.get(str(report["controller"]), {})) for report in event.reports)
        return replace(attempt, skills=(*attempt.skills, *skills), library=event.metrics.parent)

    def _rolled_out(self, attempt: Attempt, event: RolledOut, more: Mapping[str, Any]) -> Attempt:
        self._steps += int(event.counts["control_steps"])
        return replace(attempt, counts=event.counts, failing=_episodes(more), steps=self._steps)


def _episodes(more: Mapping[str, Any]) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(int(number) for number in row) for row in more.get("failing", ()))


def _remark(event: Abandoned | Retrained | Loosened | Removed | Failed) -> str:
    match event:
        case Abandoned(reason):
            return f"Another line of refinements was taken up, for {reason}."
        case Retrained(success):
            return f"The controllers of a promising program, which succeeded in {success:.0%}, were trained on."
        case Loosened(subgoal, predicate, success, helps):
            asked = f"{subgoal} was asked for less: with {text(predicate)}"
            return f"{asked} {success:.0%} of the episodes succeed, which is {'better' if helps else 'no better'}."
        case Removed(subgoal, success):
            return f"{subgoal} was taken out again: without it {success:.0%} of the episodes succeed."
        case Failed(reason):
            return f"No program: {reason}."
        case _:
            assert_never(event)
