"""Trees, tables, strips and curves: what a reader sees is what was measured, and names are no markup."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.classifier import Refinement
from roboscribe.dsl.printer import text
from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.html.curves import Curve, Point, curves_html
from roboscribe.html.strips import MOST_ROWS, strips_html
from roboscribe.html.tables import ROWS, figures_html, refinement_html
from roboscribe.html.tree import tree_html
from roboscribe.strips import Strip, Strips, spans, strips
from roboscribe.subtask_tree import ROOT
from tests.handmade import AT, HOLD, chain, evidence, node
from tests.html.pages import read
from tests.story import candidate

EVIL = '<img src=x onerror="alert(1)">'
CHAIN = chain(node("hold", HOLD, "b1"), node("at", AT, "b1", circular=True))


def test_spans_sum_up_counts() -> None:
    assert spans(np.array([0, 0, 1, 1, 2, 0, 3])) == ((2, 4, 1), (4, 5, 2), (6, 7, 3))
    assert spans(np.array([1, 1])) == ((0, 2, 1),)
    assert spans(np.zeros(3, dtype=np.int64)) == ()


def test_strips_count_what_a_loop_has_served() -> None:
    """Three blocks are taken to their goals one after the other, 12 frames there and 12 frames back with each."""
    shown = evidence(POINT_TASKS["point-tower-3"], episodes=4)
    found = strips("at", ROOT, CHAIN, shown, 10.0)
    assert (found.most, found.frequency, len(found.rows)) == (3, 10.0, 4)
    for row in found.rows:
        assert row.frames == 1 + 3 * 24
        assert [count for _, _, count in row.spans] == [1, 2, 3]
        assert row.spans[-1][1] == row.frames
        assert row.goal >= row.spans[-1][0], "the task is solved once every block is at its goal"


def test_strips_are_drawn_row_by_row() -> None:
    rows = (Strip(20, ((5, 10, 1), (12, 20, 1)), 12), Strip(10, (), -1))
    page = read(strips_html(Strips(10.0, 1, rows), "hold", "ψ_R"))
    held = [(e.attributes["x"], e.attributes["width"]) for e in page.of("holds")]
    assert held == [("5", "5"), ("12", "8")]
    titles = [element.text for element in page.of("title")]
    assert titles == [
        "demonstration 1: hold is true 0.5 to 1.0 s, 1.2 to 2.0 s; ψ_R first reached at 1.2 s",
        "demonstration 2: hold is never true; never ψ_R",
    ]
    assert [e.text for e in page.of("axis")] == ["0 s1.0 s2.0 s"]
    many = read(strips_html(Strips(10.0, 1, rows * MOST_ROWS), "hold", "ψ_R"))
    assert len(many.of("shown")) == MOST_ROWS
    assert f"{MOST_ROWS} of {2 * MOST_ROWS} demonstrations" in many.of("legend")[0].text


def test_a_tree_shows_every_node_and_edge() -> None:
    page = read(tree_html(CHAIN))
    assert len(page.of("box")) == 4
    assert len(page.of("edge")) == 3
    assert [e.has("loop") for e in page.of("box")] == [False, False, True, False], "from the start to the task"
    words = [element.text for element in page.of("text")]
    assert words[:3] == ["start", "hold", "‖μ↓xz − b1↓xz‖ < 0.01"]
    assert words[-1] == "ψ_R, the task"


def test_a_table_says_what_was_taken_and_why_others_were_not() -> None:
    hold, at = node("hold", HOLD, "b1"), node("at", AT, "b1")
    others = [candidate(node("far", f"b1↓x > 0.{rank}")) for rank in range(1, ROWS + 2)]
    table = (candidate(at), candidate(hold), *others)
    found = Refinement(ROOT, hold, table, 10, 20, passed_over=((text(at.predicate), f"because {EVIL}"),))
    page = read(refinement_html(found))
    rows = [row for row in page.of("tr") if row.attributes or "%" in row.text]
    assert [row.attributes.get("class", "") for row in rows[:3]] == ["passed", "chosen", ""]
    assert f"because {EVIL}" in rows[0].text
    assert "taken" in rows[1].text
    assert len(rows) == len(table)
    assert page.of("summary")[0].text == f"{len(table) - ROWS} more"
    assert not page.of("img")


def test_figures_point_out_what_differs() -> None:
    page = read(figures_html([("seed", ["0", "1"]), ("task", [EVIL, EVIL])], ["a", "b"]))
    assert [row.has("chosen") for row in page.of("tr")] == [False, True, False]
    assert not page.of("img")


def test_a_curve_lies_where_it_was_measured() -> None:
    points = tuple(Point(1000.0 * k, value, value, value, f"{EVIL} {value}") for k, value in enumerate((0.0, 0.5, 1.0)))
    page = read(curves_html([Curve("one", points), Curve("two", points[:1], 1), Curve(EVIL, ())], "success"))
    ys = [float(e.attributes["cy"]) for e in page.of("circle")][:3]
    xs = [float(e.attributes["cx"]) for e in page.of("circle")][:3]
    assert ys[0] - ys[1] == pytest.approx(ys[1] - ys[2], abs=0.2)
    assert ys[0] > ys[1]
    assert xs[2] - xs[1] == pytest.approx(xs[1] - xs[0], abs=0.2)
    assert [e.text for e in page.of("legend")] == ["onetwo"]
    assert not page.of("img")
    assert {"0", "1k", "2k"} <= {e.text for e in page.of("text")}
