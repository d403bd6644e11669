"""Programs that drive one robot, step by step, in whatever loop their user has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from roboscribe.defaults import EVALUATION_EPISODES
from roboscribe.dsl.interpreter import at_work
from roboscribe.dsl.machine import Machine
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import program_text, text
from roboscribe.dsl.rewrite import controllers, run_variables
from roboscribe.dsl.syntax import Program
from roboscribe.envs.catalogue import make_task
from roboscribe.errors import ProgramError, expected
from roboscribe.evaluation import Evaluation, Watch, ignore_counts, measure
from roboscribe.html.code import program_html
from roboscribe.html.style import standalone
from roboscribe.io.saved_program import SavedProgram, load_program
from roboscribe.onnx_controllers import write_onnx
from roboscribe.programs import program_directory
from roboscribe.runnable import Runnable
from roboscribe.saved import open_saved
from roboscribe.world.layout import NULL, FloatArray
from roboscribe.world.task import Task

ROW = np.zeros(1, dtype=np.int64)
"""The only row there is."""


class Policy:
    """A program with its controllers, driving one robot.

    `reset` begins an episode, `act` is called once per control step, at the frequency of the task. In between
    `counter`, `line`, `bound` and `ended` say where the program stands.

    Args:
        runnable: the program and its controllers.
        task: says what observations mean and how many numbers an action has; it is never stepped.
    """

    def __init__(self, runnable: Runnable, task: Task) -> None:
        """Check that the program fits the task, and begin an episode.

        Raises:
            ProgramError: it does not, or runs a controller that is not there.
        """
        self.runnable = runnable
        self.task = task
        self._runs = controllers(runnable.program)
        missing = [run.controller for run in self._runs if run.controller not in runnable.library]
        if missing:
            given = ", ".join(sorted(runnable.library)) or "none"
            msg = f"program {self.program.name} runs π_{missing[0]}; controllers given: {given}"
            raise ProgramError(msg)
        limits, confirm = runnable.limits, runnable.confirm
        self._machine = Machine(self.program, task.layout, 1, limits=limits, confirm=confirm, solved=task.solved)
        self._sizes = [len(run_variables(run)) for run in self._runs]
        self._crew = [at_work(runnable.library[run.controller], 1) for run in self._runs]

    def reset(self) -> None:
        """Begin an episode: the program starts over."""
        self._machine.reset(ROW)
        for controller in self._crew:
            controller.forget(ROW)

    def act(self, observation: Any) -> FloatArray:  # noqa: ANN401 - whatever the task reads
        """Observe and choose an action.

        The same, bit for bit, as the batched interpreter does. A program that is over leaves its last controller
        acting; one that never had any commands zero.

        Args:
            observation: a state (F,), its columns by name, or what the task's environment observes; see `Task.read`.

        Returns:
            (A,) in [-1, 1].

        Raises:
            TaskError: an observation that is none.
        """
        state = self.task.read(observation)[None]
        self._machine.advance(ROW, state)
        rank = self.counter
        if rank < 0:
            return np.zeros(self.task.action_size)
        entities = self._machine.entities(ROW)[:, : self._sizes[rank]]
        action: FloatArray = self._crew[rank].act(ROW, state, entities)[0]
        return action

    @property
    def program(self) -> Program:
        """The program."""
        return self.runnable.program

    @property
    def frequency(self) -> float:
        """Control steps per second for which it was made."""
        return self.task.frequency

    @property
    def counter(self) -> int:
        """Which of the program's controller statements acts, counted from 0 in textual order; -1 for none yet."""
        return int(self._machine.run_index[0])

    @property
    def line(self) -> str:
        """The statement that acts, as it prints; empty before the first one."""
        return text(self._runs[self.counter]) if self.counter >= 0 else ""

    @property
    def bound(self) -> dict[str, str]:
        """The entity that each variable is bound to, both by name; variables that are null are left out."""
        names = self.task.layout.names
        return {name: names[entity] for name, entity in self._machine.binding(0).items() if entity != NULL}

    @property
    def ended(self) -> bool:
        """Whether the program is over."""
        return bool(self._machine.ended[0])

    def edited(self, program: str) -> Policy:
        """Return a policy with the same controllers that runs another text.

        Args:
            program: for instance `str(policy)` with another threshold.

        Raises:
            ProgramError: it does not parse, does not fit the task, or runs a controller that is not there.
        """
        return Policy(replace(self.runnable, program=parse_program(program)), self.task)

    def save_onnx(self, directory: str | Path) -> tuple[Path, ...]:
        """Write every learned controller to `onnx/NAME.onnx` in a directory, for robots on which no Python runs.

        Each takes what it sees by name, "mu.position" for instance, in rows, and returns `action`.

        Raises:
            ArtifactError: the system refused.
        """
        return write_onnx(Path(directory), self.program, self.runnable.library)

    def __str__(self) -> str:
        """Spell the program, as it can be edited."""
        return program_text(self.program)

    def html(self) -> str:
        """Return the program with colours and hover texts, as a fragment of a page."""
        return program_html(self.program)

    def _repr_html_(self) -> str:
        """Show the program in a notebook."""
        return standalone(self.html())


def load(program: str | Path, task: Task | str | None = None) -> Policy:
    """Load a program, or a baseline, ready to drive one robot.

    Args:
        program: a directory that `roboscribe synthesize --out` or `Synthesis.save` wrote, an edited copy of it, the
            name of a shipped program, or an MLflow run id.
        task: what it shall do, or the name of that; None is the task for which it was made.

    Raises:
        ArtifactError: there is no such program, or its files are damaged or do not fit the task.
        ProgramError: its text is no program.
        TaskError: an unknown task.
    """
    with program_directory(program) as directory:
        saved = load_program(directory)
        where = _own_task(saved) if task is None else task_named(task)
        return Policy(open_saved(saved, where, str(directory)), where)


def _own_task(saved: SavedProgram) -> Task:
    """Build the task for which a program was made, as it was then."""
    task = make_task(str(saved.manifest["task"]), contact=saved.contact, timing=saved.timing)
    return task if saved.horizon is None else task.lasting(saved.horizon)


def evaluate(
    program: Policy | str | Path,
    task: Task | str | None = None,
    *,
    episodes: int = EVALUATION_EPISODES,
    seed: int = 0,
    watch: Watch = ignore_counts,
) -> Evaluation:
    """Measure how often a program solves a task.

    Args:
        program: a policy, or what `load` takes.
        task: where; None is the policy's own, or the task for which the program was made.
        episodes: how many to run.
        seed: decides them.
        watch: told how many episodes are done and how many succeeded.

    Raises:
        ArtifactError: see `load`; the others, too.
    """
    expected("episodes", episodes, 1)
    policy = program if isinstance(program, Policy) else load(program, task)
    where = policy.task if task is None else task_named(task)
    return measure(policy.runnable, where, seed, episodes, watch)


def task_named(task: Task | str) -> Task:
    """Return a task as it is, or look its name up.

    Raises:
        TaskError: there is none of this name.
    """
    return make_task(task) if isinstance(task, str) else task
