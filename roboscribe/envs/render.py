"""Video of a rollout with the line of the program that acts written into every frame.

MuJoCo draws through EGL or OSMesa where one of these libraries is installed; elsewhere a schematic is drawn. The file
is an MP4 where imageio finds an encoder, else a GIF.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from roboscribe.envs import fetch, graphics, schematic
from roboscribe.envs.engine import INTEGRATION
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, Layout
from roboscribe.world.protocols import Task

Frame: TypeAlias = NDArray[np.uint8]
"""RGB image (H, W, 3)."""

WIDTH, HEIGHT = 640, 480
CAPTION = 40
"""Height of the band with the program's line, pixels."""
log = logging.getLogger(__name__)


def caption(frame: Frame, line: str) -> Frame:
    """Write one line of text under a frame; a line that is too long ends in an ellipsis."""
    image = Image.new("RGB", (frame.shape[1], frame.shape[0] + CAPTION), (20, 22, 28))
    image.paste(Image.fromarray(frame), (0, 0))
    draw = ImageDraw.Draw(image)
    font = _font()
    shown = line
    while shown and draw.textlength(shown, font=font) > frame.shape[1] - 20:
        shown = shown[:-2] + "…" if shown.endswith("…") else shown[:-1] + "…"
    draw.text((10, frame.shape[0] + CAPTION // 2), shown, fill=(240, 240, 240), font=font, anchor="lm")
    return np.asarray(image)


def _font() -> ImageFont.FreeTypeFont:
    """Load a monospaced font with the logical symbols; matplotlib ships it."""
    from matplotlib import get_data_path

    return ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSansMono.ttf"), 16)


class ScenePainter:
    """Draws Fetch scenes with MuJoCo; goals are translucent spheres in their blocks' colours."""

    def __init__(self, layout: Layout, context: graphics.Context) -> None:
        """Prepare the scene and the camera."""
        self._layout = layout
        self._model = mujoco.MjModel.__copy__(fetch.base_model(len(layout.entities)))
        self._dress()
        self._data = mujoco.MjData(self._model)
        self._size = mujoco.mj_stateSize(self._model, INTEGRATION)
        self._camera = graphics.Camera(self._model, context, (WIDTH, HEIGHT))
        view = self._camera.view
        view.lookat[:] = (1.33, 0.75, 0.6)
        view.distance, view.azimuth, view.elevation = 1.5, 145.0, -22.0

    def _dress(self) -> None:
        """Colour the blocks; hide the scene's own markers and the mocap's cross."""
        model = self._model
        for index in range(len(self._layout.entities)):
            geom = model.geom(f"object{index}")
            geom.matid, geom.rgba = -1, fetch.block_color(index)
        model.site_rgba[:, 3] = 0
        model.geom_rgba[model.geom_bodyid == model.body("robot0:mocap").id, 3] = 0

    def __call__(self, state: FloatArray, snapshot: FloatArray) -> Frame:
        """Draw the snapshot (its first numbers are an integration state) with the goals that the state names."""
        mujoco.mj_setState(self._model, self._data, np.ascontiguousarray(snapshot[: self._size]), INTEGRATION)
        mujoco.mj_forward(self._model, self._data)
        self._camera.aim(self._data)
        for index in range(len(self._layout.entities)):
            place = state[self._layout.columns[index, "position", True]]
            self._camera.add_sphere(place, 0.03, (*fetch.block_color(index)[:3], 0.45))
        return self._camera.shoot()

    def close(self) -> None:
        """Give back what the graphics library holds."""
        self._camera.close()


class SchematicPainter:
    """Draws any task's positions without OpenGL."""

    def __init__(self, layout: Layout) -> None:
        """Remember what the columns mean."""
        self._layout = layout

    def __call__(self, state: FloatArray, snapshot: FloatArray) -> Frame:
        """Draw the state; the snapshot is not needed."""
        del snapshot
        return schematic.draw(self._layout, state, WIDTH, HEIGHT)

    def close(self) -> None:
        """Nothing is held."""


def painter(layout: Layout) -> ScenePainter | SchematicPainter:
    """Choose MuJoCo's pictures for Fetch scenes where OpenGL works, the schematic elsewhere."""
    if layout != fetch.layout(len(layout.entities)):
        return SchematicPainter(layout)
    context = graphics.open_context(WIDTH, HEIGHT)
    return SchematicPainter(layout) if context is None else ScenePainter(layout, context)


def write_video(frames: Sequence[Frame], out: Path, frequency: float) -> Path:
    """Write frames as MP4, or as GIF where `out` says so or no encoder is found; return the file written."""
    import imageio.v3 as iio

    out.parent.mkdir(parents=True, exist_ok=True)
    if out.suffix.lower() != ".gif" and _has_encoder():
        iio.imwrite(out, np.stack(frames), fps=frequency, plugin="FFMPEG", macro_block_size=8)
        return out
    if out.suffix.lower() != ".gif":
        log.warning("no video encoder (package imageio-ffmpeg): writing a GIF instead of %s", out.name)
    target = out.with_suffix(".gif")
    iio.imwrite(target, np.stack(frames), duration=1000 / frequency, loop=0, plugin="pillow")
    return target


def _has_encoder() -> bool:
    """Tell whether imageio's FFmpeg plugin finds its encoder."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return False
    return True


def render_rollout(task: Task, states: FloatArray, snapshots: FloatArray, lines: Sequence[str], out: Path) -> Path:
    """Write a video of one episode.

    Args:
        task: what was run.
        states: (T + 1, F) observed states.
        snapshots: (T + 1, S) as `World.save` gave them.
        lines: T + 1 texts (or T: the last one stays), the line of the program that acted in each state.
        out: file to write; its suffix becomes .gif where no encoder is found.

    Returns:
        The file written.

    Raises:
        TaskError: the counts disagree.
    """
    if len(states) != len(snapshots) or len(lines) not in (len(states), len(states) - 1) or len(lines) == 0:
        msg = f"{len(states)} states, {len(snapshots)} snapshots, {len(lines)} lines: expected T + 1, T + 1, T or T + 1"
        raise TaskError(msg)
    shown = [*lines, lines[-1]][: len(states)]
    rows = zip(states, snapshots, shown, strict=True)
    with closing(painter(task.layout)) as paint:
        frames = [caption(paint(state, snapshot), line) for state, snapshot, line in rows]
    return write_video(frames, out, task.frequency)
