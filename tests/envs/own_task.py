"""A task as somebody else would write it: a hand on a line pushes a button to its place."""

from __future__ import annotations

from pathlib import Path

SOURCE = '''
from dataclasses import dataclass

import numpy as np

from roboscribe.world.layout import Attribute, Layout, ObjectType
from roboscribe.world.task import Task


class Line:
    """A hand on a line that pushes a button along."""

    def __init__(self, batch):
        self.batch, self.control_steps, self.states = batch, 0, np.zeros((batch, 3))

    def reset(self, rows, seeds):
        starts = [np.random.default_rng(int(seed)).uniform((0.0, 0.3, 0.7), (0.2, 0.5, 1.0)) for seed in seeds]
        self.states[rows] = starts
        return self.observe(rows)

    def step(self, rows, actions):
        self.control_steps += len(rows)
        self.states[rows, 0] += 0.05 * np.clip(actions[:, 0], -1, 1)
        self.states[rows, 1] = np.maximum(self.states[rows, 0], self.states[rows, 1])
        return self.observe(rows)

    def observe(self, rows):
        return self.states[rows].copy()

    def diverged(self, rows):
        return np.zeros(len(rows), dtype=bool)

    def save(self, rows):
        return self.observe(rows)

    def load(self, rows, snapshots):
        self.states[rows] = snapshots
        return self.observe(rows)


@dataclass(frozen=True)
class Slide(Task):
    name: str = "slide"
    action_size: int = 1
    horizon: int = 60
    frequency: float = 10.0

    @property
    def layout(self):
        place = (Attribute("position", ("x",), "m"),)
        return Layout(ObjectType("EE", place), (ObjectType("button", place, place),))

    def solved(self, states):
        return np.abs(states[..., 1] - states[..., 2]) < 0.03

    def world(self, batch):
        return Line(batch)
'''
"""Without a demonstrator and without a picture."""

SHOWN = '''

    def demonstrate(self, episodes, seed):
        return [self.shown(np.random.default_rng([seed, episode])) for episode in range(episodes)]

    def shown(self, rng):
        world, row = self.world(1), np.arange(1)
        states, actions = [world.reset(row, rng.integers(2**31, size=1))], []
        while not self.solved(states[-1])[0]:
            wanted = (states[-1][:, 2:] - states[-1][:, :1]) / 0.05
            actions.append(np.clip(wanted + rng.normal(0, 0.1, wanted.shape), -1, 1))
            states.append(world.step(row, actions[-1]))
        return Trajectory(self.layout, np.concatenate(states), np.concatenate(actions), np.concatenate(states))

    def painter(self, width, height):
        return Picture(width, height)


class Picture:
    """Hand, button and goal are upright lines."""

    def __init__(self, width, height):
        self.width, self.height = width, height

    def __call__(self, state, snapshot):
        image = np.full((self.height, self.width, 3), 255, np.uint8)
        for color, x in enumerate(state):
            image[:, int(np.clip(x / 1.2, 0, 0.99) * self.width), :] = np.eye(3, dtype=np.uint8)[color] * 200
        return image

    def close(self):
        pass
'''
"""What a demonstrator and a picture of its own add, to the end of the class."""

IMPORT = "from roboscribe.world.task import Task\n"


def write_package(folder: Path) -> None:
    """Install a package `slides` with the task `slide`, its demonstrator and its picture into a folder."""
    source = SOURCE.replace(IMPORT, IMPORT + "from roboscribe.world.trajectory import Trajectory\n")
    (folder / "slides.py").write_text(source + SHOWN, encoding="utf-8")
    metadata = folder / "slides-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: slides\nVersion: 1.0\n", encoding="utf-8")
    (metadata / "entry_points.txt").write_text("[roboscribe.tasks]\nslide = slides:Slide\n", encoding="utf-8")
