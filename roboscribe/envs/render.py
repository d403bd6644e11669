"""Films of rollouts: the scene on the left, the program at work on the right, or many episodes at once.

A task's own painter draws the scene where it has one (MuJoCo through EGL or OSMesa); elsewhere a schematic is drawn.
The file is an MP4 where imageio finds an encoder, else a GIF.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from PIL import Image, ImageDraw

from roboscribe.dsl.syntax import Program
from roboscribe.envs.panel import BAD, GOOD, PAPER, Frame, Panel, RecordedEpisode, font
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray, Layout
from roboscribe.world.task import Painter, Task

SIZE = (1280, 720)
"""Width and height of a film, pixels."""
SMALL = (960, 540)
"""The same of a film within a page."""
POSTER = (640, 640)
"""Most pixels of a picture that stands for a film."""
GIF_WIDTH, GIF_RATE = 800, 12.5
"""Most pixels and frames per second of a GIF, which has no compression to speak of."""
COLORS, CLEAR = 120, 255
"""Colours of a GIF that are chosen in either of two ways, and the number that lets the picture before shine through."""
SUFFIXES = (".mp4", ".gif")
HOLD = 1.0
"""Seconds for which the last picture stays."""
SLOW = 0.25
"""Speed of slow motion."""
log = logging.getLogger(__name__)


def check_suffix(out: Path) -> None:
    """Refuse a film of another kind before anything runs.

    Raises:
        TaskError: the name ends otherwise.
    """
    if out.suffix.lower() not in SUFFIXES:
        msg = f"{out}: found suffix {out.suffix!r}, expected {' or '.join(SUFFIXES)}"
        raise TaskError(msg)


@runtime_checkable
class Pointing(Protocol):
    """A painter that can point at things."""

    def point_at(self, places: Sequence[FloatArray]) -> None:
        """Point at places (n,) from the next picture on."""


class SchematicPainter:
    """Draws any task's positions without OpenGL, on axes that stay as they are."""

    def __init__(self, layout: Layout, states: FloatArray, size: tuple[int, int]) -> None:
        """Find what the axes have to show in an episode (T, F)."""
        from roboscribe.envs import schematic  # matplotlib takes long to load, and is seldom needed

        self._schematic = schematic.Schematic(layout, schematic.limits(layout, states), size)
        self._pointed: Sequence[FloatArray] = ()

    def __call__(self, state: FloatArray, snapshot: FloatArray) -> Frame:
        """Draw the state; the snapshot is not needed."""
        del snapshot
        return self._schematic.draw(state, self._pointed)

    def point_at(self, places: Sequence[FloatArray]) -> None:
        """Draw a frame around some places from the next picture on."""
        self._pointed = tuple(places)

    def close(self) -> None:
        """Nothing is held."""


def painter(task: Task, states: FloatArray, size: tuple[int, int], stored: bool = True) -> Painter:
    """Return the task's own painter, or the schematic of an episode (T, F) where it has none.

    The schematic, too, where no simulator states are `stored`, of which the task could draw its picture.
    """
    own = task.painter(*size) if stored else None
    return own or SchematicPainter(task.layout, states, size)


def film_episode(task: Task, program: Program, take: RecordedEpisode, size: tuple[int, int] = SIZE) -> Iterator[Frame]:
    """Draw an episode beside the program that runs it.

    Args:
        task: what was run.
        program: by what.
        take: the episode.
        size: width and height, pixels; both even.

    Yields:
        A frame for every state, then the last one for another second.

    Raises:
        TaskError: the counts of states, snapshots and moments disagree.
    """
    _check(take)
    width, height = size
    panel = Panel(task, program, take, (width - height, height))
    with closing(painter(task, take.states, (height, height))) as paint:
        for index, (state, snapshot) in enumerate(zip(take.states, take.snapshots, strict=True)):
            if isinstance(paint, Pointing):
                paint.point_at(_bound_places(task.layout, take, index))
            last = np.hstack([paint(state, snapshot), panel.draw(index)])
            yield last
    yield from [last] * round(HOLD * task.frequency / take.every)


def _bound_places(layout: Layout, take: RecordedEpisode, index: int) -> list[FloatArray]:
    """Where the entities are that the program has bound; none once it is over."""
    moment = take.moments[index]
    columns = [layout.columns.get((entity, "position", False)) for entity in moment.bound.values() if not moment.ended]
    return [take.states[index, place] for place in columns if place is not None]


