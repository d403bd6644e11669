"""Chapters as the page shows them: a title, lines of plain text, and parts made of the library's HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import assert_never

from markupsafe import Markup

from roboscribe.html.code import predicate_html, program_html
from roboscribe.html.curves import Curve, Point, curves_html
from roboscribe.html.strips import strips_html
from roboscribe.html.tables import refinement_html
from roboscribe.html.tree import tree_html
from roboscribe.pipelines.console import reason_line, training_line
from roboscribe.pipelines.report.chapters import Attempt, Chapter, Chapters, Remark, SkillTraining
from roboscribe.pipelines.report.films import Film, films_html
from roboscribe.stages.runtime.events import Refined
from roboscribe.subtask_tree import ROOT


@dataclass(frozen=True)
class PagePart:
    """A part of a chapter.

    Args:
        title: what it shows.
        html: the library's HTML.
        folded: whether it can be folded away.
        open: whether it is unfolded at first.
    """

    title: str
    html: Markup
    folded: bool = True
    open: bool = False


@dataclass(frozen=True)
class ChapterView:
    """A chapter.

    Args:
        kind: solved, failed, refined or remark; decides the colour of its dot.
        title: what happened.
        lines: more about it.
        parts: what there is to see.
    """

    kind: str
    title: str
    lines: tuple[str, ...] = ()
    parts: tuple[PagePart, ...] = field(default=())


def chapter_views(chapters: Chapters, films: Mapping[int, Sequence[Film]]) -> tuple[ChapterView, ...]:
    """Show every chapter, refinements numbered.

    Args:
        chapters: the chapters.
        films: of failures, by the place of their attempt among the chapters.
    """
    numbers = {id(each): rank for rank, each in enumerate(chapters.refinements, start=1)}
    return tuple(
        _view(chapter, numbers.get(id(chapter), 0), films.get(place, ()))
        for place, chapter in enumerate(chapters.read_chapters)
    )


def _view(chapter: Chapter, number: int, films: Sequence[Film]) -> ChapterView:
    match chapter:
        case Attempt():
            return _attempt(chapter, films)
        case Refined():
            return _refinement(chapter, number)
        case Remark(said):
            return ChapterView("remark", said)
        case _:
            assert_never(chapter)


def _attempt(attempt: Attempt, films: Sequence[Film]) -> ChapterView:
    """Show a program that was tried."""
    program = PagePart("the program", Markup(program_html(attempt.program)))
    shown = (PagePart("an episode that failed", films_html(films), folded=False),) if films else ()
    lines = tuple(training_line(skill.report) for skill in attempt.skills)
    if not attempt.counts:
        return ChapterView("remark", f"{attempt.controllers} was made ready for {attempt.goal}", lines, (program,))
    won, episodes = int(attempt.counts["successes"]), int(attempt.counts["episodes"])
    title = f"{attempt.controllers} reached {attempt.goal} in {won} of {episodes} episodes"
    broken = int(attempt.counts.get("diverged", 0))
    lines += (f"physics broke in {broken} of them",) if broken else ()
    return ChapterView("solved" if won >= 0.9 * episodes else "failed", title, lines, (program, *shown))


def _refinement(refined: Refined, number: int) -> ChapterView:
    """Show a subgoal with its table and where it holds."""
    refinement, node = refined.refinement, refined.refinement.node
    said = reason_line(refinement)
    explained = f"Its program explains {refined.explained} of {refined.demonstrations} demonstrations."
    strips = Markup(strips_html(refined.strips, node.name, refinement.psi))
    table, tree = Markup(refinement_html(refinement)), Markup(tree_html(refined.tree))
    parts = (
        PagePart("It says", Markup(f"<p>{escape(node.name)} ≡ {predicate_html(node.predicate)}</p>"), folded=False),
        PagePart(f"Where {node.name} is true along the demonstrations", strips, folded=False),
        PagePart(f"{len(refinement.table)} candidates, the best first", table, open=True),
        PagePart("the abstraction with it", tree),
    )
    title = f"Refinement {number}: {node.name} becomes a subgoal of {refinement.psi}"
    return ChapterView("refined", title, (f"{said[0].upper()}{said[1:]}.", explained), parts)


def success_curves(chapters: Chapters, name: str = "", rank: int = 0) -> tuple[Curve, ...]:
    """Draw what was tried: programs for the task, and in grey attempts at subgoals where runs are not compared."""
    task = Curve(name or "the task", tuple(_point(each) for each in chapters.solving), rank)
    others = tuple(_point(each) for each in chapters.tried if each.goal != ROOT)
    return (task,) if name or not others else (task, Curve("subgoals", others, 5))


def _point(attempt: Attempt) -> Point:
    won, episodes = attempt.counts["successes"], attempt.counts["episodes"]
    told = f"{attempt.controllers} reached {attempt.goal} in {won} of {episodes} episodes, {attempt.steps} steps"
    return Point(attempt.steps, attempt.rate, *attempt.interval, told)


def learning_html(chapters: Chapters) -> Markup:
    """Draw how controllers succeeded while they were learned, where that was measured more than once."""
    learned = [(skill, attempt.goal) for attempt in chapters.tried for skill in attempt.skills]
    curves = [curve for rank, (skill, goal) in enumerate(learned) for curve in _curves(skill, goal, rank)]
    return Markup(curves_html(curves, "success in training")) if curves else Markup()


def _curves(skill: SkillTraining, goal: str, rank: int) -> list[Curve]:
    """Read the success rates of a learner, while a program for some goal was made ready."""
    name = f"π_{skill.report['controller']} for {goal}"
    rates = {key: points for key, points in skill.curves.items() if key.endswith("success") and len(points) > 1}
    return [
        Curve(
            f"{name}: {key.replace('_', ' ')}",
            tuple(
                Point(step, value, value, value, f"{name}: {value:.0%} after {step} steps") for step, value in points
            ),
            rank,
        )
        for key, points in rates.items()
    ]
