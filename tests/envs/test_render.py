"""Videos of rollouts: frames, captions, and what is drawn where libraries are missing."""

from __future__ import annotations

import logging
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from roboscribe.envs import graphics, render
from roboscribe.envs.scene_painter import ScenePainter
from roboscribe.envs.tasks.pick_place import PickPlace
from roboscribe.errors import TaskError
from roboscribe.world.layout import Attribute, Layout, ObjectType
from roboscribe.world.trajectory import Trajectory

TASK = PickPlace("pick-place-1")


@pytest.fixture(scope="module")
def episode() -> Trajectory:
    world, row = TASK.world(1), np.array([0])
    states, snapshots = [world.reset(row, np.array([4]))[0]], [world.save(row)[0]]
    for _ in range(3):
        states.append(world.step(row, np.array([[0.0, 1.0, 1.0, 1.0]]))[0])
        snapshots.append(world.save(row)[0])
    return Trajectory(TASK.layout, np.array(states), snapshots=np.array(snapshots))


def video(episode: Trajectory, out: Path) -> Path:
    assert episode.snapshots is not None
    return render.render_rollout(TASK, episode.states, episode.snapshots, ["π₁(b)", "π₁(b)", "until ∃b"], out)


def test_a_video_has_a_frame_for_every_state(episode: Trajectory, tmp_path: Path) -> None:
    out = video(episode, tmp_path / "deep" / "a.mp4")
    assert out == tmp_path / "deep" / "a.mp4"
    frames = iio.imread(out)
    assert frames.shape == (4, render.HEIGHT + render.CAPTION, render.WIDTH, 3)
    band = frames[:, render.HEIGHT + 5 :].astype(int)
    assert np.abs(band[0] - band[1]).mean() < np.abs(band[1] - band[2]).mean(), "another line, another caption"


def test_a_gif_is_written_when_asked(episode: Trajectory, tmp_path: Path) -> None:
    assert len(iio.imread(video(episode, tmp_path / "a.gif"))) == 4


def test_a_gif_is_written_without_an_encoder(
    episode: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(render, "_has_encoder", lambda: False)
    assert video(episode, tmp_path / "a.mp4") == tmp_path / "a.gif"
    assert "imageio-ffmpeg" in caplog.text
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


def test_a_schematic_stands_in_without_opengl(
    episode: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(graphics, "find_library", lambda _: None)
    with caplog.at_level(logging.WARNING):
        assert len(iio.imread(video(episode, tmp_path / "a.mp4"))) == 4
    assert "libegl1 or libosmesa6" in caplog.text


def test_backends_follow_the_users_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphics, "find_library", lambda name: f"lib{name}.so")
    choices = {}
    for chosen in ("", "egl", "osmesa", "disabled"):
        monkeypatch.setenv("MUJOCO_GL", chosen)
        choices[chosen] = graphics.backends()
    assert choices == {"": ["egl", "osmesa"], "egl": ["egl"], "osmesa": ["osmesa"], "disabled": []}


@pytest.mark.skipif(not graphics.backends(), reason="no OpenGL library on this machine")
def test_pictures_show_the_goal_and_the_block(episode: Trajectory) -> None:
    assert episode.snapshots is not None
    painter = render.painter(TASK)
    assert isinstance(painter, ScenePainter)
    here = painter(episode.states[0], episode.snapshots[0]).astype(int)
    away = episode.states[0].copy()
    away[-3:] = (1.4, 0.9, 0.8)
    there = painter(away, episode.snapshots[0]).astype(int)
    painter.close()
    assert here.shape == (render.HEIGHT, render.WIDTH, 3)
    red = (here[..., 0] > 2 * here[..., 1]) & (here[..., 0] > 60)
    assert red.sum() > 50, "the red block"
    changed = (np.abs(here - there).max(axis=2) > 20).sum()
    assert 50 < changed < 0.1 * here[..., 0].size, "only the goal moved"


def test_flat_worlds_are_drawn_from_above() -> None:
    place = Attribute("position", ("x", "y"))
    layout = Layout(ObjectType("EE", (place,)), (ObjectType("dot", (place,), (place,)),))
    one = render.SchematicPainter(layout)(np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0]), np.zeros(0))
    two = render.SchematicPainter(layout)(np.array([0.0, 0.0, 1.5, 0.0, 2.0, 2.0]), np.zeros(0))
    assert one.shape == (render.HEIGHT, render.WIDTH, 3)
    assert (one != two).any()


def test_long_lines_are_cut() -> None:
    frame = np.zeros((20, 200, 3), dtype=np.uint8)
    captioned = render.caption(frame, "x" * 500)
    assert captioned.shape == (20 + render.CAPTION, 200, 3)
    assert (captioned[20:, 195:] == captioned[20, -1]).all(), "nothing runs over the edge"


def test_counts_must_agree(episode: Trajectory, tmp_path: Path) -> None:
    assert episode.snapshots is not None
    with pytest.raises(TaskError, match="4 states, 4 snapshots, 2 lines"):
        render.render_rollout(TASK, episode.states, episode.snapshots, ["a", "b"], tmp_path / "a.mp4")
