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

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from roboscribe.envs import schematic
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, Layout
from roboscribe.world.task import Painter, Task

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


def painter(task: Task) -> Painter:
    """Return the task's own painter, or the schematic where it has none."""
    return task.painter(WIDTH, HEIGHT) or SchematicPainter(task.layout)


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
    with closing(painter(task)) as paint:
        frames = [caption(paint(state, snapshot), line) for state, snapshot, line in rows]
    return write_video(frames, out, task.frequency)
