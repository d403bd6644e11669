"""Films: pictures and panels, what is drawn where libraries are missing, and files."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.replay import Moment
from roboscribe.envs import graphics, render, schematic
from roboscribe.envs.panel import BAD, BUSY, GOOD, LIT, Frame, Panel, RecordedEpisode
from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.envs.scene_painter import ScenePainter
from roboscribe.envs.tasks.pick_place import PickPlace
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, Layout, ObjectType

TASK = PickPlace("pick-place-1")
FLAT = POINT_TASKS["point-tower-3"]
SIZE = (320, 180)
PROGRAM = parse_program(
    "def P(μ : EE): b := get(λb:block. true); π_hold(μ, b) until ‖μ↓xyz − b↓xyz‖ < 0.02;"
    "π_at(μ, b, g(b)) until ‖b↓xyz − g(b)↓xyz‖ < 0.05"
)
LOOP = parse_program(
    "def Tower(μ : EE): while (b := get(λb:block. ¬(‖b↓xz − g(b)↓xz‖ < 0.02))) ≠ null "
    "{ π_hold(μ, b) until ‖μ↓xz − b↓xz‖ < 0.0125; π_at(μ, b, g(b)) until ‖b↓xz − g(b)↓xz‖ < 0.02 }"
)


@pytest.fixture(scope="module")
def take() -> RecordedEpisode:
    """Record four states, the second controller in the last two."""
    world, row = TASK.world(1), np.array([0])
    states, snapshots = [world.reset(row, np.array([4]))[0]], [world.save(row)[0]]
    for _ in range(3):
        states.append(world.step(row, np.array([[0.0, 1.0, 1.0, 1.0]]))[0])
        snapshots.append(world.save(row)[0])
    moments = tuple(Moment(run, {"b": 0}, ended=False) for run in (0, 0, 1, 1))
    return RecordedEpisode(np.array(states), np.array(snapshots), moments, True, "episode 7")


@pytest.fixture
def no_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the graphics libraries."""
    monkeypatch.setattr(graphics, "find_library", lambda _: None)


def frames(take: RecordedEpisode) -> Iterator[Frame]:
    return render.film_episode(TASK, PROGRAM, take, SIZE)


def colored(frame: Frame, color: tuple[int, int, int]) -> int:
    """Count pixels of a colour."""
    return int((np.abs(frame.astype(int) - color).max(axis=-1) < 3).sum())


def test_a_film_has_a_frame_for_every_state_and_holds_the_last(
    take: RecordedEpisode, no_opengl: None, tmp_path: Path
) -> None:
    out = render.write_video(frames(take), tmp_path / "deep" / "a.mp4", TASK.frequency)
    assert out == tmp_path / "deep" / "a.mp4"
    film = iio.imread(out)
    assert film.shape == (4 + round(TASK.frequency), SIZE[1], SIZE[0], 3), "a second of 25 frames"
    assert iio.immeta(out)["fps"] == TASK.frequency


def test_the_panel_lights_the_line_that_acts(take: RecordedEpisode) -> None:
    panel = Panel(TASK, PROGRAM, take, (560, 720))
    first, second, third = (panel.draw(index) for index in (0, 1, 2))
    rows = [np.flatnonzero((frame == LIT).all(axis=-1).any(axis=1)) for frame in (first, second, third)]
    assert len(rows[0]) > 10
    assert rows[0].tolist() == rows[1].tolist()
    assert rows[2].min() > rows[0].min(), "the second controller stands below the first"


def test_the_panel_shows_values_and_how_it_ended(take: RecordedEpisode) -> None:
    panel = Panel(TASK, PROGRAM, take, (560, 720))
    assert colored(panel.draw(0), BUSY) > 100, "a bar of what does not hold yet"
    assert colored(panel.draw(0), GOOD) == 0
    assert colored(panel.draw(3), GOOD) > 10_000, "solved"
    lost = Panel(TASK, PROGRAM, replace(take, solved=False), (560, 720))
    assert colored(lost.draw(3), BAD) > 10_000


def test_the_panel_shows_of_whom_a_guard_holds() -> None:
    state = FLAT.world(1).reset(np.array([0]), np.array([3]))[0]
    done = state.copy()
    for entity in (0, 2):
        done[FLAT.layout.columns[entity, "position", False]] = done[FLAT.layout.columns[entity, "position", True]]
    moments = (Moment(0, {"b": 1}, ended=False),) * 2
    panel = Panel(
        FLAT, LOOP, RecordedEpisode(np.stack([state, done]), np.zeros((2, 0)), moments, True, "e"), (560, 720)
    )
    all_three, one = (colored(panel.draw(0), GOOD), colored(panel.draw(1)[:600], GOOD))
    assert 2.5 * one < all_three < 3.5 * one


def test_a_program_that_is_over_is_drawn() -> None:
    """A loop that ends leaves its variable null, and its last controller acting."""
    state = FLAT.world(1).reset(np.array([0]), np.array([3]))
    take = RecordedEpisode(state, np.zeros((1, 0)), (Moment(1, {}, ended=True),), True, "e")
    assert Panel(FLAT, LOOP, take, (560, 720)).draw(0).shape == (720, 560, 3)


@pytest.mark.parametrize("width", [200, 420, 560])
def test_long_lines_are_broken(width: int) -> None:
    state = FLAT.world(1).reset(np.array([0]), np.array([3]))
    take = RecordedEpisode(state, np.zeros((1, 0)), (Moment(0, {"b": 1}, ended=False),), True, "e")
    drawn = Panel(FLAT, LOOP, take, (width, 540)).draw(0)
    assert (drawn[60:400, -6:] == drawn[60, -1]).all(), "nothing runs over the edge"


