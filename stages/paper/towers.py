"""The report of a transfer experiment: a table of every measurement, its summary beside the paper's, and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from roboscribe.stages.paper.report import Report, grid
from roboscribe.stages.paper.rows import OURS
from roboscribe.stages.paper.style import OTHER, PAPER, QUICK, label_heading, pictures, styled
from roboscribe.stages.paper.values import RENN, paper_success

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIGURES = ("successes", "episodes", "success", "ci_low", "ci_high", "control_steps")
KEYS = ("trained", "method", "seed", "contact", "task", "timing")
SOURCE = (
    "Paper: RoboScribe in Fig. 21, success over 500 episodes. ReNN: means of 3 in the artifact's data; it is reported, "
    "not trained again."
)
GROUP = 0.8
"""Width of the bars of one task, of the distance between tasks."""
SHADES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
"""Colours of seeds, after Okabe and Ito."""


@dataclass(frozen=True)
class Measurement:
    """One program or policy in one task.

    Args:
        trained: blocks of the single tower for which it was made.
        seed: that decided it.
        contact: contact model of the task.
        task: name of the task.
        figures: what the evaluation found.
        method: that made it.
        timing: simulator steps per control step.
        quick: whether it is no result.
        commit: of the sources.
    """

    trained: int
    seed: int
    contact: str
    task: str
    figures: Mapping[str, Any]
    method: str = OURS
    timing: str = "fast"
    quick: bool = False
    commit: str = ""


def tabulate(measurements: Sequence[Measurement]) -> pd.DataFrame:
    """Make one row of every measurement, with the success rates that the paper reports; NaN where it reports none."""
    rows = [
        {
            "trained": each.trained,
            "method": each.method,
            "seed": each.seed,
            "contact": each.contact,
            "task": each.task,
            **{name: each.figures[name] for name in FIGURES},
            "paper": paper_success(each.trained, each.task),
            "renn": paper_success(each.trained, each.task, RENN),
            "timing": each.timing,
            "quick": each.quick,
            "commit": each.commit,
        }
        for each in measurements
    ]
    return pd.DataFrame(rows).astype({"paper": float, "renn": float})


def report(table: pd.DataFrame, *, quick: bool) -> Report:
    """Make the report."""
    return Report(table, summarise(table), draw(table, quick=quick))


def summarise(table: pd.DataFrame) -> str:
    """Write the success rates in per cent as a Markdown table: mean and range over seeds by contact model."""
    contacts = list(dict.fromkeys(table["contact"]))
    lines = []
    for (trained, method, task), rows in table.groupby(["trained", "method", "task"], sort=False):
        cells = [_spell(rows[rows["contact"] == contact]["success"]) for contact in contacts]
        reported = [_spell(rows[name].drop_duplicates()) for name in ("paper", "renn")]
        lines.append([f"tower-{trained}", str(method), str(task), *cells, *reported])
    seeds = ", ".join(str(seed) for seed in sorted(set(table["seed"])))
    episodes = ", ".join(str(count) for count in sorted(set(table["episodes"])))
    about = f"Success in %, mean over programs (lowest to highest); seeds {seeds}; {episodes} episodes each."
    heads = ["trained on", "method", "task", *(f"{contact} contact" for contact in contacts), "paper", "ReNN"]
    return "\n".join([about, SOURCE, "", grid(heads, lines, 3)])


def draw(table: pd.DataFrame, *, quick: bool = False) -> dict[str, bytes]:
    """Draw the success rates as PNG and SVG.

    A row of panels per method, contact model and tower of the training, a panel per shape; in it a bar per program
    with its 95 % interval, and the paper's values as markers.
    """
    from matplotlib.figure import Figure

    shaped = table.assign(shape=table["task"].str.rpartition("-")[0], blocks=table["task"].str.rpartition("-")[2])
    shapes, seeds = list(dict.fromkeys(shaped["shape"])), sorted(set(shaped["seed"]))
    rows = list(shaped.groupby(["method", "trained", "contact"], sort=False))
    with styled():
        figure = Figure(figsize=(1.0 + 3.6 * len(shapes), 0.6 + 2.4 * len(rows)), layout="constrained")
        panels = figure.subplots(len(rows), len(shapes), sharey=True, squeeze=False)
        for line, ((method, trained, contact), part) in zip(panels, rows, strict=True):
            for axes, shape in zip(line, shapes, strict=True):
                _panel(axes, part[part["shape"] == shape], seeds)
                own = "" if method == OURS else f"{method}, "
                axes.set_title(f"{own}{shape}, {contact} contact, trained on {trained} blocks", fontsize=8)
            line[0].set_ylabel("success, %")
        keys = [(f"seed {seed}", SHADES[i % len(SHADES)]) for i, seed in enumerate(seeds)]
        label_heading(figure, [*keys, ("◇ paper", PAPER), ("□ ReNN, paper", OTHER)], f"{QUICK}; " * quick)
        return pictures(figure, "towers")


def _spell(rates: pd.Series[float]) -> str:
    """Spell a mean in per cent, with the range where there are several values; "-" where there is none."""
    known = 100 * rates.dropna()
    if known.empty:
        return "-"
    if len(known) == 1:
        return f"{known.mean():.1f}"
    return f"{known.mean():.1f} ({known.min():.1f} to {known.max():.1f})"


def _panel(axes: Axes, part: pd.DataFrame, seeds: Sequence[int]) -> None:
    """Draw the tasks of one shape; a seed has the same place and colour in all panels."""
    blocks, width = list(dict.fromkeys(part["blocks"])), GROUP / len(seeds)
    for seed, own in part.groupby("seed"):
        i = seeds.index(seed)
        rate = 100 * own["success"]
        places = [blocks.index(count) - GROUP / 2 + (i + 0.5) * width for count in own["blocks"]]
        spans = [rate - 100 * own["ci_low"], 100 * own["ci_high"] - rate]
        spans = [span.clip(lower=0.0) for span in spans]  # an end that is the rate itself may be off by rounding
        axes.bar(places, rate, width, yerr=spans, color=SHADES[i % len(SHADES)], ecolor="0.2", capsize=2)
    for column, mark, shade in (("paper", "D", PAPER), ("renn", "s", OTHER)):
        known = part.drop_duplicates("blocks").dropna(subset=column)
        places = [blocks.index(count) for count in known["blocks"]]
        axes.plot(places, 100 * known[column], mark, color=shade, markersize=5, markerfacecolor="white")
    axes.set_xticks(range(len(blocks)), blocks)
    axes.set_xlabel("blocks")
    axes.set_ylim(0, 105)
