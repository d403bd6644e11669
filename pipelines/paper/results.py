"""A page of results: what the reports of finished experiments say, and the commands that complete them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roboscribe.errors import ArtifactError
from roboscribe.io.atomic import write_files
from roboscribe.pipelines.paper.everything import EXPERIMENTS
from roboscribe.stages.paper.report import MANIFEST
from roboscribe.stages.runtime.files import read_json

PAGE, FIGURES = "results.md", "results"
"""The page, and the directory beside it for tables and pictures."""
SINCE = "## Since the last run"
"""Heading of a report's last part, which says nothing about the results."""
INTRODUCTION = """# Results

Written by `roboscribe paper results` from the reports in `data/paper`. Every part names the command that made it and
the commit of the sources; the same command with the same sources makes the same table, seconds aside. Figures of the
paper are its own, the others were measured here.
"""


@dataclass(frozen=True)
class Part:
    """A finished experiment.

    Args:
        name: of the experiment.
        directory: of its report.
        manifest: what the report says about its run.
    """

    name: str
    directory: Path
    manifest: Mapping[str, Any]

    @property
    def folder(self) -> str:
        """Where its files go."""
        return self.directory.name

    @property
    def files(self) -> dict[str, bytes]:
        """Its table and pictures by name, in order of their names."""
        kept = (path for path in sorted(self.directory.iterdir()) if path.suffix in (".csv", ".png", ".svg"))
        return {path.name: path.read_bytes() for path in kept}

    @property
    def whole(self) -> bool:
        """Whether the run is all of the experiment."""
        return str(self.manifest["command"]) == f"roboscribe paper {self.name}"

    def text(self) -> str:
        """Say what was found, in Markdown."""
        body = (self.directory / f"{self.name}.md").read_text().partition("\n")[2].partition(SINCE)[0].strip()
        pictures = [name for name in self.files if name.endswith(".png")]
        shown = [f"![{name.removesuffix('.png')}]({FIGURES}/{self.folder}/{name})" for name in pictures]
        tables = ", ".join(f"[{name}]({FIGURES}/{self.folder}/{name})" for name in self.files if name.endswith(".csv"))
        parts = [f"## {self.folder}", body.replace("\n## ", "\n### "), *shown, f"Every measurement: {tables}."]
        if not self.whole:
            parts.append(f"A part of the experiment. All of it: `roboscribe paper {self.name}`.")
        return "\n\n".join(parts)


def write_results(reports: Path, out: Path) -> Path:
    """Write `results.md` into a directory, and beside it the tables and pictures that it shows.

    Args:
        reports: directory of the experiments' reports; those of quick runs are no results and left out.
        out: directory of the page.

    Returns:
        The page.

    Raises:
        ArtifactError: a report lacks a file.
    """
    parts = found_parts(reports)
    done = {part.name for part in parts}
    missing = [f"- {name}: `roboscribe paper {name}`" for name in EXPERIMENTS if name not in done]
    ending = ["\n".join(["## Not run yet", "", *missing])] if missing else []
    text = "\n\n".join([INTRODUCTION.strip(), *(part.text() for part in parts), *ending]) + "\n"
    files = {out / FIGURES / part.folder / name: data for part in parts for name, data in part.files.items()}
    for path in files:
        path.parent.mkdir(parents=True, exist_ok=True)
    out.mkdir(parents=True, exist_ok=True)
    write_files({**files, out / PAGE: text.encode()})
    return out / PAGE


def found_parts(reports: Path) -> list[Part]:
    """List the reports that are results, in the order of the experiments, parts of them by the names of directories.

    Raises:
        ArtifactError: a report has no text.
    """
    found = [part for path in sorted(reports.glob(f"*/{MANIFEST}")) for part in _part(path)]
    return sorted(found, key=lambda part: (_rank(part.name), part.folder))


def _part(path: Path) -> Iterable[Part]:
    manifest = read_json(path)
    if manifest["quick"]:
        return
    texts = [name for name in EXPERIMENTS if (path.parent / f"{name}.md").is_file()]
    if len(texts) != 1:
        msg = f"{path.parent}: found {len(texts)} reports, expected one of {', '.join(f'{n}.md' for n in EXPERIMENTS)}"
        raise ArtifactError(msg)
    yield Part(texts[0], path.parent, manifest)


def _rank(name: str) -> int:
    return list(EXPERIMENTS).index(name)
