"""What the paper reports about its Tower programs in tasks for which they were not trained.

Source: Fig. 21 (Sec. 5.2) of "Abstraction Refinement-Guided Program Synthesis for Robot Learning from Demonstrations":
success in per cent over 500 episodes of programs that were synthesized from single towers of 4 or 5 blocks. The
figure shows its baseline ReNN as bars without numbers; the text says only that after 4 blocks ReNN builds less than
5 % of taller single towers, so no value of ReNN stands here.
"""

from __future__ import annotations

from collections.abc import Mapping

FEWEST = 4
"""Blocks of the first task of each shape; each further one has one more."""
SUCCESS: Mapping[int, Mapping[str, tuple[int, ...]]] = {
    4: {"tower": (88, 55, 15, 0), "multitower": (88, 83, 72, 60, 45, 28), "pyramid": (90, 90, 80, 53, 42, 31)},
    5: {"tower": (91, 76, 48, 13), "multitower": (89, 83, 72, 63, 49, 35), "pyramid": (92, 89, 85, 60, 46, 34)},
}
"""Per cent by blocks of the tower of the training, shape, and blocks of the task."""
TASKS = tuple(f"{shape}-{FEWEST + i}" for shape, values in SUCCESS[FEWEST].items() for i in range(len(values)))
"""Names of the tasks that the figure shows."""


def paper_success(trained: int, task: str) -> float | None:
    """Return the success rate that the paper reports, None where it reports none.

    Args:
        trained: blocks of the single tower of the training.
        task: name of the task, such as "pyramid-6".
    """
    shape, _, blocks = task.rpartition("-")
    values = SUCCESS.get(trained, {}).get(shape, ())
    index = int(blocks) - FEWEST
    return values[index] / 100 if 0 <= index < len(values) else None
