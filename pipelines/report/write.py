"""Writing a report: films first, then the page, whole or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import write_file
from roboscribe.pipelines.report.chapters import read_chapters
from roboscribe.pipelines.report.failure_films import film_failures
from roboscribe.pipelines.report.page import ReportedRun, page
from roboscribe.pipelines.runs.lookup import LoadedRun

SUFFIXES = (".html", ".htm")


def check_suffix(out: Path) -> None:
    """Refuse a file of another kind before anything is done.

    Raises:
        ArtifactError: the name ends otherwise.
    """
    if out.suffix.lower() not in SUFFIXES:
        msg = f"{out}: found suffix {out.suffix!r}, expected {' or '.join(SUFFIXES)}"
        raise ArtifactError(msg)


def write_report(found: Sequence[LoadedRun], out: Path, films: int) -> None:
    """Write a page about some runs.

    Args:
        found: the runs.
        out: file to write; its directory is made.
        films: failing episodes to film of each program that failed.

    Raises:
        ArtifactError: what was written down about a run is damaged, or the page cannot be written.
    """
    out.resolve().parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        runs = [_reported(each, Path(scratch) / str(rank), films) for rank, each in enumerate(found)]
        write_file(out, page(runs).encode())


def _reported(found: LoadedRun, scratch: Path, films: int) -> ReportedRun:
    chapters = read_chapters(found.account)
    return ReportedRun(found, chapters, film_failures(found, chapters, films, scratch))
