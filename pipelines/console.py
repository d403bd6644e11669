"""The console output of a synthesis: what is tried, how often it succeeds, which subgoal is chosen and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, assert_never

from rich.console import Console
from rich.table import Table
from rich.text import Text

from roboscribe.baselines.config import METHODS
from roboscribe.classifier import Refinement
from roboscribe.dsl.printer import pretty, text
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Predicate, Truth
from roboscribe.pipelines.callbacks import Callbacks
from roboscribe.pipelines.progress_bar import ProgressBar
from roboscribe.program_gen import OPAQUE
from roboscribe.rl.config import TrainConfig
from roboscribe.search.candidates import Candidate
from roboscribe.stages.runtime.events import (
    Abandoned,
    Decision,
    Evaluated,
    Event,
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
from roboscribe.steps import most_common

ROWS = 5
"""Rows of a ranked table that are shown; all of them are tracked."""


class SynthesisConsole(ProgressBar):
    """Prints the events of a synthesis above a progress bar."""

    def __init__(self, console: Console) -> None:
        """Start with nothing tried."""
        super().__init__(console)
        self._refinements = 0
        self._tried = ""

    def callbacks(self) -> Callbacks:
        """Return the callbacks that print here."""
        return Callbacks(self.on_stage, self.on_event, self.on_progress)

    def on_event(self, event: Event) -> None:
        """Print an event."""
        match event:
            case Ingested(report, profile):
                self._ingested(report, profile)
            case Programmed(goal, program):
                self._tried = " ".join(f"π_{run.controller}" for run in controllers(program))
                self.say(f"{goal}: trying {self._tried}")
            case Trained(_, reports, _):
                for report in reports:
                    self.say(f"  {training_line(report)}")
            case RolledOut(goal, counts, _):
                self.say(f"  {self._tried} reached {tried_line(goal, counts)}")
            case Decision():
                self._decided(event)
            case Failed(reason):
                self.say(f"FAIL: {reason}", "bold red")
            case Packaged(program, _, _):
                self.say("")
                self.say(pretty(program).rstrip(), "bold")
                self.say("")
            case Evaluated() | Filmed():
                pass
            case _:
                assert_never(event)

    def _decided(self, event: Refined | Abandoned | Retrained | Loosened | Removed) -> None:
        match event:
            case Refined():
                self._refined(event)
            case Abandoned(reason):
                self.say(f"another line is taken up, for {reason}", "yellow")
            case Retrained(success):
                self.say(f"a promising program, at {success:.0%}, is trained on", "yellow")
            case Loosened(subgoal, predicate, _, helps):
                verdict = "better" if helps else "no better"
                self.say(f"  that is {verdict} with {subgoal} asked for less, {text(predicate)}", "cyan")
            case Removed(subgoal, success):
                self.say(f"{subgoal} is taken out again: without it {success:.0%} of the episodes succeed", "cyan")
            case _:
                assert_never(event)

    def _ingested(self, report: Mapping[str, Any], profile: str) -> None:
        self._refinements = 0  # several syntheses may be told one after the other
        actions = "with actions" if report["actions"] else "states only"
        kept = f"{report['kept']} of {report['episodes']} demonstrations, {report['frames']} frames, {actions}"
        self.say(f"{kept}; profile {profile}")
        for line in report["report"]:
            self.say(f"  {line}", "yellow")

    def _refined(self, event: Refined) -> None:
        self._refinements += 1
        refinement, node = event.refinement, event.refinement.node
        meaning = f"{node.name} ≡ {text(node.predicate)}{_those(node.only)}"
        head = f"refinement {self._refinements}: {meaning}, a subgoal of {refinement.psi}"
        self.say(head, "bold cyan")
        self.say(f"  because {reason_line(refinement)}")
        for phi, why_not in refinement.passed_over:
            self.say(f"  passed over {phi}: {why_not}", "dim")
        self.say(f"  its program explains {event.explained} of {event.demonstrations} demonstrations")
        if len(refinement.table) > 1:
            self.console.print(ranked_table(refinement.table))


def _those(only: Predicate) -> str:
    """Say whom a loop is about, if it is not about all."""
    return "" if only == Truth() else f" for those with {text(only)}"


def reason_line(refinement: Refinement) -> str:
    """Say in one line why a subgoal was chosen."""
    psi, count = refinement.psi, refinement.negatives
    chosen = next(c for c in refinement.table if c.predicate == refinement.node.predicate)
    loop = "one entity after the other is brought to it: a loop; " if chosen.each else ""
    return (
        f"{loop}it holds where the demonstrations reach {psi} ({refinement.positives} times), and in "
        f"{chosen.accepted:.1%} of {count} failing states; it is first reached {chosen.first:.0%} on the way, stays "
        f"true in {chosen.kept:.0%} of the rest, and holds at the start of {chosen.initial:.0%}"
    )


def ranked_table(candidates: Iterable[Candidate]) -> Table:
    """Show the first rows of a ranked table."""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for title in ("  rank", "predicate", "failures", "first", "kept", "start", "margin"):
        table.add_column(title, justify="left" if title == "predicate" else "right", no_wrap=title != "predicate")
    for rank, c in enumerate(list(candidates)[:ROWS], start=1):
        shares = (f"{c.accepted:.1%}", f"{c.first:.0%}", f"{c.kept:.0%}", f"{c.initial:.0%}", f"{c.margin:.2f}")
        table.add_row(str(rank), Text(text(c.predicate) + _those(c.only)), *shares)
    return table


def tried_line(goal: str, counts: Mapping[str, Any]) -> str:
    """Say in how many episodes a program reached its goal, and where most of the others were stuck before it."""
    line = f"{goal} in {counts['successes']} of {counts['episodes']} episodes"
    unreached = counts.get("unreached", [])
    stuck = most_common(unreached)
    told = stuck not in ("", goal, OPAQUE)
    return f"{line}; {unreached.count(stuck)} of the others did not get beyond π_{stuck}" if told else line


def training_line(report: Mapping[str, Any]) -> str:
    """Say in one line how a controller was learned."""
    name, learner, steps = report["controller"], report["learner"], report["control_steps"]
    if learner == "scripted":
        return f"π_{name}: scripted"
    if learner in METHODS:
        return f"π_{name}: trained, {steps} control steps"
    if learner == "undone":
        return f"π_{name}: as it was, for the program is worse with what was learned ({steps} control steps)"
    if not report["starts"] and learner == "kept":
        why = f"the program reaches its goal in {report['success']:.0%} of the episodes tried"
        missing = ": a subgoal is missing" if report["success"] < TrainConfig.worth_improving else ""
        return f"π_{name}: kept, for {why}{missing} ({steps} control steps)"
    if not report["starts"]:
        return f"π_{name}: {learner}; no states to start from were found in {steps} control steps"
    rates = f"{report['warm_success']:.0%} → {report['success']:.0%}"
    return f"π_{name}: {learner}, {rates} of held-out starts, {steps} control steps"
