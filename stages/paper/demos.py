"""Demonstration sizes: success and control steps by the number of demonstrations, and by how they are given."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isinf

import pandas as pd

from roboscribe.stages.paper.curves import runs_of
from roboscribe.stages.paper.report import Report, grid, percent, seed_list, spell_spread, spell_steps
from roboscribe.stages.paper.rows import finals
from roboscribe.stages.paper.statistics import FEW_SEEDS, median_steps, spread, steps_until
from roboscribe.stages.paper.style import COLOURS, PAPER, QUICK, pictures, rate_axis, styled
from roboscribe.stages.paper.values import DEMONSTRATIONS

ENOUGH = 0.95
"""Success until which control steps are counted."""
ABOUT = (
    "Each row: syntheses from so many demonstrations; style and share of failing demonstrations as in `roboscribe "
    "demos`. Paper: Sec. 5.1, from all of whose demonstrations actions are left out."
)
KEYS = ["task", "profile", "n_demonstrations", "style", "failing"]
TASK = "pick-place-1"
"""The paper's task for this experiment."""


def report(table: pd.DataFrame, tasks: Sequence[str], missing: Sequence[str], *, quick: bool) -> Report:
    """Make the report; arguments as for the curves."""
    rows = [_row(key, part) for key, part in table.groupby(KEYS, sort=False)]
    heads = ["task", "profile", "demonstrations", "style", "failing", "seeds", "success, %: mean"]
    heads += ["interquartile mean (95 %)", "each seed", f"median steps until {ENOUGH:.0%}", "paper, %", "paper's steps"]
    text = "\n\n".join([ABOUT, grid(heads, rows, 6), FEW_SEEDS])
    return Report(table, text, draw(table, quick=quick))


def _row(key: tuple[object, ...], part: pd.DataFrame) -> list[str]:
    task, profile, shown, style, failing = key
    last = finals(part).sort_values("seed")
    found = spread([last["success"].tolist()])
    each = ", ".join(
        f"{percent(success)}{f' ({ended})' if ended else ''}"
        for success, ended in zip(last["success"], last["ended"], strict=True)
    )
    reached = median_steps(_reached(part))
    usual = task == TASK and style == "default" and not failing
    success, steps = DEMONSTRATIONS.get(int(str(shown)), (None, inf)) if usual else (None, inf)
    words = [str(task), str(profile), str(shown), str(style), f"{float(str(failing)):.0%}"]
    seeds = seed_list(last["seed"].tolist()).removeprefix("seeds ").removeprefix("seed ")
    paper = [percent(success), "-" if isinf(steps) else spell_steps(steps)]
    return [*words, seeds, percent(found.mean), spell_spread(found), each, spell_steps(reached), *paper]


def _reached(part: pd.DataFrame) -> list[float]:
    return [steps_until(points, ENOUGH) for points in runs_of(part).values()]


def draw(table: pd.DataFrame, *, quick: bool) -> dict[str, bytes]:
    """Draw success, and steps until it, over the number of demonstrations of the usual style; as PNG and SVG."""
    from matplotlib.figure import Figure

    usual = table[(table["style"] == "default") & (table["failing"] == 0)]
    with styled():
        figure = Figure(figsize=(8.6, 2.9), layout="constrained")
        left, right = figure.subplots(1, 2)
        for (task, shade), height in zip(_shades(usual).items(), (0.3, 0.2, 0.1, 0.4, 0.5, 0.6), strict=False):
            own = usual[usual["task"] == task]
            last, sizes = finals(own), sorted(set(own["n_demonstrations"]))
            left.plot(last["n_demonstrations"], 100 * last["success"], "o", markersize=3.5, color=shade, alpha=0.6)
            left.plot(sizes, [100 * last[last["n_demonstrations"] == n]["success"].mean() for n in sizes], color=shade)
            left.text(0.98, height, task, transform=left.transAxes, color=shade, ha="right")
            steps = {n: _reached(own[own["n_demonstrations"] == n]) for n in sizes}
            known = [(n, value) for n, values in steps.items() for value in values if not isinf(value)]
            right.plot([n for n, _ in known], [v for _, v in known], "o", markersize=3.5, color=shade, alpha=0.6)
            middle = [(n, median_steps(values)) for n, values in steps.items()]
            middle = [(n, value) for n, value in middle if not isinf(value)]
            right.plot([n for n, _ in middle], [v for _, v in middle], color=shade)
        sizes = sorted(DEMONSTRATIONS)
        left.plot(sizes, [100 * DEMONSTRATIONS[n][0] for n in sizes], "D--", color=PAPER, markerfacecolor="white")
        right.plot(sizes, [DEMONSTRATIONS[n][1] for n in sizes], "D--", color=PAPER, markerfacecolor="white")
        right.annotate(f"paper, {TASK}", (sizes[0], DEMONSTRATIONS[sizes[0]][1]), (0, 6), textcoords="offset points")
        rate_axis(left)
        right.set_yscale("log")
        right.set_ylabel(f"control steps until {ENOUGH:.0%}")
        ticks = sorted({*sizes, *usual["n_demonstrations"]})
        for axes in (left, right):
            axes.set_xscale("log")
            axes.set_xticks(ticks, [str(n) for n in ticks])
            axes.minorticks_off()
            axes.set_xlabel("demonstrations")
        figure.suptitle(f"{QUICK}; " * quick + "demonstrations; point: seed, line: mean and median", fontsize=9)
        return pictures(figure, "demos")


def _shades(usual: pd.DataFrame) -> dict[str, str]:
    """Give every task a colour of the palette."""
    return dict(zip(dict.fromkeys(usual["task"]), COLOURS.values(), strict=False))
