"""Films of failures: of every program that was tried on the way, and of the final one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from roboscribe.envs.render import SMALL
from roboscribe.pipelines.report.chapters import Attempt, Chapters
from roboscribe.pipelines.report.films import FINAL, Film
from roboscribe.pipelines.runs.lookup import LoadedRun
from roboscribe.runnable import Runnable, runnable
from roboscribe.stages.film import FilmOptions, film, record_episodes
from roboscribe.stages.runtime.configuration import decode
from roboscribe.stages.runtime.controller_files import DESCRIPTIONS, WEIGHTS, read_library
from roboscribe.stages.runtime.files import read_json
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.stages.tracking.event_log import EventLog
from roboscribe.stages.train import LIMITS
from roboscribe.subtask_tree import ROOT

EVERY = 2
"""Control steps between two pictures of a small film."""


@dataclass(frozen=True)
class FailureScene:
    """What is to be filmed.

    Args:
        place: of the attempt among the chapters, or FINAL.
        program: with its controllers.
        goal: what it was to reach.
        failing: number, seed, divergence and steps of its failing episodes.
    """

    place: int
    program: Runnable
    goal: str
    failing: tuple[tuple[int, ...], ...]


def film_failures(found: LoadedRun, chapters: Chapters, count: int, directory: Path) -> dict[int, list[Film]]:
    """Film failing episodes of a run.

    Args:
        found: the run; without an account nobody knows which episodes failed.
        chapters: its chapters.
        count: most films of each program.
        directory: where films go.

    Returns:
        Films by the place of their attempt among the chapters; programs whose controllers are gone have none.

    Raises:
        ArtifactError: controllers are damaged.
    """
    if found.account is None or not count:
        return {}
    where = decode(TaskConfig, found.account.about["plan"]["task"], "plan.task")
    return {
        scene.place: _film_scene(scene, where, count, directory)
        for scene in _scenes(found, chapters, found.account, where)
    }


def _scenes(found: LoadedRun, chapters: Chapters, account: EventLog, where: TaskConfig) -> Iterator[FailureScene]:
    """List programs that failed and whose controllers are there."""
    confirm = int(account.about["plan"]["training"]["confirm"])
    for place, chapter in enumerate(chapters.read_chapters):
        if isinstance(chapter, Attempt) and chapter.failing and chapter.library is not None:
            program = _attempted(chapter, chapter.library, where, confirm)
            if program is not None:
                yield FailureScene(place, program, chapter.goal, chapter.failing)
    if chapters.failing and found.program is not None and not found.program.edited:
        yield FailureScene(FINAL, runnable(found.program, where.make(), found.name), ROOT, chapters.failing)


def _attempted(attempt: Attempt, library: Path, where: TaskConfig, confirm: int) -> Runnable | None:
    """Make a program that was tried ready to run; None where its controllers are not here any more."""
    if not all((library / name).is_file() for name in (DESCRIPTIONS, WEIGHTS, LIMITS)):
        return None
    skills = read_library(library / DESCRIPTIONS, library / WEIGHTS, where.make())
    return Runnable(attempt.program, skills, read_json(library / LIMITS), confirm)


def _film_scene(scene: FailureScene, where: TaskConfig, count: int, directory: Path) -> list[Film]:
    """Film the first failing episodes of a program."""
    task, chosen = where.make(), scene.failing[:count]
    numbers = [number for number, *_ in chosen]
    seeds = [seed for _, seed, *_ in chosen]
    shown = record_episodes(scene.program, task, numbers, seeds, scene.goal)
    how = FilmOptions(every=EVERY, size=SMALL)
    return [
        Film(
            film(scene.program, task, [take], directory / f"{scene.place}-{number}.mp4", how),
            f"episode {number}: {scene.goal} is not reached",
        )
        for number, take in zip(numbers, shown, strict=True)
    ]
