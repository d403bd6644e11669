"""The report of a transfer experiment: a table of every measurement, its summary beside the paper's, and a picture."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from stages.paper_values import paper_success

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CSV, MARKDOWN, PICTURE = "towers.csv", "towers.md", "towers.png"
FIGURES = ("successes", "episodes", "success", "ci_low", "ci_high", "control_steps")
SOURCE = "Paper: RoboScribe in Fig. 21, success over 500 episodes; it prints no numbers of ReNN."
GROUP = 0.8
"""Width of the bars of one task, of the distance between tasks."""


@dataclass(frozen=True)
class Measurement:
    """One program in one task.

    Args:
        trained: blocks of the single tower for which the program was made.
        seed: that decided the program.
        contact: contact model of the task.
        task: name of the task.
        figures: what the evaluation found.
    """

    trained: int
    seed: int
    contact: str
    task: str
    figures: Mapping[str, Any]


def tabulate(measurements: Sequence[Measurement]) -> pd.DataFrame:
    """Make one row of every measurement, with the success rate that the paper reports; NaN where it reports none."""
    rows = [
        {
            "trained": each.trained,
            "seed": each.seed,
            "contact": each.contact,
            "task": each.task,
            **{name: each.figures[name] for name in FIGURES},
            "paper": paper_success(each.trained, each.task),
        }
        for each in measurements
    ]
    return pd.DataFrame(rows).astype({"paper": float})


def cell_means(table: pd.DataFrame) -> dict[str, float]:
    """Return every cell's success rate, the mean over seeds, by a name such as "tower-5.trained-4.paper-contact"."""
    means = table.groupby(["trained", "task", "contact"], sort=False, as_index=False)["success"].mean()
    return {f"{row.task}.trained-{row.trained}.{row.contact}-contact": float(row.success) for row in means.itertuples()}


def summarise(table: pd.DataFrame) -> str:
    """Write the success rates in per cent as a Markdown table: mean and range over seeds by contact model."""
    contacts = list(dict.fromkeys(table["contact"]))
    heads = ["trained on", "task", *(f"{contact} contact" for contact in contacts), "paper"]
    lines = [f"| {' | '.join(heads)} |", "|---|---|" + "---:|" * (len(contacts) + 1)]
    for (trained, task), rows in table.groupby(["trained", "task"], sort=False):
        cells = [_spell(rows[rows["contact"] == contact]["success"]) for contact in contacts]
        words = [f"tower-{trained}", str(task), *cells, _spell(rows["paper"].drop_duplicates())]
        lines.append(f"| {' | '.join(words)} |")
    seeds = ", ".join(str(seed) for seed in sorted(set(table["seed"])))
    episodes = ", ".join(str(count) for count in sorted(set(table["episodes"])))
    about = f"Success in %, mean over programs (lowest to highest); seeds {seeds}; {episodes} episodes each."
    return "\n".join([about, SOURCE, "", *lines, ""])


def draw(table: pd.DataFrame) -> bytes:
    """Draw the success rates as PNG.

    A row of panels per contact model and tower of the training, a panel per shape; in it a bar per program with its
    95 % interval, and the paper's value as a marker.
    """
    from matplotlib.figure import Figure

    shaped = table.assign(shape=table["task"].str.rpartition("-")[0], blocks=table["task"].str.rpartition("-")[2])
    shapes, seeds = list(dict.fromkeys(shaped["shape"])), sorted(set(shaped["seed"]))
    rows = list(shaped.groupby(["trained", "contact"], sort=False))
    figure = Figure(figsize=(1.0 + 3.6 * len(shapes), 0.6 + 2.6 * len(rows)), dpi=110, layout="constrained")
    grid = figure.subplots(len(rows), len(shapes), sharey=True, squeeze=False)
    for panels, ((trained, contact), part) in zip(grid, rows, strict=True):
        for axes, shape in zip(panels, shapes, strict=True):
            _panel(axes, part[part["shape"] == shape], seeds)
            axes.set_title(f"{shape}, {contact} contact, trained on {trained} blocks", fontsize=8)
        panels[0].set_ylabel("success, %")
    legends = [axes.get_legend_handles_labels() for axes in grid.flat]
    shown = {label: handle for handles, labels in legends for handle, label in zip(handles, labels, strict=True)}
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=len(shown), fontsize=8)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", metadata={"Software": None})
    return picture.getvalue()


def report_files(table: pd.DataFrame) -> dict[str, bytes]:
    """Return the three files of the report by name."""
    return {
        CSV: table.to_csv(index=False).encode(),
        MARKDOWN: summarise(table).encode(),
        PICTURE: draw(table),
    }


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
        axes.bar(places, rate, width, yerr=spans, color=f"C{i}", ecolor="0.2", capsize=2, label=f"seed {seed}")
    paper = part.drop_duplicates("blocks").dropna(subset="paper")
    places = [blocks.index(count) for count in paper["blocks"]]
    axes.plot(places, 100 * paper["paper"], "kD", markersize=5, markerfacecolor="white", label="paper")
    axes.set_xticks(range(len(blocks)), blocks)
    axes.set_xlabel("blocks")
    axes.set_ylim(0, 105)
