"""The page of results: what reports say, what is missing, and nothing of quick runs."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from roboscribe.errors import ArtifactError
from roboscribe.pipelines.paper.results import write_results
from roboscribe.stages.paper.report import About, Report, report_files
from tests.pipelines.runs import contents

COMPLETE = "roboscribe paper demos"


def leave(reports: Path, folder: str, name: str, command: str, *, quick: bool = False) -> None:
    """Leave a report as an experiment does."""
    table = pd.DataFrame({"task": ["tower-5"], "success": [0.76]})
    report = Report(table, f"| tower-5 | 76.0 |\n\n## Beside the paper\n\n{folder} says", {f"{name}.png": b"picture"})
    about = About(name, command, "abc1234", quick, since=("- nothing changed",))
    (reports / folder).mkdir(parents=True)
    for file, data in report_files(report, about).items():
        (reports / folder / file).write_bytes(data)


def test_the_page_shows_reports_and_what_completes_them(tmp_path: Path) -> None:
    reports, out = tmp_path / "paper", tmp_path / "docs"
    leave(reports, "demos", "demos", COMPLETE)
    leave(reports, "curves-clones", "curves", "roboscribe paper curves --method bc --seeds 3")
    leave(reports, "towers-quick", "towers", "roboscribe paper towers --quick", quick=True)
    page = write_results(reports, out).read_text()
    first, second, rest = page.index("## demos"), page.index("## curves-clones"), page.index("## Not run yet")
    assert first < second < rest
    assert f"`{COMPLETE}` at abc1234" in page
    assert "A part of the experiment. All of it: `roboscribe paper curves`." in page
    assert "All of it: `roboscribe paper demos`" not in page
    assert page[rest:].splitlines()[2:] == [
        f"- {name}: `roboscribe paper {name}`" for name in ("table1", "confined", "towers")
    ]
    assert "### Beside the paper" in page
    assert "nothing changed" not in page
    assert "quick" not in page
    assert set(contents(out)) == {
        "results.md", "results/demos/demos.csv", "results/demos/demos.png",
        "results/curves-clones/curves.csv", "results/curves-clones/curves.png",
    }  # fmt: skip
    before = contents(out)
    write_results(reports, out)
    assert contents(out) == before


def test_a_report_without_text_is_refused(tmp_path: Path) -> None:
    leave(tmp_path, "demos", "demos", COMPLETE)
    (tmp_path / "demos" / "demos.md").unlink()
    with pytest.raises(ArtifactError, match="found 0 reports"):
        write_results(tmp_path, tmp_path / "docs")
