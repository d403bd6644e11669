"""What the whole program says of its controllers: whether it reaches its goal, and whether one made it worse."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt

from roboscribe.dsl.interpreter import execute
from roboscribe.rl.program_training import SEEDS, ProgramTraining
from roboscribe.rl.skill import Skill
from roboscribe.world.layout import BoolArray, IntArray


def affordable(training: ProgramTraining, episodes: int) -> bool:
    """Tell whether so many episodes take no more than a quarter of the control steps of a skill, as evaluations do."""
    return episodes * training.task.horizon <= training.config.budget / 4


def tried(training: ProgramTraining, skills: Mapping[str, Skill], seeds: IntArray) -> tuple[BoolArray, int]:
    """Return in which episodes the program reaches its goal, (E,), and the control steps that they took."""
    found = execute(
        training.program,
        skills,
        training.task,
        seeds,
        limits=training.limits,
        until_end=not training.solve,
        confirm=training.config.confirm,
    )
    return found.success, found.control_steps


class WholeProgram:
    """Runs a program before and after one of its controllers was improved, in the same episodes.

    A controller may reach its own subgoal more often, and leave others in states from which they fail: a hand that
    comes near sooner has not closed its fingers yet.

    Args:
        training: the program, and how it is trained.
    """

    def __init__(self, training: ProgramTraining) -> None:
        """Draw the episodes."""
        self._training = training
        draw = training.draw(training.this_time("whole program"))
        self._seeds = draw.integers(SEEDS, size=training.config.assurance)
        self._best: BoolArray | None = None
        self._steps = 0

    def _tells(self, skills: Mapping[str, Skill]) -> bool:
        """Whether the program runs to its end, and trying it costs little."""
        known = all(run.controller in skills for run in self._training.runs)
        return known and affordable(self._training, 2 * len(self._seeds))

    def most(self, skills: Mapping[str, Skill]) -> int:
        """Return the most control steps that the next comparison may take."""
        runs = 1 if self._best is not None else 2
        return runs * len(self._seeds) * self._training.task.horizon if self._tells(skills) else 0

    def suffers(self, before: Mapping[str, Skill], after: Mapping[str, Skill]) -> bool:
        """Tell whether the program reaches its goal less often than the best so far, by more than a standard deviation.

        Of two that are alike chance makes one that much worse once in seven times.
        """
        if not self._tells(before):
            return False
        if self._best is None:
            self._best = self._try(before)
        success = self._try(after)
        lost, gained = int((self._best & ~success).sum()), int((~self._best & success).sum())
        self._best = success if gained > lost else self._best
        return lost - gained > sqrt(lost + gained)

    def _try(self, skills: Mapping[str, Skill]) -> BoolArray:
        success, steps = tried(self._training, skills, self._seeds)
        self._steps += steps
        return success

    def take_steps(self) -> int:
        """Return the control steps that were not counted yet."""
        steps, self._steps = self._steps, 0
        return steps