def test_a_grid_shows_every_episode_to_its_end(take: RecordedEpisode, no_opengl: None) -> None:
    short = RecordedEpisode(take.states[:2], take.snapshots[:2], take.moments[:2], False, "episode 8")
    drawn = list(render.film_grid(TASK, [take, short], 2, (640, 240)))
    assert len(drawn) == 4 + round(TASK.frequency)
    left, right = drawn[2][:, :320], drawn[2][:, 320:]
    assert colored(left, GOOD) == 0
    assert colored(right, BAD) > 1000, "it is over and stays"
    assert colored(drawn[-1][:, :320], GOOD) > 1000


def test_thinned_films_keep_the_last_state(take: RecordedEpisode) -> None:
    thin = take.thinned(2)
    assert np.array_equal(thin.states, take.states[[0, 2, 3]])
    assert (len(thin.moments), thin.every, thin.steps) == (3, 2, (0, 2, 3))
    assert thin.thinned(2).steps == (0, 3)


def test_a_gif_is_written_when_asked(take: RecordedEpisode, no_opengl: None, tmp_path: Path) -> None:
    out = render.write_video(frames(take), tmp_path / "a.gif", TASK.frequency)
    assert out.read_bytes().startswith(b"GIF89a")
    assert iio.immeta(out)["duration"] == 80, "every second frame of 25 a second, milliseconds"


def test_a_gif_is_written_without_an_encoder(
    take: RecordedEpisode,
    no_opengl: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(render, "_has_encoder", lambda: False)
    assert render.write_video(frames(take), tmp_path / "a.mp4", TASK.frequency) == tmp_path / "a.gif"
    assert "imageio-ffmpeg" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


def test_a_poster_is_the_last_picture(take: RecordedEpisode, no_opengl: None, tmp_path: Path) -> None:
    out = render.write_video(frames(take), tmp_path / "a.mp4", TASK.frequency)
    picture = iio.imread(render.poster(out), extension=".jpg").astype(int)
    last = iio.imread(out)[-1].astype(int)
    assert picture.shape == last.shape
    assert np.abs(picture - last).mean() < 10


def test_a_schematic_stands_in_without_opengl(
    take: RecordedEpisode, no_opengl: None, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        assert len(list(frames(take))) == 4 + round(TASK.frequency)
    assert "libegl1 or libosmesa6" in caplog.text


def test_what_rests_stays_where_it_is_in_a_schematic() -> None:
    """Row 4: axes are those of the whole episode."""
    place = Attribute("position", ("x", "y"))
    layout = Layout(ObjectType("EE", (place,)), (ObjectType("dot", (place,), (place,)),))
    states = np.array([[0.0, 0.0, 1.0, 1.0, 2.0, 2.0], [3.0, 0.5, 1.0, 1.0, 2.0, 2.0]])
    painter = render.SchematicPainter(layout, states, (400, 300))
    here, there = painter(states[0], np.zeros(0)), painter(states[1], np.zeros(0))
    red = [np.argwhere((frame == (214, 39, 40)).all(axis=-1)) for frame in (here, there)]
    assert len(red[0]) > 50
    assert np.array_equal(red[0], red[1]), "the dot did not move"
    assert (here != there).any(), "the robot did"
    bounds = schematic.limits(layout, states)
    assert (bounds[0] < states[:, :2].min(axis=0)).all()
    assert (bounds[1] > (3.0, 2.0)).all()


def test_backends_follow_the_users_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphics, "find_library", lambda name: f"lib{name}.so")
    choices = {}
    for chosen in ("", "egl", "osmesa", "disabled"):
        monkeypatch.setenv("MUJOCO_GL", chosen)
        choices[chosen] = graphics.backends()
    assert choices == {"": ["egl", "osmesa"], "egl": ["egl"], "osmesa": ["osmesa"], "disabled": []}


@pytest.mark.skipif(not graphics.backends(), reason="no OpenGL library on this machine")
def test_pictures_show_the_goal_the_block_and_what_is_pointed_at(take: RecordedEpisode) -> None:
    painter = render.painter(TASK, take.states, (480, 480))
    assert isinstance(painter, ScenePainter)
    here = painter(take.states[0], take.snapshots[0]).astype(int)
    away = take.states[0].copy()
    away[-3:] = (1.4, 0.9, 0.8)
    there = painter(away, take.snapshots[0]).astype(int)
    painter.point_at([take.states[0, 7:10]])
    pointed = painter(take.states[0], take.snapshots[0]).astype(int)
    painter.close()
    assert here.shape == (480, 480, 3)
    red = (here[..., 0] > 2 * here[..., 1]) & (here[..., 0] > 60)
    assert red.sum() > 50, "the red block"
    changed = (np.abs(here - there).max(axis=2) > 20).sum()
    assert 50 < changed < 0.1 * here[..., 0].size, "only the goal moved"
    outlined = (np.abs(here - pointed).max(axis=2) > 20).sum()
    assert 20 < outlined < 0.02 * here[..., 0].size, "edges around the block"


def test_counts_must_agree(take: RecordedEpisode) -> None:
    with pytest.raises(TaskError, match="4 states, 4 snapshots, 2 moments"):
        next(frames(replace(take, moments=take.moments[:2])))


@pytest.mark.parametrize("name", ["a.avi", "a", "a.mp3"])
def test_another_suffix_is_refused(name: str) -> None:
    with pytest.raises(TaskError, match=r"expected \.mp4 or \.gif"):
        render.check_suffix(Path(name))
