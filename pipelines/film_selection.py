"""Choosing which episodes of a program to film, and how."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from roboscribe.errors import TaskError
from roboscribe.evaluation import PURPOSE, episode_seeds, waves
from roboscribe.runnable import Runnable
from roboscribe.stages.film import FilmOptions, film, record_episodes
from roboscribe.stages.runtime.progress import ProgressCallback, episode_progress, ignore_progress
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.subtask_tree import ROOT

MOST_CELLS = 6
"""Most episodes beside or below each other."""
SEARCHED = 500
"""Episodes that are run to find failing ones."""
AT_ONCE = 4
"""Least episodes that are run before looking whether enough of them failed; then twice as many, and so on."""


def grid(spelled: str) -> tuple[int, int]:
    """Read a grid, "3x2": three beside each other, two below each other.

    Raises:
        TaskError: it is spelled otherwise, or too large.
    """
    found = re.fullmatch(r"([1-9])x([1-9])", spelled)
    if found is None or max(int(found[1]), int(found[2])) > MOST_CELLS:
        msg = f"grid {spelled!r}: expected columns x rows, for instance 3x3, at most {MOST_CELLS}x{MOST_CELLS}"
        raise TaskError(msg)
    return int(found[1]), int(found[2])


def failing_episodes(
    program: Runnable,
    where: TaskConfig,
    seed: int,
    wanted: int,
    first: int = 0,
    report: ProgressCallback = ignore_progress,
) -> list[int]:
    """Find failing episodes of a seed's evaluation; fewer than wanted where there are not so many.

    Args:
        program: what runs.
        where: the task.
        seed: of the evaluation.
        wanted: how many.
        first: number of the first episode that counts.
        report: told how many were run.
    """
    task, seeds = where.make(), episode_seeds(seed, PURPOSE, first + SEARCHED)
    found: list[int] = []
    done, few = first, max(AT_ONCE, 2 * wanted)
    while len(found) < wanted and done < len(seeds):
        wave = seeds[done : done + few]
        for rollouts in waves(program, task, wave, watch=episode_progress(f"roll out {ROOT}", len(wave), report)):
            found += [done + rank for rank, won in enumerate(rollouts.success) if not won]
            done += len(rollouts.success)
        few *= 2
    return found[:wanted]


def film_episodes(
    program: Runnable, where: TaskConfig, seed: int, episodes: Sequence[int], out: Path, how: FilmOptions
) -> tuple[Path, list[int]]:
    """Film episodes of a seed's evaluation.

    Returns:
        The file written, and which of the episodes succeeded.
    """
    task = where.make()
    seeds = episode_seeds(seed, PURPOSE, max(episodes) + 1)[list(episodes)]
    shown = record_episodes(program, task, episodes, seeds)
    solved = [number for number, take in zip(episodes, shown, strict=True) if take.solved]
    return film(program, task, shown, out, how), solved
