"""One line for every run."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from roboscribe.pipelines.runs.lookup import SHOWN, RunRecord


def summary(run: RunRecord) -> dict[str, str]:
    """Sum up a run."""
    about, result = run.account.about, run.account.result
    plan = about["plan"]
    solved = "ci_low" in result
    shares = [f"{100 * float(result[name]):.1f}" for name in ("success", "ci_low", "ci_high")] if solved else []
    took = (run.account.ended - run.account.began) / 1000
    return {
        "run": run.key[:SHOWN],
        "task": str(plan["task"]["name"]),
        "seed": str(plan["seed"]),
        "profile": str(result.get("profile") or plan["profile"] or ""),
        "status": run.status.lower(),
        "success": f"{shares[0]} % ({shares[1]} to {shares[2]})" if solved else "",
        "refinements": str(result.get("refinements", "")),
        "steps": f"{int(result['env_steps']) / 1000:.0f}k" if solved else "",
        "seconds": f"{took:.0f}",
        "begun": datetime.fromtimestamp(run.account.began / 1000).astimezone().strftime("%Y-%m-%d %H:%M"),
    }


def columns(rows: Sequence[dict[str, str]]) -> list[str]:
    """Line up rows under their titles, nothing cut off however narrow the terminal is."""
    table = [list(rows[0]), *(list(row.values()) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table]
