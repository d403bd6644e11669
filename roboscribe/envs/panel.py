"""What stands beside a film: the program with the line that acts, what is bound, and its predicates' values, live."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from textwrap import wrap
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from roboscribe.dsl.printer import pretty
from roboscribe.dsl.replay import Moment, Reading, guards, readings
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.semantics import holds
from roboscribe.dsl.syntax import Get, Predicate, Program
from roboscribe.world.layout import FloatArray
from roboscribe.world.task import Task

Frame: TypeAlias = NDArray[np.uint8]
"""RGB image (H, W, 3)."""
Color: TypeAlias = tuple[int, int, int]

PAPER, INK, SOFT, TRACK, LIT = (20, 24, 31), (228, 232, 239), (140, 151, 168), (52, 60, 74), (92, 74, 16)
GOOD, BAD, MARK = (84, 199, 138), (255, 131, 115), (255, 214, 102)
BUSY = (110, 168, 255)
MARGIN, SMALL, LARGE = 18, 14, 20
"""Free space at the edges and heights of letters, pixels."""
TEXTS = (18, 17, 16, 15, 14, 13, 12)
"""Heights of a program's letters, the best first."""
SHARE = 0.45
"""Share of the panel's height that the program may take."""
SPACING = 1.4
"""Height of a line, in letters."""


@dataclass(frozen=True, eq=False)
class RecordedEpisode:
    """One episode of a program, ready to be drawn.

    Args:
        states: (T + 1, F).
        snapshots: (T + 1, S) as `World.save` gave them.
        moments: T + 1, where the program stood.
        solved: whether the task was solved.
        title: how the episode is called.
        every: control steps between two of these states.
        steps: the control step of each of them; empty where they are all there.
    """

    states: FloatArray
    snapshots: FloatArray
    moments: tuple[Moment, ...]
    solved: bool
    title: str
    every: int = 1
    steps: tuple[int, ...] = ()

    def step(self, frame: int) -> int:
        """Return the control step of a frame."""
        return self.steps[frame] if self.steps else frame

    def thinned(self, every: int) -> RecordedEpisode:
        """Keep one state of `every`, and the last one."""
        last = len(self.states) - 1
        kept = sorted({*range(0, last, every), last})
        return replace(
            self,
            states=self.states[kept],
            snapshots=self.snapshots[kept],
            moments=tuple(self.moments[index] for index in kept),
            every=every * self.every,
            steps=tuple(self.step(index) for index in kept),
        )


@lru_cache(maxsize=16)
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Load a monospaced font with the logical symbols; matplotlib ships it."""
    from matplotlib import get_data_path

    name = "DejaVuSansMono-Bold.ttf" if bold else "DejaVuSansMono.ttf"
    return ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / name), size)


class Panel:
    """Draws the panel of one episode, frame by frame.

    Args:
        task: what was run.
        program: by what.
        take: the episode.
        size: width and height, pixels.
    """

    def __init__(self, task: Task, program: Program, take: RecordedEpisode, size: tuple[int, int]) -> None:
        """Wrap the program's lines and read every predicate in every state."""
        self._task, self._take, self._size = task, take, size
        self._runs, self._guards = controllers(program), guards(program)
        self._text = _fitting(pretty(program), size)
        self._width = _letters(size[0], self._text)
        self._lines = _wrapped(pretty(program), self._width)
        self._ranges = self._measure()

    def draw(self, frame: int) -> Frame:
        """Draw the panel of a frame; the last one says how it ended."""
        image = Image.new("RGB", self._size, PAPER)
        pen = _Pen(image, ImageDraw.Draw(image), self._text)
        moment = self._take.moments[frame]
        pen.write(f"{self._task.name}", LARGE, bold=True)
        pen.note(f"{self._take.title}   {self._take.step(frame) / self._task.frequency:5.2f} s")
        pen.skip(10)
        for run, line in self._lines:
            pen.write(line, self._text, lit=run == moment.run >= 0)
        pen.skip(10)
        bound = "   ".join(f"{name} = {self._task.layout.names[entity]}" for name, entity in moment.bound.items())
        if moment.ended:
            pen.note("the program is over, its last controller acts on")
        else:
            pen.write(bound or "nothing is bound", self._text, MARK if bound else SOFT, bold=bool(bound))
        if moment.run >= 0:
            self._conditions(pen, frame, moment)
        if frame == len(self._take.moments) - 1:
            pen.stamp("✓ solved" if self._take.solved else "✗ not solved", GOOD if self._take.solved else BAD)
        return np.asarray(image)

    def _conditions(self, pen: _Pen, frame: int, moment: Moment) -> None:
        """Show the guard around the acting line, and its goal."""
        guard = self._guards[moment.run]
        if guard is not None:
            pen.skip(8)
            asked = "get: of which entities its condition holds" if isinstance(guard, Get) else "condition around it"
            pen.note(asked)
            if isinstance(guard, Get):
                pen.chips(self._candidates(guard, frame, moment))
            else:
                self._bars(pen, self._read(guard, frame, moment))
        goal = self._read(self._runs[moment.run].until, frame, moment)
        if goal:
            pen.skip(8)
            pen.note(f"π_{self._runs[moment.run].controller} acts until")
            self._bars(pen, goal)

    def _bars(self, pen: _Pen, found: Sequence[Reading]) -> None:
        for reading in found:
            pen.reading(reading, self._ranges.get(reading.said, (0.0, 1.0)), self._width)

    def _read(self, predicate: Predicate, frame: int, moment: Moment) -> tuple[Reading, ...]:
        task = self._task
        return readings(predicate, self._take.states[frame], moment.bound, task.layout, task.solved)

    def _candidates(self, guard: Get, frame: int, moment: Moment) -> list[tuple[str, bool]]:
        """Tell of which entities a guard holds."""
        layout, state = self._task.layout, self._take.states[frame]
        members = layout.of_type(guard.type)
        bound = {**moment.bound}
        return [
            (layout.names[e], bool(holds(guard.where, state, {**bound, guard.var.name: e}, layout, self._task.solved)))
            for e in members
        ]

    def _measure(self) -> Mapping[str, tuple[float, float]]:
        """Find the range of every value that is shown, threshold included."""
        found: dict[str, tuple[float, float]] = {}
        for frame, moment in enumerate(self._take.moments):
            if moment.run < 0:
                continue
            guard = self._guards[moment.run]
            asked = [self._runs[moment.run].until, *([] if guard is None or isinstance(guard, Get) else [guard])]
            for reading in (r for predicate in asked for r in self._read(predicate, frame, moment)):
                if isfinite(reading.value):
                    low, high = found.get(reading.said, (reading.threshold, reading.threshold))
                    found[reading.said] = (min(low, reading.value), max(high, reading.value))
        return found


