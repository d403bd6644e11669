"""Two runs or programs compared: text, configuration, figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import unified_diff

from roboscribe.io.atomic import Json
from roboscribe.pipelines.report.chapters import read_chapters
from roboscribe.pipelines.report.figures import figures, side_by_side
from roboscribe.pipelines.runs.lookup import LoadedRun

STYLES = {"+": "green", "-": "red", "@": "cyan"}


def compared(one: LoadedRun, other: LoadedRun) -> Iterator[tuple[str, str]]:
    """Yield lines with their style: the programs' difference, then what differs in configuration and figures."""
    lines = list(unified_diff(_program(one), _program(other), one.name, other.name, n=99, lineterm=""))
    yield from ((line, STYLES.get(line[:1], "")) for line in lines or ["the programs are the same"])
    yield "", ""
    settings = [settings_of(found) for found in (one, other)]
    yield from _differences("configuration", *settings)
    measured = [figures(found, read_chapters(found.account)) for found in (one, other)]
    known = {name.rsplit(".", 1)[-1] for column in settings for name in column}
    yield from _differences("figures", *({k: v for k, v in column.items() if k not in known} for column in measured))


def _program(found: LoadedRun) -> list[str]:
    return [] if found.program is None else found.program.program_text.splitlines()


def _differences(what: str, one: Mapping[str, str], other: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield what differs."""
    rows = [(name, *values) for name, values in side_by_side([one, other]) if len(set(values)) > 1]
    yield (f"{what}:" if rows else f"{what}: no difference"), "bold"
    width = max((len(name) for name, *_ in rows), default=0)
    for name, mine, theirs in rows:
        yield f"  {name:<{width}}  {mine} → {theirs}", ""


def settings_of(found: LoadedRun) -> dict[str, str]:
    """List every setting by its dotted name: of the run's plan where it is known, else of the program's manifest."""
    if found.account is not None:
        plan: Mapping[str, Json] = found.account.about["plan"]
        given = found.account.about.get("demonstrations")
        return {**dict(_flat("", plan)), "demonstrations": str(given or "collected")}
    names = ("task", "seed", "profile", "contact", "timing", "confirm")
    told = {"task": "task.name", "contact": "task.contact", "timing": "task.timing"}
    return {told.get(name, name): str(found.manifest[name]) for name in names if name in found.manifest}


def _flat(prefix: str, value: Json) -> Iterator[tuple[str, str]]:
    """List the leaves of nested settings."""
    if isinstance(value, Mapping):
        for name, part in value.items():
            yield from _flat(f"{prefix}.{name}" if prefix else name, part)
    else:
        yield prefix, str(value)
