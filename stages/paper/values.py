"""What the paper reports, once, with its sources.

Sources: "Abstraction Refinement-Guided Program Synthesis for Robot Learning from Demonstrations", Sec. 5, and the data
and plotting scripts of the authors' artifact, named as such. Values that can only be read off a picture are left out.
Steps are control steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

FEWEST = 4
"""Blocks of the first task of each shape in Fig. 21; each further one has one more."""
Transfers = Mapping[int, Mapping[str, tuple[float, ...]]]
SUCCESS: Transfers = {
    4: {"tower": (88, 55, 15, 0), "multitower": (88, 83, 72, 60, 45, 28), "pyramid": (90, 90, 80, 53, 42, 31)},
    5: {"tower": (91, 76, 48, 13), "multitower": (89, 83, 72, 63, 49, 35), "pyramid": (92, 89, 85, 60, 46, 34)},
}
"""RoboScribe in Fig. 21, in per cent by blocks of the training's tower, shape, and blocks; 500 episodes."""
RENN: Transfers = {
    4: {
        "tower": (90, 1.3, 0, 0),
        "multitower": (82.7, 78.3, 51, 30, 23, 8.3),
        "pyramid": (62, 30.7, 11.7, 5.3, 2, 0),
    },
    5: {
        "tower": (87.7, 80, 46, 2),
        "multitower": (74.3, 69.3, 41.7, 34.3, 25.7, 12),
        "pyramid": (48, 21.7, 7.7, 2.3, 1, 0),
    },
}
"""ReNN in Fig. 21, means of 3; from the artifact's data, since the figure shows bars without numbers."""
TASKS = tuple(f"{shape}-{FEWEST + i}" for shape, values in SUCCESS[FEWEST].items() for i in range(len(values)))
"""Names of the tasks of Fig. 21."""


@dataclass(frozen=True)
class ReportedTask:
    """One of the seven tasks of Fig. 19 and Table 1.

    Args:
        title: its name in the paper.
        axis: where the axis of Fig. 19 ends, control steps; the budget `paper`.
        refinements: mean of 5 seeds in Table 1.
        curve: RoboScribe's points (control steps, success) as far as they are known; empty where none is.
        bc: success of behaviour cloning, a line in Fig. 19; from the artifact's scripts.
        others: by baseline, its points in Fig. 19; from the artifact's data.
    """

    title: str
    axis: int
    refinements: float
    curve: tuple[tuple[int, float], ...]
    bc: float
    others: Mapping[str, tuple[tuple[int, float], ...]]


def _flat(axis: int) -> dict[str, tuple[tuple[int, float], ...]]:
    return {method: ((0, 0.0), (axis, 0.0)) for method in ("gail", "goalgail", "deepset")}


def _millions(*rates: float) -> tuple[tuple[int, float], ...]:
    return tuple((1_000_000 * (i + 1), rate) for i, rate in enumerate(rates))


REPORTED: Mapping[str, ReportedTask] = {
    "pick-place-1": ReportedTask(
        "Pick&Place-1",
        4_000_000,
        2.2,
        ((0, 0.0), (1_800_000, 0.0), (2_000_000, 0.81), (2_120_000, 0.95), (2_240_000, 0.98)),
        0.848,
        {
            "gail": _millions(0.69, 0.83, 0.82, 0.81),
            "goalgail": _millions(0.85, 0.91, 0.97, 0.98),
            "deepset": _millions(0.18, 0.44, 0.67, 0.78),
        },
    ),
    "pick-place-4": ReportedTask(
        "Pick&Place-4", 4_000_000, 2.2, ((0, 0.0), (2_400_000, 0.0), (2_400_000, 0.86)), 0.027, _flat(4_000_000)
    ),
    "pick-place-cond": ReportedTask(
        "Pick&Place-Cond", 6_000_000, 5.4, ((0, 0.0), (4_400_000, 0.0), (4_400_000, 0.96)), 0.489, _flat(6_000_000)
    ),
    "push-3": ReportedTask(
        "Push-3",
        8_000_000,
        4.4,
        ((0, 0.0), (2_960_000, 0.0)),
        0.35,
        {
            **_flat(8_000_000),
            "deepset": (*_millions(0.0, 0.0, 0.04, 0.08, 0.40, 0.56), (8_000_000, 0.77)),
        },
    ),
    "tower-5": ReportedTask("Tower-5", 16_700_000, 4.4, (), 0.018, _flat(16_700_000)),
    "table-top": ReportedTask("Meta-World", 6_000_000, 5.6, (), 0.063, _flat(6_000_000)),
    "place-cubes-drawer-3": ReportedTask(
        "PlaceCubesDrawer", 18_500_000, 4.6, ((0, 0.0), (4_400_000, 0.0)), 0.0, _flat(18_500_000)
    ),
}
"""By our names of the tasks, in the paper's order; RoboScribe's curves from the artifact's data."""
DEMONSTRATIONS: Mapping[int, tuple[float, int]] = {
    10: (0.998, 2_280_000),
    20: (0.990, 1_680_000),
    50: (0.997, 2_200_000),
}
"""Pick&Place-1 by the number of demonstrations: success, and control steps until it (Sec. 5.1)."""
CONFINED: Mapping[str, tuple[float, float]] = {"roboscribe": (0.863, 0.005), "deepset": (0.813, 0.040)}
"""Push-Multi Confined: success over 500 episodes and its standard deviation (Sec. 5.3); DeepSet was trained on."""
CURVES_NOTE = (
    "The paper's curves, drawn dashed, are those of its artifact: each point of RoboScribe there is the maximum of 4 "
    "evaluations (Pick&Place-1: the plain mean is 92 %), the flat start is one constant per task, Pick&Place-Cond is "
    "the square of Pick&Place-1's runs, shifted, and Tower-5 up to 8M steps is a run times 14/86, which is not drawn; "
    "curves have 2 to 4 stored seeds, and the zeros of baselines that could be read come from one export of 4.2M steps."
)


def paper_success(trained: int, task: str, values: Transfers = SUCCESS) -> float | None:
    """Return the success rate that the paper reports in Fig. 21, None where it reports none.

    Args:
        trained: blocks of the single tower of the training.
        task: name of the task, such as "pyramid-6".
        values: of RoboScribe or of ReNN.
    """
    shape, _, blocks = task.rpartition("-")
    rates = values.get(trained, {}).get(shape, ())
    if not rates:
        return None
    index = int(blocks) - FEWEST
    return rates[index] / 100 if 0 <= index < len(rates) else None
