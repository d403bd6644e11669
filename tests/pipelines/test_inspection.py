"""runs, show, diff and report: what was done is found by any of its names, and told."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.errors import ArtifactError
from roboscribe.io.demonstrations import write_demonstrations
from roboscribe.pipelines.report.chapters import Attempt, read_chapters
from roboscribe.pipelines.report.films import Film
from roboscribe.pipelines.report.page import ReportedRun, page
from roboscribe.pipelines.runs.lookup import LoadedRun, list_runs, open_run
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.runtime.events import Refined
from roboscribe.stages.tracking.event_log import CHRONICLE
from roboscribe.stages.tracking.mlflow_store import JOURNAL, synchronise
from roboscribe.world.trajectory import Trajectory
from tests.html.pages import Page, read
from tests.pipelines.runs import Command, run, scripted
from tests.pipelines.stores import empty_store, rows

EVIL = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a home with two runs of one task."""
    home = tmp_path_factory.mktemp("home")
    run(scripted(), home)
    shutil.copytree(home / "program", home / "first")
    run(scripted(seed=1), home)
    return home


def reported(name: str, home: Path) -> ReportedRun:
    with open_run(name, Workspace(home)) as found:
        return ReportedRun(found, read_chapters(found.account))


def key(home: Path, seed: int) -> str:
    runs = (run for run in list_runs(Workspace(home)) if run.key != "abcd")
    return next(run.key for run in runs if run.account.about["plan"]["seed"] == seed)


