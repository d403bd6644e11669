"""What all reports share: their files, their tables in Markdown, how figures are spelled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isinf, isnan

import pandas as pd

from roboscribe.io.atomic import Json, indented_json
from roboscribe.stages.paper.statistics import Spread
from roboscribe.stages.paper.style import QUICK

MANIFEST = "manifest.json"
NOT_BUILT = "not built yet"


@dataclass(frozen=True)
class About:
    """What a report says about its run.

    Args:
        name: of the experiment, which files are named after.
        command: that makes the report.
        commit: of the sources.
        quick: whether it is no result.
        missing: tasks that do not exist yet, by name.
        failures: cells without a result, and why.
        since: what changed since the last run; lines.
        options: for the manifest.
    """

    name: str
    command: str = ""
    commit: str = ""
    quick: bool = False
    missing: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    since: tuple[str, ...] = ()
    options: Mapping[str, Json] = field(default_factory=dict)

    @property
    def heading(self) -> str:
        """The first line."""
        return f"{QUICK}: " * self.quick + f"paper {self.name}"


@dataclass(frozen=True)
class Report:
    """The parts of a report that experiments make.

    Args:
        table: of all evaluations.
        text: Markdown, without heading and ending.
        pictures: by file name.
    """

    table: pd.DataFrame
    text: str
    pictures: Mapping[str, bytes]


def report_files(report: Report, about: About) -> dict[str, bytes]:
    """Return the files of a report by name: table, summary, figures, and what is said about the run."""
    stated: Json = {
        "command": about.command,
        "commit": about.commit,
        "quick": about.quick,
        "missing": list(about.missing),
        "failures": list(about.failures),
        "options": dict(about.options),
    }
    return {
        f"{about.name}.csv": report.table.to_csv(index=False, lineterminator="\n").encode(),
        f"{about.name}.md": _markdown(report, about).encode(),
        **report.pictures,
        MANIFEST: indented_json(stated).encode(),
    }


def _markdown(report: Report, about: About) -> str:
    """Put heading, text and ending together."""
    made = f"`{about.command}`" + f" at {about.commit}" * bool(about.commit)
    parts = [f"# {about.heading}", made, report.text.strip()]
    if about.missing:
        parts.append("\n".join(f"- {task}: {NOT_BUILT}" for task in about.missing))
    if about.failures:
        parts.append("\n".join(["No result:", "", *(f"- {failure}" for failure in about.failures)]))
    parts.append("\n".join(["## Since the last run", "", *about.since]))
    return "\n\n".join(parts) + "\n"


def grid(heads: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    """Write a table in Markdown; the columns after the first `words` are numbers."""
    ruler = "|" + "---|" * words + "---:|" * (len(heads) - words)
    return "\n".join([f"| {' | '.join(heads)} |", ruler, *(f"| {' | '.join(row)} |" for row in rows)])


def percent(rate: float | None) -> str:
    """Spell a rate in per cent; "-" where there is none."""
    return "-" if rate is None or isnan(rate) else f"{100 * rate:.1f}"


def spell_spread(found: Spread) -> str:
    """Spell an interquartile mean with its interval, in per cent."""
    known = "" if isnan(found.low) else f" ({percent(found.low)} to {percent(found.high)})"
    return f"{percent(found.iqm)}{known}"


def spell_steps(steps: float) -> str:
    """Spell control steps: 68k, 2.20M; "not reached" where there are none."""
    if isinf(steps):
        return "not reached"
    return f"{steps / 1e6:.2f}M" if steps >= 1e6 else f"{steps / 1e3:.0f}k"


def seed_list(seeds: Sequence[int]) -> str:
    """Spell seeds: "seeds 0, 1"."""
    return f"seed{'s' * (len(seeds) > 1)} {', '.join(str(seed) for seed in seeds)}"