def film_grid(
    task: Task, takes: Sequence[RecordedEpisode], columns: int, size: tuple[int, int] = SIZE
) -> Iterator[Frame]:
    """Draw several episodes at once; those that are over stay as they ended, framed by how.

    Args:
        task: what was run.
        takes: the episodes.
        columns: how many stand beside each other.
        size: width and height, pixels.

    Yields:
        A frame for every state of the longest episode, then the last one for another second.

    Raises:
        TaskError: the counts of states, snapshots and moments disagree.
    """
    rows = -(-len(takes) // columns)
    cell = (size[0] // columns, size[1] // rows)
    for take in takes:
        _check(take)
    states = np.concatenate([take.states for take in takes])
    stored = all(take.snapshots.shape[1] for take in takes)
    longest = max(len(take.states) for take in takes)
    shown: list[Frame] = [np.zeros((cell[1], cell[0], 3), dtype=np.uint8)] * len(takes)
    with ExitStack() as stack:
        paint = stack.enter_context(closing(painter(task, states, cell, stored)))
        for index in range(longest):
            for place, take in enumerate(takes):
                if index < len(take.states):
                    over = index == len(take.states) - 1
                    shown[place] = _framed(paint(take.states[index], take.snapshots[index]), take, over)
            last = _tiled(shown, columns, size, cell)
            yield last
    yield from [last] * round(HOLD * task.frequency)


def _check(take: RecordedEpisode) -> None:
    counts = (len(take.states), len(take.snapshots), len(take.moments))
    if len(set(counts)) != 1 or not counts[0]:
        msg = f"{counts[0]} states, {counts[1]} snapshots, {counts[2]} moments: expected T + 1 of each"
        raise TaskError(msg)


def _framed(picture: Frame, take: RecordedEpisode, over: bool) -> Frame:
    """Write an episode's title into its picture; where it is over, frame it."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    color = GOOD if take.solved else BAD
    title = f"{take.title} {'✓' if take.solved else '✗'}" if over else take.title
    draw.text((8, 6), title, fill=color if over else PAPER, font=font(14, bold=True))
    if over:
        draw.rectangle((0, 0, image.width - 1, image.height - 1), outline=color, width=4)
    return np.asarray(image)


def _tiled(pictures: Sequence[Frame], columns: int, size: tuple[int, int], cell: tuple[int, int]) -> Frame:
    whole = np.full((size[1], size[0], 3), PAPER, dtype=np.uint8)
    for place, picture in enumerate(pictures):
        top, left = cell[1] * (place // columns), cell[0] * (place % columns)
        whole[top : top + cell[1], left : left + cell[0]] = picture
    return whole


def write_video(frames: Iterable[Frame], out: Path, frequency: float) -> Path:
    """Write frames as they come, as MP4, or as GIF where `out` says so or no encoder is found.

    Args:
        frames: pictures of one size.
        out: file to write; its directory is made.
        frequency: frames per second.

    Returns:
        The file written.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    if out.suffix.lower() != ".gif" and _has_encoder():
        return _write_mp4(frames, out, frequency)
    if out.suffix.lower() != ".gif":
        log.warning("no video encoder (package imageio-ffmpeg): writing a GIF instead of %s", out.name)
    return _write_gif(frames, out.with_suffix(".gif"), frequency)


def poster(video: Path) -> bytes:
    """Return the last picture of a film as JPEG, to stand in its place until it plays."""
    import imageio.v3 as iio

    last = None
    for frame in iio.imiter(video):
        last = frame
    image = Image.fromarray(np.asarray(last)[..., :3])
    image.thumbnail(POSTER)
    data = BytesIO()
    image.save(data, "JPEG", quality=80)
    return data.getvalue()


def _write_mp4(frames: Iterable[Frame], out: Path, frequency: float) -> Path:
    from imageio import v2

    writer: Any = v2.get_writer(out, format="FFMPEG", mode="I", fps=frequency, macro_block_size=2, quality=7)
    with writer:
        for frame in frames:
            writer.append_data(frame)
    return out


def _write_gif(frames: Iterable[Frame], out: Path, frequency: float) -> Path:
    """Write a GIF, smaller and with fewer frames where it would be too large; what stays the same is stored once."""
    every = steps_per_picture(frequency)
    images = [_shrunk(frame) for index, frame in enumerate(frames) if index % every == 0]
    palette = _palette(images)
    drawn = [np.asarray(image.quantize(palette=palette, dither=Image.Dither.NONE)) for image in images]
    changed = [drawn[0], *(np.where(new == old, CLEAR, new) for old, new in pairwise(drawn))]
    first, *others = (_paletted(pixels.astype(np.uint8), palette) for pixels in changed)
    duration = round(1000 * every / frequency)
    first.save(out, save_all=True, append_images=others, duration=duration, loop=0, transparency=CLEAR, disposal=1)
    return out


def steps_per_picture(frequency: float) -> int:
    """Return how many control steps pass between two pictures at `GIF_RATE`, in a world of so many steps a second."""
    return max(1, round(frequency / GIF_RATE))


def _shrunk(frame: Frame) -> Image.Image:
    """Scale a frame down."""
    image = Image.fromarray(frame)
    if image.width > GIF_WIDTH:
        image = image.resize((GIF_WIDTH, image.height * GIF_WIDTH // image.width), Image.Resampling.LANCZOS)
    return image


def _palette(images: Sequence[Image.Image]) -> Image.Image:
    """Choose colours that fit the first, the middle and the last of some images."""
    width, height = images[0].size
    sheet = Image.new("RGB", (width, 3 * height))
    for place, image in enumerate((images[0], images[len(images) // 2], images[-1])):
        sheet.paste(image, (0, place * height))
    methods = (Image.Quantize.MEDIANCUT, Image.Quantize.MAXCOVERAGE)  # what is large, and what is small but colourful
    colors = [sheet.quantize(COLORS, method).getpalette() or [] for method in methods]
    palette = Image.new("P", (1, 1))
    palette.putpalette([number for own in colors for number in own[: 3 * COLORS]])
    return palette


def _paletted(pixels: Frame, palette: Image.Image) -> Image.Image:
    image = Image.fromarray(pixels, "P")
    image.putpalette(palette.getpalette() or [])
    return image


def _has_encoder() -> bool:
    """Tell whether imageio's FFmpeg plugin finds its encoder."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return False
    return True
