"""Fig. 19: success over the control steps that a method used, by task, method and seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import pandas as pd

from roboscribe.stages.paper.report import NOT_BUILT, Report, grid, percent, seed_list, spell_spread, spell_steps
from roboscribe.stages.paper.rows import FINAL, GIVEN_UP, NO_PROGRAM, OURS, finals, in_order, line_name, named_lines
from roboscribe.stages.paper.statistics import (
    FEW_SEEDS,
    improvement,
    median_steps,
    middle,
    spread,
    steps_until,
    value_at,
)
from roboscribe.stages.paper.style import ORDER, PAPER, QUICK, colour, label_lines, pictures, rate_axis, styled
from roboscribe.stages.paper.values import CURVES_NOTE, REPORTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GOOD = 0.9
"""Success until which control steps are counted."""
LEAST = 1e3
"""Where the axis of control steps begins."""
Runs: TypeAlias = dict[int, list[tuple[int, float]]]
"""Points (control steps, success) by seed."""
ABOUT = (
    "x: control steps that the method itself used, attempts, rollouts and its own evaluations included; evaluations "
    "for this report run beside it. y: share of the episodes that reach the goal within the horizon; the value at x is "
    "the last evaluation at or before x, without smoothing. Thin: one seed, up to its own end. Thick: interquartile "
    "mean over seeds, where a seed that has ended counts with its last value; band: its 95 % bootstrap. Clones take no "
    "control steps and are drawn as lines across."
)


def runs_of(rows: pd.DataFrame) -> Runs:
    """Return the points of every seed, in order."""
    found: Runs = {}
    for row in rows.sort_values("control_steps", kind="stable").to_dict("records"):
        found.setdefault(int(row["seed"]), []).append((int(row["control_steps"]), float(row["success"])))
    return dict(sorted(found.items()))


def paper_end(task: str, line: str) -> float | None:
    """Return the last value that the paper reports for a method on a task; None where it reports none."""
    reported = REPORTED.get(task)
    if reported is None:
        return None
    if line == "bc":
        return reported.bc
    points = reported.curve if line.startswith(OURS) else reported.others.get(line, ())
    known = [success for _, success in points]
    return known[-1] if known and (known[-1] > 0 or not line.startswith(OURS)) else None


def report(table: pd.DataFrame, tasks: Sequence[str], missing: Sequence[str], *, quick: bool) -> Report:
    """Make the report.

    Args:
        table: all evaluations under one contact model, and final ones under others.
        tasks: in the order of the panels; those of `missing` have no evaluations.
        missing: tasks that do not exist yet.
        quick: whether it is no result.
    """
    named = named_lines(table)
    main = named[named["contact"] == named["contact"].iloc[0]]
    text = "\n\n".join([ABOUT, _tables(main, tasks), _elsewhere(named), _over_tasks(main), FEW_SEEDS, CURVES_NOTE])
    return Report(table, text, draw(main, tasks, missing, quick=quick))


def _tables(named: pd.DataFrame, tasks: Sequence[str]) -> str:
    """Write one row per task and method."""
    rows = []
    for task in tasks:
        own = named[named["task"] == task]
        rows += [_summary(task, line, own[own["line"] == line]) for line in in_order(own["line"], ORDER)]
    heads = ["task", "method", "seeds", "success, %: mean", "interquartile mean (95 %)", "each seed"]
    return grid([*heads, f"median steps until {GOOD:.0%}", "paper, %"], rows, 3)


def _summary(task: str, line: str, rows: pd.DataFrame) -> list[str]:
    last, runs = finals(rows).sort_values("seed"), runs_of(rows)
    found = spread([last["success"].tolist()])
    ends = zip(last["success"], last["ended"], last["control_steps"], strict=True)
    each = ", ".join(_one(*end) for end in ends)
    clone = bool((rows["control_steps"] == 0).all())
    steps = "-" if clone else spell_steps(median_steps([steps_until(points, GOOD) for points in runs.values()]))
    shown = [percent(found.mean), spell_spread(found), each, steps, percent(paper_end(task, line))]
    return [task, line, seed_list(sorted(runs)).removeprefix("seeds ").removeprefix("seed "), *shown]


def _one(success: float, ended: str, steps: int) -> str:
    """Spell how one seed ended."""
    if ended == GIVEN_UP:
        return f"0 up to {spell_steps(steps)}"
    return f"{percent(success)}{f' ({ended})' if ended == NO_PROGRAM else ''}"


def _elsewhere(named: pd.DataFrame) -> str:
    """Write the final evaluations under other contact models."""
    contacts = list(dict.fromkeys(named["contact"]))[1:]
    if not contacts:
        return "Final evaluations under other contact models were not asked for."
    other = named[named["contact"].isin(contacts)]
    groups = other.groupby(["task", "line", "contact"], sort=False)["success"]
    rows = [[*map(str, names), percent(float(values.mean()))] for names, values in groups]
    return "Final programs under other contact models:\n\n" + grid(["task", "method", "contact", "mean, %"], rows, 3)


def _over_tasks(named: pd.DataFrame) -> str:
    """Write the interquartile mean over tasks, and how likely programs are better than each baseline."""
    last = finals(named)
    by_line: dict[str, dict[str, list[float]]] = {}
    for (line, task), part in last.groupby(["line", "task"], sort=False):
        by_line.setdefault(str(line), {})[str(task)] = part["success"].tolist()
    lines = in_order(by_line, ORDER)
    ours = next((line for line in lines if line.startswith(OURS)), None)
    rows = []
    for line in lines:
        better = None if ours is None or line == ours else improvement(by_line[ours], by_line[line])
        found = spread(list(by_line[line].values()))
        rows.append([line, str(len(by_line[line])), spell_spread(found), "-" if better is None else f"{better:.2f}"])
    heads = ["method", "tasks", "interquartile mean over tasks, % (95 %)", f"probability that {ours} is better"]
    return grid(heads if ours else [*heads[:3], "-"], rows)


def draw(named: pd.DataFrame, tasks: Sequence[str], missing: Sequence[str], *, quick: bool) -> dict[str, bytes]:
    """Draw a panel per task, as PNG and SVG."""
    from matplotlib.figure import Figure

    columns = min(4, len(tasks))
    depth = -(-len(tasks) // columns)
    with styled():
        figure = Figure(figsize=(0.5 + 3.4 * columns, 0.7 + 2.4 * depth), layout="constrained")
        panels = list(figure.subplots(depth, columns, squeeze=False).flat)
        for axes, task in zip(panels, tasks, strict=False):
            _panel(axes, task, named[named["task"] == task], absent=task in missing)
        for axes in panels[len(tasks) :]:
            axes.set_visible(False)
        figure.suptitle(_title(named, tasks, quick=quick), fontsize=9)
        return pictures(figure, "curves")


def _title(named: pd.DataFrame, tasks: Sequence[str], *, quick: bool) -> str:
    seeds = seed_list(sorted(set(named["seed"])))
    part = "" if set(REPORTED) <= set(tasks) else f"; {', '.join(tasks)} only"
    return f"{QUICK}; " * quick + f"success over control steps, {seeds}{part}; dashed: paper"


def _panel(axes: Axes, task: str, rows: pd.DataFrame, *, absent: bool) -> None:
    """Draw the lines of one task."""
    axes.set_title(REPORTED[task].title if task in REPORTED else task)
    rate_axis(axes)
    if rows.empty:
        axes.set_xticks([])
        axes.text(0.5, 0.5, NOT_BUILT if absent else "nothing measured", transform=axes.transAxes, ha="center")
        return
    axes.set_xscale("log")
    axes.set_xlabel("control steps")
    lines = in_order(rows["line"], ORDER)
    furthest = max(2 * LEAST, float(rows["control_steps"].max()), *(_paper_steps(task, line) for line in lines))
    axes.set_xlim(LEAST, 1.1 * furthest)
    for line in lines:
        _paper_line(axes, task, line)
        _line(axes, line, runs_of(rows[rows["line"] == line]))
    last = finals(rows)
    heights = {line: 100 * middle(last[last["line"] == line]["success"].tolist()) for line in lines}
    label_lines(axes, [(line, heights[line], colour(line)) for line in lines])


def _line(axes: Axes, line: str, runs: Runs) -> None:
    """Draw the seeds of one method, and their interquartile mean with its band."""
    shade = colour(line)
    if all(steps == 0 for points in runs.values() for steps, _ in points):
        for points in runs.values():
            axes.axhline(100 * points[-1][1], color=shade, linewidth=0.6, alpha=0.7)
        axes.axhline(100 * middle([p[-1][1] for p in runs.values()]), color=shade, linewidth=1.8)
        return
    for points in runs.values():
        steps, rates = [LEAST, *(at for at, _ in points)], [0.0, *(100 * rate for _, rate in points)]
        axes.plot(steps, rates, color=shade, linewidth=0.6, alpha=0.7, drawstyle="steps-post")
    places = sorted({LEAST, *(float(steps) for points in runs.values() for steps, _ in points)})
    found = [spread([[value_at(points, x) for points in runs.values()]], resamples=2000) for x in places]
    axes.plot(places, [100 * f.iqm for f in found], color=shade, linewidth=1.8, drawstyle="steps-post")
    if len(runs) > 1:
        low, high = ([100 * getattr(f, end) for f in found] for end in ("low", "high"))
        axes.fill_between(places, low, high, step="post", color=shade, alpha=0.15, linewidth=0)


def _paper_points(task: str, line: str) -> Sequence[tuple[int, float]]:
    reported = REPORTED.get(task)
    if reported is None:
        return ()
    return reported.curve if line == line_name(OURS, "actions") else reported.others.get(line, ())


def _paper_steps(task: str, line: str) -> float:
    return max((float(steps) for steps, _ in _paper_points(task, line)), default=0.0)


def _paper_line(axes: Axes, task: str, line: str) -> None:
    """Draw what the paper reports: RoboScribe's curve black, a baseline's in the baseline's colour."""
    shade = PAPER if line.startswith(OURS) else colour(line)
    points = _paper_points(task, line)
    steps = np.maximum([at for at, _ in points], LEAST)
    axes.plot(steps, [100 * rate for _, rate in points], color=shade, linewidth=1.0, linestyle="--")
    if line == "bc" and task in REPORTED:
        axes.axhline(100 * REPORTED[task].bc, color=shade, linewidth=1.0, linestyle="--")


def cell_metrics(last: Mapping[str, object]) -> dict[str, float]:
    """Return the figures of a cell's final row that are tracked."""
    assert last["kind"] == FINAL, "the last row of a cell is final"
    names = ("success", "ci_low", "ci_high", "control_steps", "wall_seconds")
    return {name: float(str(last[name])) for name in names}
