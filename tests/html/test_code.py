"""Program text with colours and hover texts."""

from __future__ import annotations

import pytest

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import pretty
from roboscribe.html.code import code_html, formula_html, program_html
from tests.html.pages import read

TOWER = parse_program(
    "def Tower(μ : EE): while (b := get(λb:block. ¬(‖b↓xz − g(b)↓xz‖ < 0.02))) ≠ null "
    "{ π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.0125; π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02 }"
)
HOSTILE = '<script>alert(1)</script> " onmouseover="x & π_<b>'


def test_a_program_reads_as_it_prints() -> None:
    rows = read(program_html(TOWER)).of("row")
    indents = [len(line) - len(line.lstrip()) for line in pretty(TOWER).splitlines()]
    assert [row.text for row in rows] == [line.strip() for line in pretty(TOWER).splitlines()]
    assert [row.attributes["style"] for row in rows] == [f"--in:{indent}" for indent in indents]


def test_words_say_what_they_mean() -> None:
    page = read(program_html(TOWER, {"π_hold": "cloned from 50 demonstrations"}))
    tips = {element.text: element.attributes.get("data-tip", "") for element in page.of("span")}
    assert tips["π_hold"] == "cloned from 50 demonstrations"
    assert tips["π_at"] == "learned controller; acts until ‖b↓xz − g(b)↓xz‖ < 0.02"
    assert tips["at"] == "at(b) ≡ ‖b↓xz − g(b)↓xz‖ < 0.02"
    assert "entity" in tips["get"]
    kinds = {element.text: element.attributes["class"] for element in page.of("span")}
    assert (kinds["while"], kinds["π_hold"], kinds["at"], kinds["0.02"], kinds["↓xz"]) == (
        "keyword", "controller", "predicate", "number", "field",
    )  # fmt: skip


def test_marked_lines_are_marked() -> None:
    rows = read(code_html("a\nb\nc\n", marked=[1])).of("row")
    assert [row.has("marked") for row in rows] == [False, True, False]


@pytest.mark.parametrize("show", [code_html, formula_html, lambda text: code_html("x", {"x": text})])
def test_text_is_no_markup(show: object) -> None:
    """Row 20: whatever stands in a program or a hover text is shown as it is."""
    assert callable(show)
    page = read(show(HOSTILE))
    assert {element.tag for element in page.elements} <= {"div", "code", "span"}
    assert all(set(e.attributes) <= {"class", "style", "data-tip", "tabindex"} for e in page.elements)
    shown = page.elements[0].text + "".join(e.attributes.get("data-tip", "") for e in page.elements)
    assert HOSTILE in shown
