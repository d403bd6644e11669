"""Raw demonstrations of robots in, a short readable program out, whose predicates and controllers are learned.

What users call:

| name | does |
|---|---|
| `load`, `Policy` | a program that drives one robot: `reset()`, `act(observation)`; where it stands can be read |
| `synthesize`, `Synthesis` | from a task and demonstrations to a program |
| `evaluate`, `Evaluation` | how often a program solves a task |
| `Demonstrations` | out of a Parquet file, of arrays, or from a task's own demonstrator |
| `Task`, `Layout`, `ObjectType`, `Attribute` | what a task of one's own declares |
| `SerialWorld`, `Simulator` | what it runs in, where its simulator knows one robot |
| `register`, `make_task`, `task_names` | tasks by name |
| `Fail`, `RoboScribeError` | no program, with the reason; bad input, in one line |
| `Limits`, `TrainConfig` | effort and settings |

Where to read on: `abstraction_refinement` has Algorithms 1 and 2, `steps` the pieces that they put together,
`classifier` (Algorithm 3), `subtask_tree` (4), `program_gen` (5), `loop_guard` (6), `reward` (Sec. 4.3.3) and
`rl.train_program`. `dsl` is the language, `world` what a robot's world is, `envs` has simulated ones, `io` files.

Importing this package imports nothing else; each name is imported when it is first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from roboscribe.envs.catalogue import make_task, register, task_names
    from roboscribe.envs.serial_world import SerialWorld, Simulator
    from roboscribe.errors import Fail, RoboScribeError
    from roboscribe.evaluation import Evaluation
    from roboscribe.io.demonstrations import Demonstrations
    from roboscribe.learning import synthesize
    from roboscribe.policy import Policy, evaluate, load
    from roboscribe.rl.config import TrainConfig
    from roboscribe.steps import Limits
    from roboscribe.synthesis import Synthesis
    from roboscribe.world.layout import Attribute, Layout, ObjectType
    from roboscribe.world.task import Task

__all__ = [
    "Attribute",
    "Demonstrations",
    "Evaluation",
    "Fail",
    "Layout",
    "Limits",
    "ObjectType",
    "Policy",
    "RoboScribeError",
    "SerialWorld",
    "Simulator",
    "Synthesis",
    "Task",
    "TrainConfig",
    "evaluate",
    "load",
    "make_task",
    "register",
    "synthesize",
    "task_names",
]

_HOMES = {
    "envs.catalogue": ("make_task", "register", "task_names"),
    "envs.serial_world": ("SerialWorld", "Simulator"),
    "errors": ("Fail", "RoboScribeError"),
    "evaluation": ("Evaluation",),
    "io.demonstrations": ("Demonstrations",),
    "learning": ("synthesize",),
    "policy": ("Policy", "evaluate", "load"),
    "rl.config": ("TrainConfig",),
    "steps": ("Limits",),
    "synthesis": ("Synthesis",),
    "world.layout": ("Attribute", "Layout", "ObjectType"),
    "world.task": ("Task",),
}
"""Which module each name comes from."""


def __getattr__(name: str) -> object:
    """Import what is used for the first time."""
    for home, names in _HOMES.items():
        if name in names:
            globals()[name] = getattr(import_module(f"{__name__}.{home}"), name)
            return globals()[name]
    msg = f"module {__name__} has no attribute {name!r}; expected one of {', '.join(__all__)}"
    raise AttributeError(msg)


def __dir__() -> list[str]:
    """List what users call."""
    return sorted(__all__)


if "IPython" in sys.modules:
    import_module(f"{__name__}.notebook").show_in_notebooks()
