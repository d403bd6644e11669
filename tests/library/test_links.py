"""What the pages lead to is there: files, headings, and the code that a departure names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.library.pages import DOCS

ROOT = DOCS.parent
PAGES = (ROOT / "README.md", *sorted(DOCS.glob("*.md")))
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]+)\)")


def anchor(heading: str) -> str:
    """Return the name under which a heading is linked to."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for _, target in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, heading = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), f"{page.name}: {target} is not there"
        if heading:
            headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in map(anchor, headings), f"{page.name}: {target} names no heading"


def test_departures_name_code_that_is_there() -> None:
    found = re.findall(r"\[`(\w+)`\]\(\.\./(roboscribe/[\w/]+\.py)\)", (DOCS / "departures.md").read_text("utf-8"))
    assert len(found) > 40
    for name, path in found:
        assert re.search(rf"(def|class) {name}\b", (ROOT / path).read_text("utf-8")), f"{path} has no {name}"


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 150
