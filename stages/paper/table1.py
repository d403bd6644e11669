"""Table 1: mean refinements of the programs that were synthesized for the curves."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from roboscribe.stages.paper.report import NOT_BUILT, Report, grid, seed_list
from roboscribe.stages.paper.rows import NO_PROGRAM, OURS, finals, in_order, named_lines
from roboscribe.stages.paper.style import ORDER, PAPER, QUICK, colour, pictures, styled
from roboscribe.stages.paper.values import REPORTED

ABOUT = (
    "Refinements: executions of Algorithm 2, line 9, on the way to the program, mean over seeds; a synthesis without a "
    "program has none and is left out of the mean. Paper: Table 1, five seeds."
)
MORE = "more than the paper"


def report(table: pd.DataFrame, tasks: Sequence[str], missing: Sequence[str], *, quick: bool) -> Report:
    """Make the report; arguments as for the curves."""
    last = named_lines(finals(table))
    rows = [row for task in tasks for row in (_rows(last, task) or [_absent(task, missing)])]
    heads = ["task", "method", "seeds", "refinements: mean", "each seed", "paper", ""]
    return Report(table, f"{ABOUT}\n\n{grid(heads, rows, 3)}", draw(last, tasks, quick=quick))


def _rows(last: pd.DataFrame, task: str) -> list[list[str]]:
    own = last[(last["task"] == task) & (last["method"] == OURS)]
    return [_row(task, line, own[own["line"] == line]) for line in in_order(own["line"], ORDER)]


def _row(task: str, line: str, rows: pd.DataFrame) -> list[str]:
    rows = rows.sort_values("seed")
    counts = rows["refinements"].dropna()
    each = ", ".join(NO_PROGRAM if pd.isna(count) else str(count) for count in rows["refinements"])
    reported = REPORTED.get(task)
    seeds = seed_list(rows["seed"].tolist()).removeprefix("seeds ").removeprefix("seed ")
    if counts.empty:
        return [task, line, seeds, "-", each, _paper(task), ""]
    mean = float(counts.mean())
    more = MORE if reported is not None and mean > reported.refinements else ""
    return [task, line, seeds, f"{mean:.1f}", each, _paper(task), more]


def _absent(task: str, missing: Sequence[str]) -> list[str]:
    return [task, OURS, "-", "-", NOT_BUILT if task in missing else "nothing measured", _paper(task), ""]


def _paper(task: str) -> str:
    return f"{REPORTED[task].refinements}" if task in REPORTED else "-"


def draw(last: pd.DataFrame, tasks: Sequence[str], *, quick: bool) -> dict[str, bytes]:
    """Draw every seed as a point, the mean as a line, the paper's mean as a diamond, as PNG and SVG."""
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(1.5 + 0.9 * len(tasks), 2.8), layout="constrained")
        axes = figure.subplots()
        ours = last[last["method"] == OURS]
        lines = in_order(ours["line"], ORDER)
        for i, line in enumerate(lines):
            shift = 0.22 * (i - (len(lines) - 1) / 2)
            for place, task in enumerate(tasks):
                counts = ours[(ours["task"] == task) & (ours["line"] == line)]["refinements"].dropna().astype(float)
                if not counts.empty:
                    offsets = [place + shift + 0.03 * (n - (len(counts) - 1) / 2) for n in range(len(counts))]
                    axes.plot(offsets, counts, "o", markersize=3.5, color=colour(line), alpha=0.7)
                    axes.hlines(counts.mean(), place + shift - 0.1, place + shift + 0.1, color=colour(line))
            axes.text(1.01, 0.9 - 0.08 * i, line, transform=axes.transAxes, color=colour(line))
        known = [(place, REPORTED[task].refinements) for place, task in enumerate(tasks) if task in REPORTED]
        axes.plot([x for x, _ in known], [y for _, y in known], "D", color=PAPER, markerfacecolor="white", markersize=5)
        axes.text(1.01, 0.9 - 0.08 * len(lines), "paper", transform=axes.transAxes, color=PAPER)
        axes.set_xticks(range(len(tasks)), [task.replace("-", "-\n", 1) for task in tasks], fontsize=7)
        axes.set_ylabel("refinements")
        axes.set_ylim(bottom=0)
        axes.set_title(f"{QUICK}; " * quick + "refinements; point: seed, line: mean")
        return pictures(figure, "table1")