def _letters(width: int, size: int) -> int:
    """Count the letters of a height that fit beside each other."""
    return int((width - 2 * MARGIN) / font(size).getlength("M"))


def _fitting(source: str, size: tuple[int, int]) -> int:
    """Choose the largest letters with which a program takes its share of the panel, and breaks no line or must."""
    lines = source.count("\n")
    for text in TEXTS:
        wrapped = len(_wrapped(source, _letters(size[0], text)))
        if wrapped * text * SPACING <= SHARE * size[1] and (wrapped <= lines or text <= 14):
            return text
    return TEXTS[-1]


def _wrapped(source: str, width: int) -> list[tuple[int, str]]:
    """Break long lines, further parts indented; with each the controller that acts on it, -1 for none."""
    found: list[tuple[int, str]] = []
    run = -1
    for line in source.rstrip().split("\n"):
        acts = line.lstrip().startswith("π_")
        run += acts
        indent = line[: len(line) - len(line.lstrip())]
        parts = wrap(line, width, subsequent_indent=f"{indent}    ", drop_whitespace=True, break_long_words=True)
        found += [(run if acts else -1, part) for part in parts or [""]]
    return found


class _Pen:
    """Writes from top to bottom."""

    def __init__(self, image: Image.Image, draw: ImageDraw.ImageDraw, text: int) -> None:
        self._draw, self._width, self._height = draw, image.width, image.height
        self._text = text
        self._y = float(MARGIN)

    def skip(self, pixels: float) -> None:
        self._y += pixels

    def write(self, line: str, size: int, color: Color = INK, bold: bool = False, lit: bool = False) -> None:
        """Write a line; one that acts has a light behind it."""
        height = size * SPACING
        if lit:
            self._draw.rectangle((MARGIN - 8, self._y, self._width - MARGIN + 8, self._y + height), fill=LIT)
            self._draw.rectangle((MARGIN - 8, self._y, MARGIN - 5, self._y + height), fill=MARK)
        middle = self._y + height / 2
        self._draw.text((MARGIN, middle), line, fill=color, font=font(size, bold), anchor="lm")
        self._y += height

    def note(self, said: str) -> None:
        """Write something less important, on as many lines as it takes."""
        for line in wrap(said, _letters(self._width, SMALL)):
            self.write(line, SMALL, SOFT)

    def chips(self, entities: Sequence[tuple[str, bool]]) -> None:
        """Write names beside each other, light where it holds."""
        x, height = float(MARGIN), self._text * SPACING
        for name, holds_of in entities:
            width = font(self._text).getlength(name) + 14
            if x + width > self._width - MARGIN:
                x, self._y = float(MARGIN), self._y + height + 4
            self._draw.rounded_rectangle((x, self._y, x + width, self._y + height), 5, fill=GOOD if holds_of else TRACK)
            color = PAPER if holds_of else SOFT
            self._draw.text((x + 7, self._y + height / 2), name, fill=color, font=font(self._text), anchor="lm")
            x += width + 6
        self._y += height + 4

    def reading(self, reading: Reading, span: tuple[float, float], letters: int) -> None:
        """Show a comparison: its text, its value as a bar, and its threshold as a tick."""
        color = GOOD if reading.holds else BUSY
        value = f"   now {reading.value:.4g}" if isfinite(reading.value) else ""
        for line in wrap(f"{'✓' if reading.holds else '·'} {reading.said}{value}", letters, subsequent_indent="    "):
            self.write(line, self._text, color if reading.holds else INK)
        if not isfinite(reading.value):
            return
        left, right = MARGIN, self._width - MARGIN
        low, high = span
        scale = (right - left) / ((high - low) or 1.0)
        self.skip(4)
        place, tick = left + scale * (reading.value - low), left + scale * (reading.threshold - low)
        self._draw.rectangle((left, self._y, right, self._y + 8), fill=TRACK)
        self._draw.rectangle((left, self._y, max(place, left + 1), self._y + 8), fill=color)
        self._draw.rectangle((tick - 1, self._y - 3, tick + 1, self._y + 11), fill=MARK)
        self.skip(20)

    def stamp(self, said: str, color: Color) -> None:
        """Write how it ended at the bottom."""
        top = self._height - MARGIN - 46
        self._draw.rounded_rectangle((MARGIN, top, self._width - MARGIN, self._height - MARGIN), 8, fill=color)
        place = (self._width / 2, top + 23)
        self._draw.text(place, said, fill=PAPER, font=font(24, bold=True), anchor="mm")
