"""How a program's success falls with the strength of what disturbs it: measurements, table, figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from roboscribe.errors import ArtifactError, TaskError
from roboscribe.evaluation import Watch, format_success, ignore_counts, measure
from roboscribe.io.atomic import Json
from roboscribe.runnable import Runnable
from roboscribe.stages.paper.style import rate_axis, styled
from roboscribe.world.task import Task

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STRENGTHS: Mapping[str, tuple[float, ...]] = {
    "noise": (0.0, 0.0025, 0.005, 0.01, 0.02),
    "delay": (0, 1, 2, 3),
    "push": (0.0, 0.1, 0.2, 0.4),
    "slip": (0.0, 0.1, 0.3, 1.0),
    "knock": (0, 1, 2, 3),
    "friction": (0.25, 0.5, 1.0, 2.0, 4.0),
    "mass": (0.25, 0.5, 1.0, 2.0, 4.0),
    "size": (0.8, 0.9, 1.0, 1.1, 1.2),
}
"""Strengths that are measured of each kind of disturbance; one of each changes nothing."""
AXES = {
    "noise": "noise of seen positions, mm",
    "delay": "delay of actions, control steps",
    "push": "pushes of a block once a second, m/s",
    "slip": "grasps that slip, times a second",
    "knock": "blocks knocked off their places",
    "friction": "friction, times its own",
    "mass": "mass of blocks, times their own",
    "size": "size of blocks, times their own",
}
COLUMNS = 4
"""Panels beside each other."""
RATIOS = ("friction", "mass", "size")
"""Kinds of which strength 1 changes nothing, and not 0."""


@dataclass(frozen=True)
class Measured:
    """Success under one disturbance.

    Args:
        kind: what disturbs.
        strength: how much.
        episodes: how many were run.
        success: share of them that succeeded.
        ci_low, ci_high: 95 % Wilson interval of that.
    """

    kind: str
    strength: float
    episodes: int
    success: float
    ci_low: float
    ci_high: float


def check_suffix(out: Path) -> None:
    """Refuse a figure that is no PNG.

    Raises:
        ArtifactError: its name ends otherwise.
    """
    if out.suffix != ".png":
        msg = f"{out}: found {out.suffix or 'no suffix'}, expected .png"
        raise ArtifactError(msg)


def possible(task: Task, kinds: Sequence[str]) -> tuple[str, ...]:
    """Return the kinds that a task can have; all there are where none is named.

    Raises:
        TaskError: one that is named and that there is not, or that the task cannot have.
    """
    from roboscribe.envs.disturbed import disturbed

    found = []
    for kind in kinds or STRENGTHS:
        try:
            disturbed(task, [f"{kind}=1"])
            found.append(kind)
        except TaskError:
            if kinds:
                raise
    return tuple(found)


def sweep(
    program: Runnable,
    task: Task,
    kinds: Sequence[str],
    seed: int,
    episodes: int,
    watch: Callable[[str], Watch] = lambda name: ignore_counts,
) -> tuple[Measured, ...]:
    """Measure a program under every kind of disturbance at each of its strengths, on the same episodes.

    Args:
        program: what runs.
        task: where.
        kinds: of `STRENGTHS`.
        seed: decides the episodes.
        episodes: how many of each.
        watch: told what is measured next; returns who is told about its episodes.
    """
    from roboscribe.envs.disturbed import disturbed

    calm = _measured("", 0.0, measure(program, task, seed, episodes, watch("undisturbed")).figures)
    found = []
    for kind in kinds:
        for strength in STRENGTHS[kind]:
            name = f"{kind}={strength:g}"
            if strength == float(kind in RATIOS):
                found.append(replace(calm, kind=kind, strength=strength))
            else:
                figures = measure(program, disturbed(task, [name]), seed, episodes, watch(name)).figures
                found.append(_measured(kind, strength, figures))
    return tuple(found)


def _measured(kind: str, strength: float, figures: Mapping[str, Json]) -> Measured:
    success, low, high = (float(str(figures[name])) for name in ("success", "ci_low", "ci_high"))
    return Measured(kind, strength, int(str(figures["episodes"])), success, low, high)


def lines(found: Sequence[Measured]) -> list[tuple[str, str, str]]:
    """Spell measurements: kind, strength, success in per cent with its interval."""
    return [(AXES[each.kind].split(",")[0], _strength(each), format_success(asdict(each))) for each in found]


def _strength(each: Measured) -> str:
    """Spell a strength with its unit."""
    unit = AXES[each.kind].rpartition(", ")[2]
    if each.kind == "noise":
        return f"{1000 * each.strength:g} mm"
    if each.kind in RATIOS:
        return f"x {each.strength:g}"
    return f"{each.strength:g}" if each.kind == "knock" else f"{each.strength:g} {unit}"


def draw(named: Mapping[str, Sequence[Measured]]) -> bytes:
    """Draw success against strength as PNG: a panel per kind, a line per program with its 95 % intervals."""
    from matplotlib.figure import Figure

    kinds = list(dict.fromkeys(each.kind for found in named.values() for each in found))
    columns = min(COLUMNS, len(kinds))
    rows = -(-len(kinds) // columns)
    picture = io.BytesIO()
    with styled():
        figure = Figure(figsize=(0.4 + 2.4 * columns, 0.4 + 2.1 * rows), layout="constrained")
        panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for axes in panels[len(kinds) :]:
            axes.set_visible(False)
        for axes, kind in zip(panels, kinds, strict=False):
            for name, found in named.items():
                _line(axes, name, [each for each in found if each.kind == kind])
            rate_axis(axes)
            axes.set_xlabel(AXES[kind])
            axes.set_ylabel("success, %" if axes.get_subplotspec().is_first_col() else "")
        panels[0].legend(loc="lower left", fontsize=7, frameon=False)
        figure.savefig(picture, format="png", dpi=150, metadata={"Software": None})
    return picture.getvalue()


def _line(axes: Axes, name: str, found: Sequence[Measured]) -> None:
    """Draw one program under one kind of disturbance."""
    scale = 1000.0 if found and found[0].kind == "noise" else 1.0
    strengths = [scale * each.strength for each in found]
    below = [100 * max(0.0, each.success - each.ci_low) for each in found]
    above = [100 * max(0.0, each.ci_high - each.success) for each in found]
    rates = [100 * each.success for each in found]
    axes.errorbar(strengths, rates, [below, above], marker="o", markersize=3, capsize=2, linewidth=1, label=name)
    if found and found[0].kind in RATIOS[:2]:
        axes.set_xscale("log", base=2)
        axes.set_xticks(strengths, [f"{strength:g}" for strength in strengths])
