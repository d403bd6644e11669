"""Push-Multi Confined: programs for pushing measured where the order matters, under their old guard and a new one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from roboscribe.stages.paper.report import Report, grid, percent, seed_list, spell_spread
from roboscribe.stages.paper.statistics import FEW_SEEDS, spread
from roboscribe.stages.paper.style import PAPER, QUICK, colour, pictures, rate_axis, styled
from roboscribe.stages.paper.values import CONFINED

OLD, NEW, ZERO_SHOT = "old guard", "new guard", "zero-shot"
FIGURES = ("successes", "episodes", "success", "ci_low", "ci_high", "control_steps")
SHOWN_AS = {
    (NEW, "roboscribe"): "roboscribe",
    (ZERO_SHOT, "deepset"): None,
}
"""What the paper reports, by way and method; it reports DeepSet after further training only."""
ABOUT = (
    "Only the guard of the loop is learned again, from demonstrations of the confined task, without control steps. "
    "Paper: Sec. 5.3, mean and standard deviation over 500 episodes; its DeepSet was trained on in the confined task."
)


@dataclass(frozen=True)
class Measurement:
    """One program or policy in the confined task.

    Args:
        trained: task for which it was made.
        task: the confined one.
        method: "roboscribe" or a baseline.
        profile: what it was learned from.
        seed: that decided it.
        way: "old guard", "new guard" or "zero-shot".
        loop: line that begins its loop; "" for baselines.
        n_demonstrations: demonstrations from which the guard was learned.
        demonstrations: their SHA-256; "" where none were used.
        contact: contact model.
        timing: simulator steps per control step.
        quick: whether it is no result.
        commit: of the sources.
        figures: what the evaluation found.
        seconds: that it took.
    """

    trained: str
    task: str
    method: str
    profile: str
    seed: int
    way: str
    loop: str
    n_demonstrations: int
    demonstrations: str
    contact: str
    timing: str
    quick: bool
    commit: str
    figures: Mapping[str, Any]
    seconds: float


def tabulate(measurements: list[Measurement]) -> pd.DataFrame:
    """Make one row of every measurement."""
    return pd.DataFrame([_row(each) for each in measurements])


def _row(each: Measurement) -> dict[str, object]:
    return {
        "task": each.task,
        "trained": each.trained,
        "method": each.method,
        "profile": each.profile,
        "seed": each.seed,
        "way": each.way,
        **{name: each.figures[name] for name in FIGURES},
        "wall_seconds": round(each.seconds, 1),
        "demonstrations": each.demonstrations,
        "contact": each.contact,
        "timing": each.timing,
        "budget": "default",
        "quick": each.quick,
        "commit": each.commit,
        "n_demonstrations": each.n_demonstrations,
        "loop": each.loop,
    }


def report(table: pd.DataFrame, *, quick: bool) -> Report:
    """Make the report."""
    rows = [
        _summary(str(way), str(method), part) for (way, method), part in table.groupby(["way", "method"], sort=False)
    ]
    heads = ["method", "way", "seeds", "success, %: mean", "interquartile mean (95 %)", "each seed", "paper, %"]
    loops = [f"- seed {row['seed']}, {row['way']}: `{row['loop']}`" for row in table.to_dict("records") if row["loop"]]
    note = "DeepSet trained on until convergence, 81.3 % in the paper, is not repeated here."
    text = [ABOUT, grid(heads, rows, 3), note, "\n".join(loops), FEW_SEEDS]
    return Report(table, "\n\n".join(part for part in text if part), draw(table, quick=quick))


def _summary(way: str, method: str, part: pd.DataFrame) -> list[str]:
    part = part.sort_values("seed")
    found = spread([part["success"].tolist()])
    seeds = seed_list(part["seed"].tolist()).removeprefix("seeds ").removeprefix("seed ")
    each = ", ".join(percent(success) for success in part["success"])
    return [method, way, seeds, percent(found.mean), spell_spread(found), each, _paper(way, method)]


def _paper(way: str, method: str) -> str:
    name = SHOWN_AS.get((way, method))
    if name is None:
        return "-"
    mean, deviation = CONFINED[name]
    return f"{percent(mean)} ± {percent(deviation)}"


def draw(table: pd.DataFrame, *, quick: bool) -> dict[str, bytes]:
    """Draw every seed as a point with its 95 % interval, the mean as a line, the paper's means as dashed lines."""
    from matplotlib.figure import Figure

    groups = list(table.groupby(["way", "method"], sort=False))
    with styled():
        figure = Figure(figsize=(2.2 + 1.3 * len(groups), 3.0), layout="constrained")
        axes = figure.subplots()
        for place, ((_, method), part) in enumerate(groups):
            shade = colour("roboscribe, actions" if method == "roboscribe" else str(method))
            offsets = [place + 0.1 * (i - (len(part) - 1) / 2) for i in range(len(part))]
            rates = 100 * part["success"]
            spans = [(rates - 100 * part["ci_low"]).clip(lower=0), (100 * part["ci_high"] - rates).clip(lower=0)]
            axes.errorbar(offsets, rates, spans, fmt="o", markersize=3.5, color=shade, elinewidth=0.8)
            axes.hlines(rates.mean(), place - 0.35, place + 0.35, color=shade)
        for name, (mean, _) in CONFINED.items():
            axes.axhline(100 * mean, color=PAPER if name == "roboscribe" else colour(name), linestyle="--", linewidth=1)
            axes.text(1.01, 100 * mean, f"{name}, paper", transform=axes.get_yaxis_transform(), va="center", fontsize=7)
        axes.set_xticks(range(len(groups)), [f"{method},\n{way}" for (way, method), _ in groups])
        axes.set_xlim(-0.6, len(groups) - 0.4)
        rate_axis(axes)
        axes.set_title(f"{QUICK}; " * quick + f"{table['task'].iloc[0]}; point: seed, line: mean", fontsize=9)
        return pictures(figure, "confined")
