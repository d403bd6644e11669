"""The page: every run with its chapters, and several runs beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from roboscribe.dsl.parser import parse_program
from roboscribe.errors import ProgramError
from roboscribe.html.code import code_html, meanings
from roboscribe.html.curves import curves_html
from roboscribe.html.style import STYLE, run_colour
from roboscribe.html.tables import figures_html, pairs_html
from roboscribe.html.tree import tree_html
from roboscribe.pipelines.console import training_line
from roboscribe.pipelines.report.chapters import Chapters
from roboscribe.pipelines.report.figures import figures, side_by_side, success
from roboscribe.pipelines.report.films import FINAL, Film, films_html
from roboscribe.pipelines.report.views import chapter_views, learning_html, success_curves
from roboscribe.pipelines.runs.lookup import KEY, SHOWN, LoadedRun
from roboscribe.subtask_tree import Tree
from roboscribe.tree_json import tree_from_json

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class ReportedRun:
    """A run that a page shows.

    Args:
        found: the run.
        chapters: its chapters.
        films: of its failures, by the place of their attempt among the chapters.
    """

    found: LoadedRun
    chapters: Chapters
    films: Mapping[int, Sequence[Film]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its name on the page."""
        known = figures(self.found, self.chapters)
        return f"{known.get('task', '?')} seed {known.get('seed', '?')} ({short_name(self.found.name)})"

    @property
    def text(self) -> str:
        """Text of its program; empty where there is none."""
        return "" if self.found.program is None else self.found.program.program_text.rstrip()

    @property
    def tree(self) -> Tree | None:
        """The abstraction at the end."""
        if self.found.program is not None:
            return tree_from_json(self.found.program.tree, self.found.name)
        latest = self.chapters.refinements[-1:]
        return latest[0].tree if latest else None

    @property
    def headline(self) -> str:
        """The outcome, in one line."""
        counts = self.chapters.evaluation or self.found.manifest.get("figures", {})
        if "ci_low" in counts:
            return f"{success(counts)} succeed (95 % interval)"
        account = self.found.account
        reason = "" if account is None else str(account.result.get("reason", ""))
        return f"No program: {reason}" if reason else f"The run is {self.found.status.lower() or 'unknown'}."


def short_name(name: str) -> str:
    """Shorten what a user typed: of a path its end, of a key its beginning."""
    own = Path(name).resolve().name if "/" in name or name == "." else name
    return own[:SHOWN] if KEY.fullmatch(own) else own


def page(runs: Sequence[ReportedRun]) -> str:
    """Write the page about some runs.

    Args:
        runs: at least one.

    Returns:
        HTML that needs no other file.
    """
    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    shared = set.intersection(*(_lines(run) for run in runs)) if len(runs) > 1 else None
    shown = [_run(run, rank, shared) for rank, run in enumerate(runs)]
    return environment.get_template("page.html").render(
        title=" and ".join(run.name for run in runs),
        style=Markup(STYLE + (HERE / "page.css").read_text()),
        runs=shown,
        comparison=_comparison(runs),
        version=version("roboscribe"),
    )


def _comparison(runs: Sequence[ReportedRun]) -> dict[str, Markup]:
    """Show what runs share and where they differ."""
    curves = [curve for rank, run in enumerate(runs) for curve in success_curves(run.chapters, run.name, rank)]
    rows = side_by_side([figures(run.found, run.chapters) for run in runs])
    tried = any(curve.points for curve in curves)
    return {
        "curve": Markup(curves_html(curves, "success at the task")) if tried else Markup(),
        "figures": Markup(figures_html(rows, [run.name for run in runs])),
    }


def _run(run: ReportedRun, rank: int, shared: set[str] | None) -> dict[str, object]:
    """Prepare what the template shows of a run."""
    chapters, tree = run.chapters, run.tree
    curves = success_curves(chapters)
    return {
        "name": run.name,
        "colour": run_colour(rank),
        "headline": run.headline,
        "program": _program(run, shared),
        "figures": Markup(pairs_html(figures(run.found, chapters))),
        "tree": Markup() if tree is None else Markup(tree_html(tree)),
        "curve": Markup(curves_html(curves, "success")) if chapters.tried else Markup(),
        "learning": learning_html(chapters),
        "chapters": chapter_views(chapters, run.films),
        "video": _video(chapters),
        "failures": _failures(run),
    }


def _program(run: ReportedRun, shared: set[str] | None) -> Markup:
    """Show the program as its file has it; lines that not all runs share are marked."""
    if not run.text:
        return Markup()
    lines = run.text.split("\n")
    marked = [] if shared is None else [rank for rank, line in enumerate(lines) if line.strip() not in shared]
    return Markup(code_html(run.text, _notes(run), marked))


def _lines(run: ReportedRun) -> set[str]:
    return {line.strip() for line in run.text.split("\n")}


def _notes(run: ReportedRun) -> dict[str, str]:
    """Say what names mean, and of controllers how they were learned; nothing where the text is no program."""
    try:
        notes = meanings(parse_program(run.text))
    except ProgramError:
        return {}
    for attempt in run.chapters.tried:
        for skill in attempt.skills:
            name = f"π_{skill.report['controller']}"
            notes |= {name: f"{notes[name].split(chr(10))[0]}\n{training_line(skill.report)}"} if name in notes else {}
    return notes


def _video(chapters: Chapters) -> Markup:
    """Show the episode that was filmed when the program was found."""
    if chapters.video is None or not chapters.video.is_file():
        return Markup()
    return films_html([Film(chapters.video, "the first episode of the final evaluation")])


def _failures(run: ReportedRun) -> dict[str, object]:
    """Name the failing episodes of the final evaluation."""
    chapters = run.chapters
    if not chapters.evaluation:
        return {}
    count, episodes = len(chapters.failing), chapters.evaluation["episodes"]
    broken = sum(diverged for _, _, diverged, _ in chapters.failing)
    named = ", ".join(str(number) for number, *_ in chapters.failing[:40]) + (", …" if count > 40 else "")
    lines = [f"{count} of {episodes} episodes failed" + (f": {named}." if count else ".")]
    lines += [f"In {broken} of them physics broke."] if broken else []
    return {"lines": lines, "films": films_html(run.films.get(FINAL, ()))}