def test_runs_lists_the_latest_first(command: Command, home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("runs", "--home", home, "--json", home / "runs.json") == 0
    title, *lines = capsys.readouterr().out.splitlines()
    assert title.split()[:3] == ["run", "task", "seed"]
    assert [line.split()[:5] for line in lines] == [
        [key(home, seed)[:8], "point-pick-place-1", str(seed), "scripted", "finished"] for seed in (1, 0)
    ]
    assert [row["seed"] for row in json.loads((home / "runs.json").read_text())] == ["1", "0"]


def test_show_tells_the_story_again(command: Command, home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("show", key(home, 0)[:6], "--home", home) == 0
    chapters = capsys.readouterr().out
    for told in ("12 of 12 demonstrations", "refinement 2:", "reached ψ_R in 20 of 20 episodes", "π_hold(μ, b) until"):
        assert told in chapters


def test_a_run_is_found_by_every_name_it_has(home: Path) -> None:
    first = key(home, 0)
    for name in (first, first[:5], str(home / "data" / "runs" / first), str(home / "first")):
        with open_run(name, Workspace(home)) as found:
            assert found.account is not None, name
            assert found.account.about["plan"]["seed"] == 0
            assert found.program is not None
    with open_run("tower-5", Workspace(home)) as found:
        assert (found.account, found.manifest["task"]) == (None, "tower-5")


def test_an_edited_program_still_belongs_to_its_run(home: Path, tmp_path: Path) -> None:
    shutil.copytree(home / "first", tmp_path / "edited")
    (tmp_path / "edited" / "program.txt").write_text("def Mine(μ : EE): skip\n")
    shown = reported(str(tmp_path / "edited"), home)
    assert shown.found.account is not None
    assert next(row.text for row in read(page([shown])).of("row")) == "def Mine(μ : EE): skip"


def test_a_run_of_another_machine_is_read_from_the_store(home: Path, tmp_path: Path) -> None:
    """Chronicle and program are artifacts, so that a report needs nothing but the tracking store."""
    mlruns = empty_store(tmp_path / "mlruns")
    first = key(home, 0)
    shutil.copytree(home / "data" / "runs" / first, tmp_path / "runs" / first)
    synchronise(tmp_path / "runs", mlruns)
    [(run_id,)] = rows(mlruns, "select run_uuid from runs where name = 'point-pick-place-1 seed 0'")
    shown = reported(str(run_id), tmp_path)
    assert len(shown.chapters.refinements) == 2
    assert "π_hold" in shown.text


@pytest.mark.parametrize("name", ["nothing", "0" * 32, "abcd"])
def test_what_is_not_there_is_refused(home: Path, name: str) -> None:
    with pytest.raises(ArtifactError, match=f"run {name}"):
        reported(name, home)


def test_chapters_tell_what_was_tried_and_learned(home: Path) -> None:
    chapters = reported(key(home, 0), home).chapters
    kinds = [type(chapter) for chapter in chapters.read_chapters]
    assert kinds[:2] == [Attempt, Refined], "an attempt fails, and a subgoal is learned from it"
    assert chapters.solving[0].rate < 0.5
    assert chapters.solving[-1].rate == 1.0
    steps = [attempt.steps for attempt in chapters.tried]
    assert steps == sorted(steps)
    assert steps[0] > 0
    first = chapters.read_chapters[0]
    assert isinstance(first, Attempt)
    assert len(first.failing) == first.counts["episodes"] - first.counts["successes"]


def test_diff_shows_text_configuration_and_figures(
    command: Command, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(home / "edited", ignore_errors=True)
    shutil.copytree(home / "first", home / "edited")
    program = home / "edited" / "program.txt"
    program.write_text(program.read_text().replace("  hold(", "  # by hand\n  hold("))
    assert command("diff", key(home, 0), key(home, 1), "--home", home) == 0
    between = capsys.readouterr().out
    assert "seed  0 → 1" in between
    assert "demonstrations " not in between.split("figures")[0]
    assert command("diff", home / "first", home / "edited", "--home", home) == 0
    edited = capsys.readouterr().out
    assert "+  # by hand" in edited
    assert "configuration: no difference" in edited
    assert command("diff", home / "first", home / "first", "--home", home) == 0
    assert "the programs are the same" in capsys.readouterr().out


def test_runs_that_found_nothing_or_were_killed_are_told(
    command: Command, home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    demos, other = tmp_path / "d.parquet", Workspace(tmp_path / "home")
    task = POINT_TASKS["point-pick-place-1"]
    shown = [Trajectory(each.layout, each.states[:6]) for each in task.demonstrate(4, 0)]
    write_demonstrations(demos, task.name, task.layout, task.frequency, shown, generator="test", seed=None)
    run(scripted(demonstrations=demos), other.path)
    killed = other.data / "runs" / "abcd"
    shutil.copytree(home / "data" / "runs" / key(home, 0), killed)
    for name in (CHRONICLE, JOURNAL):
        lines = (killed / name).read_bytes().splitlines(keepends=True)
        (killed / name).write_bytes(b"".join(lines[:8]) + lines[8][:20])
    (other.data / "runs" / "ffff").mkdir()
    (other.data / "runs" / "ffff" / CHRONICLE).touch()
    assert {each.key: each.status for each in list_runs(other)} == {"abcd": "KILLED", key(other.path, 0): "FAILED"}
    failed = page([reported(key(other.path, 0), other.path)])
    assert "No program: none of the 4 demonstrations" in failed
    assert "The run is killed." in page([reported("abcd", other.path)])
    assert command("show", key(other.path, 0), "--home", other.path) == 0
    assert "FAIL: none of the 4 demonstrations" in capsys.readouterr().out


def links(shown: Page) -> list[str]:
    """List everything that a browser would load or follow."""
    names = ("src", "href", "action", "data", "poster", "srcset")
    return [e.attributes[name] for e in shown.elements for name in names if name in e.attributes]


def test_a_report_needs_nothing_but_itself(command: Command, home: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "report.html"
    assert command("report", key(home, 0), "--home", home, "--out", out, "--films", 0) == 0
    text = out.read_text()
    shown = read(text)
    assert not shown.of("script")
    assert not shown.of("link")
    assert "url(" not in text
    assert "@import" not in text
    assert all(link.startswith(("data:", "#")) for link in links(shown))
    assert len(shown.of("strips")) == 2
    assert [e.text for e in shown.of("h4")][:2] == [
        "π_R reached ψ_R in 0 of 20 episodes", "Refinement 1: hold becomes a subgoal of ψ_R",
    ]  # fmt: skip
    assert len(shown.of("ranked")) >= 2


def test_several_runs_stand_side_by_side(command: Command, home: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    assert command("report", key(home, 0), "tower-5", "--home", home, "--out", out, "--films", 0) == 0
    shown = read(out.read_text())
    assert len(shown.of("article")) == 2
    assert len(shown.of("run")) == 2
    marked = [row.text for row in shown.of("marked")]
    assert any("while" in line for line in marked)
    assert not any(line.startswith("where") for line in marked), "both have it"
    assert "How this program was found is not known here" in out.read_text()


def test_names_in_reports_are_no_markup(home: Path, tmp_path: Path) -> None:
    """Row 20: a crafted program, reason, name or caption is shown as it is."""
    crafted = tmp_path / "x"
    shutil.copytree(home / "data" / "runs" / key(home, 0), crafted)
    path = crafted / CHRONICLE
    records = [json.loads(line) for line in path.read_text().splitlines()]
    kept = [json.dumps({name: value for name, value in record.items() if name != "sum"}) for record in records]
    path.write_text("\n".join([*kept, ""]).replace("point-pick-place-1", EVIL).replace("scripted", EVIL))
    with open_run(str(crafted), Workspace(home)) as found:
        assert found.program is not None
        named = LoadedRun(EVIL, found.directory, found.program, found.account, EVIL)
        film = tmp_path / "a.gif"
        film.write_bytes(b"GIF89a")
        shown = read(page([ReportedRun(named, read_chapters(found.account), {-1: [Film(film, EVIL)]})]))
    assert EVIL in shown.of("h1")[0].text
    assert [e.attributes["src"][:14] for e in shown.of("img")] == ["data:image/gif"]
    assert not any(name.startswith("on") for e in shown.elements for name in e.attributes)


@pytest.mark.parametrize("out", ["report.pdf", "report"])
def test_another_suffix_is_refused_at_once(
    command: Command, home: Path, capsys: pytest.CaptureFixture[str], out: str
) -> None:
    assert command("report", "nothing", "--home", home, "--out", out) == 2
    assert "expected .html or .htm" in capsys.readouterr().err


BROWSER = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), "")
FRAME = (
    "<!DOCTYPE html><body><iframe srcdoc='{page}' width='390' height='800'></iframe><script>onload = () => {{"
    "const page = document.querySelector('iframe').contentDocument, body = page.body;"
    "const wide = page.documentElement.scrollWidth, dark = getComputedStyle(body).backgroundColor;"
    "document.body.dataset.seen = [wide, dark].join('|') }}</script>"
)


@pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine (Debian package: chromium)")
@pytest.mark.parametrize(("scheme", "paper"), [("1", "rgb(255, 255, 255)"), ("0", "rgb(20, 24, 31)")])
def test_a_browser_shows_it_at_phone_width_light_and_dark(home: Path, tmp_path: Path, scheme: str, paper: str) -> None:
    report = page([reported(key(home, 0), home)]).replace("&", "&amp;").replace("'", "&#39;")
    (tmp_path / "frame.html").write_text(FRAME.format(page=report))
    words = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--blink-settings=preferredColorScheme={scheme}"]
    words += [f"--user-data-dir={tmp_path / 'browser'}", "--virtual-time-budget=3000", "--dump-dom"]
    ended = subprocess.run([*words, f"file://{tmp_path / 'frame.html'}"], capture_output=True, text=True, timeout=60)
    [body] = [e for e in read_loosely(ended.stdout).of("body") if "data-seen" in e.attributes]
    width, background = body.attributes["data-seen"].split("|")
    assert int(width) <= 390, "nothing sticks out"
    assert background == paper


def read_loosely(html: str) -> Page:
    """Parse what a browser prints."""
    shown = Page()
    shown.feed(html)
    return shown
