"""Layouts, states and small settings that the tests share."""

from __future__ import annotations

import numpy as np

from roboscribe.baselines.config import BaselineConfig, ChunkConfig, CloningConfig, OffPolicyConfig, SetConfig
from roboscribe.dsl.rewrite import controllers
from roboscribe.dsl.syntax import Program
from roboscribe.world import Attribute, Layout, ObjectType
from roboscribe.world.layout import FloatArray

PLACE = Attribute("position", ("x", "y"))
OPEN = Attribute("opening", ("opening",))
SPEED = Attribute("velocity", ("dx", "dy"), "m/s")
ARM = ObjectType("EE", (PLACE, OPEN))
CUBE = ObjectType("cube", (PLACE, SPEED), (PLACE,))
DRAWER = ObjectType("drawer", (OPEN,), (OPEN,))
KITCHEN = Layout(ARM, (CUBE, DRAWER, CUBE, CUBE))

TINY = BaselineConfig(
    network=SetConfig(units=16, actor_layers=2, critic_layers=1),
    cloning=CloningConfig(steps=40, batch=16, checkpoint_every=10),
    chunks=ChunkConfig(CloningConfig(steps=40, batch=16, checkpoint_every=10), actions=4, units=16, layers=1, heads=2),
    learner=OffPolicyConfig(worlds=8, updates=1, batch=32, learning_starts=64, buffer=4_000, evaluate_every=160),
)
"""Settings with which everything runs and nothing is learned."""


def states_of(layout: Layout, count: int, seed: int = 0) -> FloatArray:
    """Draw states (count, F)."""
    return np.random.default_rng(seed).normal(size=(count, layout.size))


def only_controller(program: Program) -> str:
    """Name the controller of a program that is a single statement."""
    (run,) = controllers(program)
    return run.controller
