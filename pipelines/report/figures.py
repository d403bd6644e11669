"""What is known about a run in numbers and names, in one order for every report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from roboscribe.pipelines.report.chapters import Chapters
from roboscribe.pipelines.runs.lookup import LoadedRun

UNKNOWN = "–"


def figures(found: LoadedRun, chapters: Chapters) -> dict[str, str]:
    """Name the figures of a run; unknown ones are left out.

    Args:
        found: the run.
        chapters: its chapters.
    """
    known = {**_evaluation(found, chapters), **_manifest(found.manifest), **_account(found, chapters)}
    return {name: value for name, value in known.items() if value}


def side_by_side(columns: Sequence[Mapping[str, str]]) -> list[tuple[str, list[str]]]:
    """Put the figures of several runs beside each other."""
    names = dict.fromkeys(name for column in columns for name in column)
    return [(name, [column.get(name, UNKNOWN) for column in columns]) for name in names]


def success(counts: Mapping[str, Any]) -> str:
    """Spell a success rate with its interval and its episodes."""
    share, low, high = (100 * float(counts[name]) for name in ("success", "ci_low", "ci_high"))
    return f"{share:.1f} % ({low:.1f} to {high:.1f}) of {counts['episodes']} episodes"


def _manifest(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Read the figures of a program's manifest."""
    names = {"task": "task", "seed": "seed", "profile": "profile", "contact": "contact model", "timing": "timing"}
    return {told: str(manifest[name]) for name, told in names.items() if name in manifest}


def _account(found: LoadedRun, chapters: Chapters) -> dict[str, str]:
    """Read the figures of an event log."""
    account = found.account
    if account is None:
        return _made(found.manifest)
    plan, result, shown = account.about["plan"], account.result, chapters.demonstrations
    task = plan["task"]
    kept = f"{shown['kept']} of {shown['episodes']}, {shown['frames']} frames" if shown else ""
    return {
        "task": str(task["name"]),
        "seed": str(plan["seed"]),
        "profile": chapters.profile or str(plan["profile"] or ""),
        "contact model": str(task["contact"]),
        "timing": str(task["timing"]),
        "status": found.status.lower(),
        "demonstrations": kept,
        "refinements": str(len(chapters.refinements)),
        "programs tried": str(len(chapters.tried)),
        "control steps": spaced(result.get("env_steps")),
        "seconds": f"{float(result['wall_seconds']):.0f}" if "wall_seconds" in result else "",
        "begun": datetime.fromtimestamp(account.began / 1000, UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": str(account.about.get("commit", ""))[:12],
        "command": str(found.manifest.get("command") or account.about["command"]),
    }


def _made(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Read how a program was made where nothing else is known."""
    return {
        "control steps": spaced(manifest.get("env_steps")),
        "commit": str(manifest.get("commit", ""))[:12],
        "command": str(manifest.get("command", "")),
    }


def _evaluation(found: LoadedRun, chapters: Chapters) -> dict[str, str]:
    """Read the final evaluation."""
    counts = chapters.evaluation or found.manifest.get("figures", {})
    edited = "yes: figures are those of the program as it was learned"
    diverged = str(counts.get("diverged", "")) if counts.get("diverged") else ""
    return {
        "success": success(counts) if "ci_low" in counts else "",
        "physics broke in": diverged,
        "program edited": edited if found.program is not None and found.program.edited else "",
    }


def spaced(count: object) -> str:
    """Format a count with its thousands apart."""
    return "" if count is None else f"{int(str(count)):,}".replace(",", "\u202f")
